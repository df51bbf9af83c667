import assert from "node:assert/strict";
import { test } from "node:test";
import type { Orbit, Rows } from "../src/motions";
import type { Values } from "../src/tables";
import { digits, motionInWords, multiplierInWords, plainly, shown, verdictInWords } from "../src/words";
import { WHEEL } from "./wheel";

const orbit = (first: [number, number]): Orbit => ({
  found: true,
  sentence: "",
  size: 1,
  period: 1,
  start: [],
  places: [0],
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
  assert.equal(digits(0.00002, 6), "2e-5");
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
  const found = orbit([0, 0]);
  const none = { ...found, found: false, sentence: "it does not settle" };
  const whole = rows([0, 0.1], [3, -0.1], [2 * Math.PI, 0.1]);
  assert.equal(motionInWords(WHEEL, whole, found, {}), "Turns fully, rim position varies by 200 mm.");
  // what is rounding is none
  const still = rows([0, 0.1], [3, 0.1 + 1e-15]);
  assert.equal(
    motionInWords(WHEEL, still, none, {}),
    "Does not turn fully in this time, rim position at rest. No periodic motion found: it does not settle.",
  );
  const ended = { ...whole, sentence: "the links part" };
  assert.equal(
    motionInWords(WHEEL, ended, { ...none, sentence: "the links part" }, {}),
    "Comes to an end: the links part. Rim position varies by 200 mm.",
  );
  assert.equal(motionInWords(WHEEL, { ...ended, count: 0 }, none, {}), "");
  // of several dyads the one that comes nearest to its limit
  const dyads = ["C", "G"].map((pin) => ({ ...WHEEL.outputs[0], name: `${pin}.transmission_angle` }));
  const two = { ...WHEEL, outputs: [...WHEEL.outputs, ...dyads], transmission: [2, 3], moving: [] };
  const values = Float64Array.from([0, 0, 0, 0, 1, 3, 0, 0, 0, 0, 0, 1, 0, 7, 0, 2, 3.1, 0, 0, 0, 0, 0]);
  assert.equal(
    motionInWords(two, { values, count: 2, sentence: "" }, found, {}),
    "Turns fully, least transmission angle 2.383 deg at G.",
  );
  assert.match(
    motionInWords(
      WHEEL,
      whole,
      { ...none, sentence: "the crank is at rest: there is no periodic motion" },
      {},
    ),
    /No periodic motion found: the crank is at rest\.$/,
  );
});

test("a crank that is driven by a torque and has none is told of", () => {
  const none = { ...orbit([0, 0]), found: false, sentence: "a turn cannot be followed" };
  const whole = rows([0, 0.1], [2 * Math.PI, -0.1]);
  const said = (values: Values): string => motionInWords(WHEEL, whole, none, values);
  assert.match(said({ "drive.mode": 0 }), /: the crank is driven by a torque and none is given\.$/);
  assert.match(said({ "drive.mode": 0, "drive.torque": 2 }), /: a turn cannot be followed\.$/);
  assert.match(said({ "drive.mode": 1 }), /: a turn cannot be followed\.$/);
});

test("sentences of the equations are read in the units of the page", () => {
  const read = (sentence: string): string => plainly(sentence, WHEEL);
  const at = "crank angle 69.1135784 rad (3959.91635 deg) and slider position -0.103371364 m";
  assert.equal(
    read(`in the step from t = 0.760714286 s: limit of assembly at ${at}`),
    "the links cannot be joined beyond a crank angle of 359.9 deg and a slider position of -103.4 mm, after 0.7607 s",
  );
  assert.equal(
    read("the links cannot be joined at crank angle -0.8 rad (-45.8366236 deg)"),
    "the links cannot be joined at a crank angle of 314.2 deg",
  );
  assert.equal(
    read("a turn cannot be followed beyond crank angle 337.5 deg"),
    "a turn cannot be followed beyond a crank angle of 337.5 deg",
  );
  assert.equal(
    read("parameter wheel.radius is -0.1: it must be at least 0.012345678 kg.m2"),
    "the wheel radius is -100 mm: it must be at least 0.01235 kg.m2",
  );
  assert.equal(read("it turns at 10.4719755 rad/s: see 0.5 rad"), "it turns at 100 rpm: see 28.65 deg");
  assert.equal(read("a damper of 12 N/m at 1.5 m/s"), "a damper of 12 N/m at 1.5 m/s");
  assert.equal(read("a torque of 1.25 N.m at 0.02 m."), "a torque of 1.25 N.m at 20 mm.");
});
