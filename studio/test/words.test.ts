import assert from "node:assert/strict";
import { test } from "node:test";
import type { Orbit, Rows } from "../src/core";
import { digits, motionInWords, multiplierInWords, shown, verdictInWords } from "../src/words";
import { WHEEL } from "./wheel";

const orbit = (first: [number, number]): Orbit => ({
  found: true,
  sentence: "",
  size: 1,
  period: 1,
  start: [],
  place: 0,
  multipliers: [first],
});
/** Rows of time, state, angle, position, place and powers. */
const rows = (...all: [number, number][]): Rows => ({
  values: Float64Array.from(all.flatMap(([angle, position], n) => [n, 0, angle, position, 0, 0, 0, 0, 0])),
  count: all.length,
  sentence: "",
});

test("numbers have the digits that people read", () => {
  assert.equal(digits(0.123456), "0.1235");
  assert.equal(digits(1234567), "1.235e6");
  assert.equal(digits(-0.00001234), "-1.234e-5");
  assert.equal(digits(0), "0");
  assert.equal(digits(Number.NaN), "NaN");
  assert.equal(shown(0.05, WHEEL.outputs[1]), "50 mm");
});

test("a verdict has a margin, and a multiplier its modulus", () => {
  assert.equal(verdictInWords(orbit([0.5, 0.5]), 1e-6), "stable");
  assert.equal(verdictInWords(orbit([0.8, 0.8]), 1e-6), "unstable");
  assert.equal(verdictInWords(orbit([1, 0]), 1e-6), "marginal");
  assert.equal(verdictInWords({ ...orbit([0, 0]), found: false }, 1e-6), "no periodic motion");
  assert.match(verdictInWords({ ...orbit([0, 0]), size: 0, multipliers: [] }, 1e-6), /prescribed/);
  assert.equal(multiplierInWords([0.3, -0.4]), "0.3 − 0.4i (modulus 0.5)");
  assert.equal(multiplierInWords([-0.25, 0]), "-0.25");
  assert.equal(multiplierInWords([-1.035, 9.3e-61]), "-1.035");
});

test("a motion is described by its turn and its range", () => {
  const none = { ...orbit([0, 0]), found: false, sentence: "it does not settle" };
  const whole = rows([0, 0.1], [3, -0.1], [2 * Math.PI, 0.1]);
  assert.equal(
    motionInWords(WHEEL, whole, "steady", orbit([0, 0])),
    "Turns fully, rim position over 200 mm.",
  );
  assert.equal(
    motionInWords(WHEEL, rows([0, 0], [3, 0]), "run", none),
    "Does not turn fully in this time. No periodic motion: it does not settle.",
  );
  const ended = { ...whole, sentence: "the links part" };
  assert.match(motionInWords(WHEEL, ended, "run", none), /^Comes to an end: the links part/);
});
