import assert from "node:assert/strict";
import { test } from "node:test";
import { allGiven, jointPlace, outputPlace, rowLength, checkState } from "../src/tables";
import { STATE, TABLES, WHEEL } from "./wheel";

test("a row holds time, state, outputs and places", () => {
  assert.equal(rowLength(WHEEL), 1 + 1 + 2 + 3 + 2);
  assert.equal(outputPlace(WHEEL, 1), 3);
  assert.equal(jointPlace(WHEEL, 0), 4);
});

test("what a state leaves out has its start value", () => {
  const given = new Map(allGiven(WHEEL, STATE.values));
  assert.equal(given.get(0), 0.25);
  assert.equal(given.get(3), 2);
  assert.equal(given.get(9), 1e-12);
});

const behind = { x: 0, y: 0, width: 1, angle: 0, opacity: 0.5, locked: true };

test("a good state comes through as it is", () => {
  const whole = { ...STATE, duration: 2, locks: ["wheel.radius"], behind, view: [0, 0, 1, 0, 0] };
  assert.deepEqual(checkState(JSON.parse(JSON.stringify(whole)), TABLES), whole);
  assert.deepEqual(checkState({ mechanism: "wheel", more: 1 }, TABLES), { ...STATE, title: "", values: {} });
});

for (const [change, said] of [
  [{ mechanism: "cart" }, /no mechanism "cart"/],
  [{ values: { "wheel.mass": 1 } }, /wheel has no "wheel.mass"/],
  [{ values: { "wheel.radius": "1" } }, /wheel.radius is "1"/],
  [{ values: { "wheel.radius": null } }, /wheel.radius is null/],
  [{ values: 3 }, /values is 3/],
  [{ title: 3 }, /title is 3/],
  [{ source: "both" }, /source is "both"/],
  [{ duration: 0 }, /duration is 0/],
  [{ locks: ["x"] }, /locks is \["x"\]/],
  [{ behind: { ...behind, width: 0 } }, /behind/],
  [{ behind: null }, /behind/],
  [{ view: [1] }, /view is \[1\]/],
] as const)
  test(`a state with ${JSON.stringify(change)} is refused`, () => {
    assert.throws(() => checkState({ ...STATE, ...change }, TABLES), said);
  });

test("a state that is no object is refused", () => {
  for (const data of [null, 3, "x"]) assert.throws(() => checkState(data, TABLES), /no object|no mechanism/);
});
