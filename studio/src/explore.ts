/** What takes seconds, in pieces: motions along a branch over one parameter, and verdicts over a plane of two. */

import type { Core } from "./core";
import type { Orbit, Point } from "./motions";
import type { Range } from "./tables";

/** A square of a chart: its place on the finest grid, its size there, and the motion at its place. */
export interface Cell {
  column: number;
  row: number;
  size: number;
  start: number[];
  multipliers: [number, number][];
  found: boolean;
}

export interface Exploration {
  given: [number, number][];
  axes: Range[];
  /** Of a chart: squares along each axis. */
  grid?: [number, number];
  /** The motion that is shown, and where it is. */
  start: number[];
  at: number;
}

/** Of a branch: the number of its part in the order of `follow`, and what was found or why there is no more. */
export type Found =
  { part: number; point: Point; place?: number } | { part: number; sentence: string } | { cell: Cell };

/** More than any branch takes; how near the motions at two ends of a branch are that are one. */
const MOST_POINTS = 3000;
const SAME = 1e-6;
/** A branch is left where its largest multiplier passes this: the errors of a turn grow by as much. */
const STRAYED = 1e3;

const near = (a: number[], b: number[], reach: number): boolean =>
  a.length === b.length &&
  a.every((value, i) => Math.abs(value - b[i]) <= reach * Math.max(...b.map(Math.abs)));

/** The branches through the motion that is shown, and those from both ends of the range that are others. */
export function* follow(core: Core, { given, axes, start, at }: Exploration): Generator<Found> {
  const [{ reference, low, high }] = axes;
  const ends: Point[] = [];
  const inside = at > low && at < high;
  const begins: [number, number, boolean][] = [
    [at, 1, inside],
    [at, -1, inside],
    [low, 1, true],
    [high, -1, true],
  ];
  for (const [part, [value, sense, wanted]] of begins.entries()) {
    if (!wanted) continue;
    core.give([...given, [reference, value]]);
    let orbit = core.orbit(part < 2 ? start : []);
    const there = ends.filter((end) => Math.abs(end.value - value) <= 0.02 * (high - low));
    if (orbit.found && there.some((end) => near(core.orbit(end.start).start, orbit.start, SAME))) continue;
    if (there.length > 0) orbit = core.orbit(orbit.start);
    if (!orbit.found || !core.branch(reference, high - low, sense)) {
      yield { part, sentence: orbit.sentence || core.sentence() };
      continue;
    }
    const first: Point = { value, amplitudes: core.amplitudes(), kind: "", ...motion(orbit) };
    yield { part, point: first };
    let last = first;
    for (let count = 1; count < MOST_POINTS; count++) {
      const next = core.follow();
      if (!next) {
        yield { part, sentence: core.sentence() };
        break;
      }
      last = { ...next, amplitudes: core.amplitudes() };
      yield { part, point: last };
      if (last.value <= low || last.value >= high) {
        ends.push(last);
        break;
      }
      if (Math.hypot(...last.multipliers[0]) > STRAYED) {
        yield {
          part,
          sentence: `the motion is too unstable to be followed on, its largest multiplier above ${STRAYED}`,
        };
        break;
      }
      const closed = count > 10 && Math.abs(last.value - value) < 0.01 * (high - low) && last.kind === "";
      if (closed && near(last.start, first.start, 0.01)) break;
    }
  }
}

const motion = ({ start, multipliers }: Orbit): Pick<Point, "start" | "multipliers"> => ({
  start,
  multipliers,
});

/** Verdicts over a plane, coarse to fine; each motion is sought from its neighbour of the coarser grid. */
export function* verdicts(core: Core, { given, axes, grid, start }: Exploration): Generator<Found> {
  const [columns, rows] = grid!;
  const known = new Map<number, number[]>();
  const value = (axis: number, place: number): number => middle(axes[axis], grid![axis], place);
  for (let size = 8; size >= 1; size /= 2)
    for (let row = 0; row < rows; row += size)
      for (let column = 0; column < columns; column += size) {
        if (known.has(row * columns + column)) continue;
        const coarse = (row - (row % (2 * size))) * columns + column - (column % (2 * size));
        const before = known.get(coarse) ?? known.get(row * columns + column - size) ?? start;
        core.give([...given, [axes[0].reference, value(0, column)], [axes[1].reference, value(1, row)]]);
        const orbit = core.orbit(before);
        known.set(row * columns + column, orbit.found ? orbit.start : []);
        yield { cell: { column, row, size, found: orbit.found, ...motion(orbit) } };
      }
}

/** The value in the middle of a square. */
export const middle = ({ low, high }: Range, count: number, place: number): number =>
  low + ((high - low) * (place + 0.5)) / count;
