/** Which values of a parameter to avoid, from the branches over it: the twin, for motions of one turn, of
    analysis/periodic/response/advice.py, which a browser cannot call; a test holds the two equal. */

import type { Point } from "./motions";

export type Interval = [number, number];

export interface Avoided {
  low: number;
  high: number;
  why: string;
}

/** A fold at which a stable motion ends: the way of the parameter past it, and what there is beyond. */
export interface Jump {
  value: number;
  rising: boolean;
  before: number;
  after: number[];
}

/** A part of a branch along which the parameter goes one way and stability stays what it is. */
export interface Arc {
  stable: boolean;
  points: Point[];
  /** Whether the branch goes on beyond the low and the high end. */
  cut: [boolean, boolean];
  /** Of what swings, whose amplitude is meant. */
  of: number;
}

const HALF_POWER = Math.SQRT1_2;
const PROMINENCE = 1e-3;
const SAME = 1e-2;
/** Part of the range below which an interval is none. */
const SLIVER = 1e-4;

export const largest = ({ multipliers }: Pick<Point, "multipliers">): number =>
  Math.hypot(...(multipliers[0] ?? [0, 0]));
const span = ({ points }: Arc): Interval => [points[0].value, points[points.length - 1].value];
const overlap = (a: Arc, b: Arc): Interval => [
  Math.max(span(a)[0], span(b)[0]),
  Math.min(span(a)[1], span(b)[1]),
];

export function splitArcs(branch: Point[], tolerance: number, of = 0): Arc[] {
  // at a special point a multiplier is on the unit circle: its neighbours judge
  const holds = branch.map((point) => point.kind !== "" || largest(point) <= 1 + tolerance);
  const way = (i: number): string => {
    const stable = holds[i] && holds[i + 1] && !(branch[i].kind && branch[i + 1].kind);
    return `${stable} ${Math.sign(branch[i + 1].value - branch[i].value)}`;
  };
  const found: Arc[] = [];
  for (let first = 0, i = 1; i < branch.length; i++) {
    if (i < branch.length - 1 && way(i) === way(first)) continue;
    const points = branch.slice(first, i + 1);
    const cut: [boolean, boolean] = [first > 0, i < branch.length - 1];
    if (points[0].value > points[points.length - 1].value) {
      points.reverse();
      cut.reverse();
    }
    if (points[0].value < points[points.length - 1].value)
      found.push({ stable: way(first).startsWith("true"), points, cut, of });
    first = i;
  }
  return found;
}

/** The amplitude of an arc at a value, between its points. */
function interpolateAmplitude({ points, of }: Arc, value: number): number {
  const i = Math.max(
    1,
    points.findIndex((point) => point.value >= value),
  );
  const [a, b] = [points[i - 1], points[i]];
  const [low, high] = [a.amplitudes[of], b.amplitudes[of]];
  return low + ((high - low) * (value - a.value)) / (b.value - a.value);
}

/** Whether two arcs are one curve: a branch that was followed from both of its ends. */
function same(a: Arc, b: Arc): boolean {
  const [low, high] = overlap(a, b);
  if (low >= high) return false;
  return [0.2, 0.4, 0.6, 0.8].every((share) => {
    const [x, y] = [a, b].map((arc) => interpolateAmplitude(arc, low + share * (high - low)));
    return Math.abs(x - y) < SAME * Math.max(x, y);
  });
}

/** Intervals that overlap or nearly touch become one. */
function union(intervals: Interval[], least: number): Interval[] {
  const joined: Interval[] = [];
  for (const [low, high] of intervals.filter(([a, b]) => a < b).sort((a, b) => a[0] - b[0])) {
    const last = joined.at(-1);
    if (last && low <= last[1] + least) last[1] = Math.max(last[1], high);
    else joined.push([low, high]);
  }
  return joined;
}

/** The half-power point of a peak to one side, by the cubic through the points about it; infinite at a higher peak. */
function bandEnd({ points, of }: Arc, top: number, way: number): number {
  const a = points.map((point) => point.amplitudes[of]);
  const level = HALF_POWER * a[top];
  let i = top;
  while (i + way >= 0 && i + way < a.length) {
    i += way;
    if (a[i] > a[top]) return Infinity;
    if (a[i] >= level) continue;
    const about = points.slice(Math.max(Math.min(i, i - way) - 1, 0), Math.max(i, i - way) + 2);
    let value = 0;
    for (const one of about) {
      let weight = 1;
      for (const other of about)
        if (other !== one)
          weight *= (level - other.amplitudes[of]) / (one.amplitudes[of] - other.amplitudes[of]);
      value += weight * one.value;
    }
    const [low, high] = [points[i].value, points[i - way].value].sort((p, q) => p - q);
    return Math.max(low, Math.min(high, value));
  }
  return points[i].value;
}

/** The half-power bands of the peaks of an arc, and of where it is largest at its end and loses its stability. */
function resonances(arc: Arc): Interval[] {
  const a = arc.points.map((point) => point.amplitudes[arc.of]);
  const bands: Interval[] = [];
  const lowest = (top: number, way: number): number => {
    let least = a[top];
    for (let i = top + way; i >= 0 && i < a.length && a[i] <= a[top]; i += way) least = Math.min(least, a[i]);
    return least;
  };
  for (let i = 1; i < a.length - 1; i++)
    if (
      a[i] > a[i - 1] &&
      a[i] >= a[i + 1] &&
      a[i] - Math.max(lowest(i, -1), lowest(i, 1)) > PROMINENCE * a[i]
    )
      bands.push([bandEnd(arc, i, -1), bandEnd(arc, i, 1)]);
  const ends: [number, boolean, number][] = [
    [0, arc.cut[0], 1],
    [a.length - 1, arc.cut[1], -1],
  ];
  for (const [end, cut, way] of ends)
    if (cut && a[end] === Math.max(...a) && Math.min(...a) < HALF_POWER * a[end]) {
      const other = bandEnd(arc, end, way);
      bands.push(way > 0 ? [arc.points[end].value, other] : [other, arc.points[end].value]);
    }
  return bands.filter((band) => band.every(Number.isFinite));
}

/** Where a machine resonates, may jump, or has no stable motion of one turn, between two values; `names` of what swings. */
export function rangesToAvoid(arcs: Arc[], low: number, high: number, names = [""]): Avoided[] {
  const least = SLIVER * (high - low);
  const stable = arcs.filter((arc) => arc.stable);
  const several = stable.flatMap((a, i) =>
    stable
      .slice(i + 1)
      .filter((b) => !same(a, b))
      .map((b) => overlap(a, b)),
  );
  const edges = [low, ...union(stable.map(span), least).flat(), high];
  const without = edges.flatMap((edge, i): Interval[] => (i % 2 === 0 ? [[edge, edges[i + 1]]] : []));
  const found: [string, Interval[]][] = [
    ...names.map((name, of): [string, Interval[]] => [
      `resonance${names.length > 1 ? ` of ${name}` : ""}, above 0.71 of the peak`,
      union(stable.map((arc) => ({ ...arc, of })).flatMap(resonances), least),
    ]),
    ["several stable motions, jumps between them", union(several, least)],
    ["no stable motion of one turn found", without],
  ];
  return found
    .flatMap(([why, parts]) =>
      parts.map(([a, b]) => ({ low: Math.max(a, low), high: Math.min(b, high), why })),
    )
    .filter((one) => one.high - one.low > least)
    .sort((a, b) => a.low - b.low || a.high - b.high);
}

/** What happens at the folds at which a stable motion ends. */
export function findJumps(arcs: Arc[]): Jump[] {
  const stable = arcs.filter((arc) => arc.stable);
  const found: Jump[] = [];
  for (const arc of stable)
    for (const [end, rising] of [
      [arc.points[arc.points.length - 1], true],
      [arc.points[0], false],
    ] as const) {
      if (end.kind !== "fold") continue;
      const beyond = stable.filter((other) => span(other)[0] < end.value && end.value < span(other)[1]);
      const after = beyond.filter((one, i) => !beyond.slice(0, i).some((other) => same(one, other)));
      found.push({
        value: end.value,
        rising,
        before: end.amplitudes[arc.of],
        after: after.map((one) => interpolateAmplitude(one, end.value)).sort((a, b) => a - b),
      });
    }
  return found.sort((a, b) => a.value - b.value);
}
