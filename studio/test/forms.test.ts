import assert from "node:assert/strict";
import { test } from "node:test";
import { readNumber, Wrong } from "../src/elements";
import { readPoints, soundPath, writePoints } from "../src/points";

test("a field says what is wrong with its number, and what would be right", () => {
  assert.equal(readNumber(" 2.5 ", "stroke", "mm", { above: 0 }), 2.5);
  assert.equal(readNumber("", "stroke", "mm", { above: 0, missing: 7 }), 7);
  const cases: [string, Parameters<typeof readNumber>[3], string][] = [
    ["90", { least: 0, below: 90 }, '"angle" is 90 deg: it must be a number at least 0 and below 90 (deg)'],
    ["-0.1", { least: 0 }, '"angle" is -0.1 deg: it must be a number at least 0 (deg)'],
    ["0", { above: 0 }, '"angle" is 0 deg: it must be a number above 0 (deg)'],
    ["1.5", { least: 1, whole: true }, '"angle" is 1.5 deg: it must be a whole number at least 1 (deg)'],
    ["", { above: 0 }, '"angle" has no number: it must be a number above 0 (deg)'],
    ["1e999", {}, '"angle" is 1e999 deg: it must be a number (deg)'],
  ];
  for (const [text, rule, message] of cases)
    assert.throws(() => readNumber(text, "angle", "deg", rule), new Wrong(message));
});

test("points are read line by line, and the first line that is none is named", () => {
  assert.deepEqual(readPoints("10 20\n\n-1.5, 2e1\n 3;4 \n"), [
    [0.01, 0.02],
    [-0.0015, 0.02],
    [0.003, 0.004],
  ]);
  assert.deepEqual(readPoints(""), []);
  for (const row of ["12", "1 2 3", "x y", "12,5 30,1", "1 nan"])
    assert.throws(() => readPoints(`1 2\n${row}\n3 4`), {
      message: `line 2 of the points is "${row}": it must be two numbers, x and y in mm, such as 12.5 -30`,
    });
  // written and read again they are the same, to a nanometre
  const points = readPoints("123.4567 -0.25");
  assert.deepEqual(readPoints(writePoints(points)), points);
});

test("a path has points that differ, and a closed one does not end where it began", () => {
  const points = readPoints("0 0\n1 0\n1 1\n0 0");
  assert.deepEqual(soundPath(points, true), points.slice(0, 3));
  assert.deepEqual(soundPath(points, false), points);
  const cases: [string, RegExp][] = [
    ["", /Draw a path first/],
    ["1 1", /has 1 point: it needs at least 3/],
    ["0 0\n1 0", /has 2 points/],
    ["0 0\n1 0\n1 0\n0 1", /Points 2 and 3 of the path are the same/],
  ];
  for (const [text, message] of cases) assert.throws(() => soundPath(readPoints(text), true), message);
});
