import assert from "node:assert/strict";
import { test } from "node:test";
import { comesBack, resampled } from "../src/sketch";
import { points } from "./wheel";

const SQUARE = points("0 0, 2 0, 2 2, 0 2");

test("points are at equal steps along a path, of a closed one the last before the first", () => {
  assert.deepEqual(resampled(SQUARE, true, 8), points("0 0, 1 0, 2 0, 2 1, 2 2, 1 2, 0 2, 0 1"));
  assert.deepEqual(resampled(SQUARE, false, 4), SQUARE);
  // a pointer that rests gives a point twice
  assert.deepEqual(resampled(points("0 0, 0 0, 2 0"), false, 3), points("0 0, 1 0, 2 0"));
});

test("a stroke that ends near its beginning is closed", () => {
  assert.equal(comesBack(SQUARE), false);
  assert.equal(comesBack([...SQUARE, [0.1, 0.1]]), true);
  assert.equal(comesBack(points("0 0, 1 0, 0 0")), false);
});
