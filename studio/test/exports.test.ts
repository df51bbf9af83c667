import assert from "node:assert/strict";
import { test } from "node:test";
import { caseText, pageAddress, parameterText, pythonText, readState, tableText } from "../src/exports";
import { STATE, TABLES, WHEEL } from "./wheel";

Object.assign(globalThis, { location: { href: "https://example.org/page.html#old" } });

test("a case has what acts, and no more", () => {
  const driven = caseText(WHEEL, STATE, 2).split("\n");
  assert.ok(driven.includes("wheel.radius = 0.25"));
  assert.ok(driven.includes("drive.speed = 3.0"));
  assert.ok(driven.includes("run.stop_time = 2.0"));
  assert.ok(!driven.some((line) => line.startsWith("initial.speed") || line.startsWith("drive.torque")));
  assert.ok(driven.includes('title = "Räder & \\"Rollen\\""'));
  const pushed = caseText(WHEEL, { ...STATE, values: { "drive.mode": 0, "drive.torque": 0.5 } }, 2).split(
    "\n",
  );
  assert.ok(pushed.includes("drive.torque = 0.5"));
  assert.ok(pushed.includes("initial.speed = 2.0"));
  assert.ok(!pushed.some((line) => line.startsWith("drive.speed")));
  // after many turns
  assert.ok(
    caseText(WHEEL, { ...STATE, values: { "initial.angle": 50.5 } }, 2).includes(
      'initial.angle = "50.5 rad"',
    ),
  );
  // the mechanism, or the file that describes it
  assert.equal(driven[0], 'mechanism = "wheel"');
  assert.match(caseText({ ...WHEEL, described: true }, STATE, 2), /^linkage = "wheel\.toml" {2}# .*\ntitle/);
});

test("a motor is written beside the torque, where there is one", () => {
  const plain = { text: "", section: "Drive and loads", unit: "", factor: 1, start: 0, argument: "torque" };
  const fields = ["breakdown_torque", "breakdown_slip", "synchronous_speed"];
  const motor = fields.map((file, n) => ({
    ...plain,
    name: `m.${file}`,
    file,
    kind: "motor",
    reference: -1 - n,
  }));
  const mechanism = { ...WHEEL, given: [...WHEEL.given, ...motor] };
  const values = { "drive.mode": 0, "drive.torque": 0.5, "m.breakdown_slip": 0.2, "m.synchronous_speed": 50 };
  const lines = (torque: number): string[] =>
    caseText(mechanism, { ...STATE, values: { ...values, "m.breakdown_torque": torque } }, 2).split("\n");
  assert.ok(lines(0).includes("drive.torque = 0.5"));
  const law = "breakdown_torque = 5.0, breakdown_slip = 0.2, synchronous_speed = 50.0";
  assert.ok(lines(5).includes(`drive.torque = [0.5, { kind = "induction-motor", ${law} }]`));
});

test("the lines of Python start from the motion that is shown, if there is one", () => {
  const orbit = {
    found: true,
    sentence: "",
    size: 1,
    period: 1,
    start: [0.1, -2e-7],
    places: [0],
    multipliers: [],
  };
  assert.match(pythonText(WHEEL, STATE, 2, orbit), /newton_orbit\(.*, start=\[0\.1,-2e-7\]\)/);
  for (const none of [undefined, { ...orbit, found: false }, { ...orbit, size: 0 }])
    assert.doesNotMatch(pythonText(WHEEL, STATE, 2, none), /orbit/);
});

test("parameter values are XML, with numbers of their kind and every digit", () => {
  const text = parameterText(WHEEL, { ...STATE, values: { "wheel.radius": 0.1 + 0.2 } });
  assert.match(text, /name="wheel.radius"><ssv:Real value="0.30000000000000004"/);
  assert.match(text, /name="drive.mode"><ssv:Integer value="1"/);
  assert.match(text, /name="Räder &amp; &quot;Rollen&quot;"/);
});

test("a table has a line of names and one for each row", () => {
  const rows = {
    values: Float64Array.of(0, 9, 1, 2, 0, 0, 0, 7, 8, 0.5, 9, 3, 4, 0, 0, 0, 7, 8),
    count: 2,
    sentence: "",
  };
  assert.equal(tableText(WHEEL, rows), "time,wheel.angle,rim.position\n0,1,2\n0.5,3,4\n");
  const [angle, position] = WHEEL.outputs;
  const counted = { ...WHEEL, outputs: [angle, { ...position, run: true }] };
  assert.equal(tableText(counted, rows, "steady"), "time,wheel.angle\n0,1\n0.5,3\n");
});

test("a link holds the whole state", () => {
  const link = pageAddress(STATE);
  assert.match(link, /^https:\/\/example\.org\/page\.html#state=[\w-]+$/);
  assert.deepEqual(readState(link, TABLES), STATE);
  assert.equal(readState("page.html#elsewhere", TABLES), undefined);
});

test("a damaged link is refused in a sentence", () => {
  for (const text of ["%00", "AAAA", pageAddress(STATE).split("=")[1].slice(0, -9)])
    assert.throws(() => readState(`page.html#state=${text}`, TABLES), /damaged/);
});
