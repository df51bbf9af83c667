/** The work that takes longer than a frame: runs, periodic motions and their multipliers; and searches, in parts. */

import { Core } from "./core";
import type { Orbit, Rows } from "./motions";
import { type Exploration, follow, type Found, verdicts } from "./explore";
import type { Mechanism, Source } from "./tables";

export interface Task {
  id: number;
  /** With the first task of a mechanism, its tables and its module. */
  mechanism?: Mechanism;
  bytes?: ArrayBuffer;
  given: [number, number][];
  /** Where the periodic motion is sought first, in the place of the one before. */
  start?: number[];
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

/** A search; without an exploration that before is given up. */
export interface Search {
  search: number;
  mechanism?: Mechanism;
  bytes?: ArrayBuffer;
  exploration?: Exploration;
}

export interface Part {
  search: number;
  found: Found[];
  done: boolean;
}

/** Time between two parts of what a search finds (ms). */
const PART = 60;

let core: Promise<Core> | undefined;
let wanted = 0;

async function answer(data: Task): Promise<void> {
  const made = await core!;
  const begun = performance.now();
  made.give(data.given);
  const orbit = made.orbit(data.start);
  const source = orbit.found ? data.source : "run";
  const rows = source === "steady" ? made.turn(data.turnSteps) : made.run(data.step, data.count);
  const found: Answer = { id: data.id, orbit, rows, source, milliseconds: performance.now() - begun };
  postMessage(found, { transfer: [rows.values.buffer] });
}

async function search({ search: id, exploration }: Search): Promise<void> {
  wanted = id;
  if (!exploration) return;
  const made = await core!;
  let found: Found[] = [];
  let last = performance.now();
  for (const one of exploration.grid ? verdicts(made, exploration) : follow(made, exploration)) {
    found.push(one);
    if (performance.now() - last < PART) continue;
    postMessage({ search: id, found, done: false } satisfies Part);
    found = [];
    // a newer search is heard of between two parts
    await new Promise((resolve) => setTimeout(resolve));
    if (wanted !== id) return;
    last = performance.now();
  }
  postMessage({ search: id, found, done: true } satisfies Part);
}

addEventListener("message", ({ data }: MessageEvent<Task | Search>) => {
  if (data.mechanism && data.bytes) core = Core.make(data.mechanism, data.bytes);
  // the page hears of it as of any other error of its worker
  ("search" in data ? search(data) : answer(data)).catch(reportError);
});
