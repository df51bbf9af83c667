/** The work that takes longer than a frame: runs, periodic motions and their multipliers. */

import { Core, type Orbit, type Rows } from "./core";
import type { Mechanism, Source } from "./tables";

export interface Task {
  id: number;
  /** With the first task of a mechanism, its tables and its module. */
  mechanism?: Mechanism;
  bytes?: ArrayBuffer;
  given: [number, number][];
  source: Source;
  step: number;
  count: number;
  turnSteps: number;
}

export interface Answer {
  id: number;
  orbit: Orbit;
  rows: Rows;
  /** Which motion the rows are of: a run where there is no periodic motion. */
  source: Source;
  milliseconds: number;
}

let core: Promise<Core> | undefined;

async function answer(data: Task): Promise<void> {
  if (data.mechanism && data.bytes) core = Core.make(data.mechanism, data.bytes);
  const made = await core!;
  const begun = performance.now();
  made.give(data.given);
  const orbit = made.orbit(true);
  const source = orbit.found ? data.source : "run";
  const rows = source === "steady" ? made.turn(data.turnSteps) : made.run(data.step, data.count);
  const found: Answer = { id: data.id, orbit, rows, source, milliseconds: performance.now() - begun };
  postMessage(found, { transfer: [rows.values.buffer] });
}

addEventListener("message", ({ data }: MessageEvent<Task>) => void answer(data));
