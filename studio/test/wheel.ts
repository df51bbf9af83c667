/** Tables of a small mechanism: a wheel that is driven at a speed or by a torque, with a joint on its rim. */

import type { Mechanism, State, Tables } from "../src/tables";

const plain = { text: "", section: "Dimensions", unit: "mm", factor: 1e3 };
const input = { text: "", section: "Drive and loads", unit: "N.m", factor: 1, start: 0, freedom: 0 };

export const WHEEL: Mechanism = {
  name: "wheel",
  title: "Wheel",
  described: false,
  module: "",
  given: [
    { ...plain, name: "wheel.radius", reference: 0, start: 0.1, least: 0 },
    {
      ...plain,
      name: "drive.mode",
      reference: 1,
      start: 1,
      choices: { "0": "torque", "1": "speed" },
      arguments: ["torque", "speed"],
    },
    { ...plain, name: "initial.angle", unit: "deg", factor: 180 / Math.PI, reference: 2, start: 0 },
    { ...plain, name: "initial.speed", reference: 3, start: 2 },
    { ...input, name: "drive.torque", reference: 4, file: "drive.torque", argument: "torque", kind: "force" },
    { ...input, name: "drive.speed", reference: 5, file: "drive.speed", argument: "speed", kind: "command" },
  ],
  outputs: [
    { name: "wheel.angle", text: "", unit: "deg", factor: 180 / Math.PI },
    { name: "rim.position", text: "", unit: "mm", factor: 1e3 },
  ],
  freedoms: [{ coordinate: 0, rate: 0, initial: [2, 3], mode: 1, period: 2 * Math.PI }],
  crank: 0,
  states: 1,
  tolerance: [9, 1e-12],
  picture: { joints: [{ name: "B", text: "rim", moves: [0] }], parts: [], paths: [0], planar: true },
  charts: [],
  moving: [1],
  transmission: [],
  natural: null,
  damping: "",
  sets: [],
};

/** Points as "x y, x y". */
export const points = (text: string): [number, number][] =>
  text.split(", ").map((pair) => pair.split(" ").map(Number) as [number, number]);

export const TABLES: Tables = { tolerance: 1e-6, mechanisms: [WHEEL] };

export const STATE: State = {
  mechanism: "wheel",
  title: 'Räder & "Rollen"',
  values: { "wheel.radius": 0.25, "drive.speed": 3 },
  source: "steady",
  locks: [],
};
