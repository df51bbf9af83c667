/** Motions as the module computes them: rows of a run, a periodic motion, a point of a branch of them. */

export interface Orbit {
  found: boolean;
  /** Why there is none. */
  sentence: string;
  size: number;
  period: number;
  start: number[];
  /** In the state, of what swings: whose amplitudes are meant; none where all is prescribed. */
  places: number[];
  /** Real and imaginary parts, the largest modulus first. */
  multipliers: [number, number][];
}

export interface Rows {
  values: Float64Array;
  count: number;
  /** Why there are no more, if that is so. */
  sentence: string;
}

/** A motion on a branch. */
export interface Point {
  value: number;
  /** Of all that swings. */
  amplitudes: number[];
  start: number[];
  multipliers: [number, number][];
  kind: "" | "fold" | "doubling";
}
