import assert from "node:assert/strict";
import { test } from "node:test";
import { History } from "../src/history";

test("what was done is undone and done again", () => {
  const history = new History<number[]>("[0]");
  history.keep([1]);
  history.keep([2]);
  assert.deepEqual(history.undo(), [1]);
  assert.deepEqual(history.undo(), [0]);
  assert.equal(history.canUndo, false);
  assert.equal(history.undo(), undefined);
  assert.deepEqual(history.redo(), [1]);
  assert.equal(history.canRedo, true);
});

test("the same state again is no step, and a new one ends what could be done again", () => {
  const history = new History<number[]>("[0]");
  history.keep([0]);
  assert.equal(history.canUndo, false);
  history.keep([1]);
  history.undo();
  history.keep([3]);
  assert.equal(history.redo(), undefined);
  assert.deepEqual(history.undo(), [0]);
});
