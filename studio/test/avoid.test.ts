import assert from "node:assert/strict";
import { test } from "node:test";
import { splitArcs, findJumps, rangesToAvoid } from "../src/avoid";
import type { Point } from "../src/motions";
import { hull } from "../src/hull";
import { ticks } from "../src/plane";

const at = (value: number, amplitude: number, multiplier = 0.5, kind: Point["kind"] = ""): Point => ({
  value,
  amplitudes: [amplitude],
  kind,
  start: [],
  multipliers: [[multiplier, 0]],
});

test("a resonance is to be avoided between its half-power points", () => {
  // of a linear oscillator with the natural frequency 1 and a damping ratio of 0.01: about 0.99 to 1.01
  const branch = Array.from({ length: 2001 }, (_, i) => {
    const r = 0.5 + i / 2000;
    return at(r, 1 / Math.hypot(1 - r * r, 0.02 * r));
  });
  const [range, ...others] = rangesToAvoid(splitArcs(branch, 1e-6), 0.5, 1.5);
  assert.equal(others.length, 0);
  assert.match(range.why, /resonance/);
  assert.ok(
    Math.abs(range.low - 0.99) < 2e-4 && Math.abs(range.high - 1.01) < 2e-4,
    `${range.low} ${range.high}`,
  );
});

test("between two folds there are several motions, and each ends with a jump", () => {
  const branch = [
    at(0, 1), at(1, 1.1), at(2, 1.2, 1, "fold"), at(1.5, 1.6, 3), at(1, 2, 1, "fold"), at(2, 2.1), at(3, 2.2),
  ]; // prettier-ignore
  const arcs = splitArcs(branch, 1e-6);
  assert.deepEqual(arcs.map(({ stable }) => stable), [true, false, true]); // prettier-ignore
  const [several] = rangesToAvoid(arcs, 0, 3);
  assert.deepEqual([several.low, several.high], [1, 2]);
  assert.match(several.why, /several/);
  assert.deepEqual(findJumps(arcs), [
    { value: 1, rising: false, before: 2, after: [1.1] },
    { value: 2, rising: true, before: 1.2, after: [2.1] },
  ]);
});

test("where no motion is stable is to be avoided", () => {
  const branch = [at(0, 1), at(1, 1, -1, "doubling"), at(2, 1, -2), at(3, 1, -1, "doubling"), at(4, 1)];
  const [range] = rangesToAvoid(splitArcs(branch, 1e-6), 0, 4);
  assert.deepEqual([range.low, range.high], [1, 3]);
  assert.match(range.why, /no stable/);
});

test("an envelope is the convex hull", () => {
  const corners = hull([[0, 0], [2, 0], [1, 0.5], [2, 2], [0, 2], [1, 1]]); // prettier-ignore
  assert.deepEqual(corners, [[0, 0], [2, 0], [2, 2], [0, 2]]); // prettier-ignore
});

test("axes have round numbers", () => {
  assert.deepEqual(ticks([0, 10], 5), [0, 2, 4, 6, 8, 10]);
  assert.deepEqual(ticks([170, 2607], 5), [500, 1000, 1500, 2000, 2500]);
});
