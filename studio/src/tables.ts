/** What the page is told of a mechanism: made by Python from the registry (analysis/studio/tables.py). */

export interface Given {
  name: string;
  /** Its value reference; of a motor, which the page's module has besides, below 0. */
  reference: number;
  text: string;
  start: number;
  section: string;
  /** What it is to the analyses, where they ask for it, such as a stiffness. */
  role?: string;
  unit: string;
  factor: number;
  least?: number;
  nominal?: number;
  /** Words by value, where only some values are allowed. */
  choices?: Record<string, string>;
  /** Of a mode: what chooses each value in a case file. */
  arguments?: string[];
  /** Of an input: its name in a case file, among the inputs of a run, and the freedom that it drives. */
  file?: string;
  argument?: string;
  kind?: string;
  freedom?: number;
}

export interface Output {
  name: string;
  text: string;
  /** Whether it counts from the start of a run: a periodic motion has none. */
  run?: boolean;
  unit: string;
  factor: number;
}

export interface Joint {
  name: string;
  text: string;
  moves: number[];
  /** Whether it only places parts, and is not drawn. */
  aid?: boolean;
}

export interface Part {
  kind: "pivot" | "link" | "guide" | "slider" | "spring" | "damper" | "axis" | "gear";
  joints: number[];
  text: string;
  where: number;
}

export interface Picture {
  joints: Joint[];
  parts: Part[];
  paths: number[];
  planar: boolean;
}

export interface Curve {
  name: string;
  of: number[];
}

/** Curves over a motion: each the root of squares of places in a row, counted from the outputs on. */
export interface Chart {
  title: string;
  kind: "motion" | "power" | "forces";
  unit: string;
  factor: number;
  curves: Curve[];
}

/** What is varied, and between which values (SI). */
export interface Range {
  reference: number;
  low: number;
  high: number;
}

export interface Freedom {
  coordinate: number;
  rate: number;
  initial: [number, number];
  mode: number;
  period: number;
}

export interface Mechanism {
  name: string;
  title: string;
  /** Whether a file describes it, which a case of it names. */
  described: boolean;
  module: string;
  given: Given[];
  outputs: Output[];
  freedoms: Freedom[];
  crank: number;
  states: number;
  /** Value reference of the tolerance of a run, and its value. */
  tolerance: [number, number];
  picture: Picture;
  charts: Chart[];
  /** Outputs that swing with the motion. */
  moving: number[];
  /** Outputs that are transmission angles. */
  transmission: number[];
  /** The reference of the stiffness of which there is a natural frequency; null: there is none. */
  natural: number | null;
  /** Name of the damping over which stability is charted. */
  damping: string;
  sets: { name: string; source: string; values: Values }[];
}

export interface Tables {
  /** Margin of the largest multiplier from which on a verdict is given. */
  tolerance: number;
  mechanisms: Mechanism[];
}

/** What is given, by FMI name, in SI. */
export type Values = Record<string, number>;

export type Source = "steady" | "run";

export interface State {
  mechanism: string;
  title: string;
  values: Values;
  source?: Source;
  /** Of a run from the start (s). */
  duration?: number;
  /** Names of dimensions that a drag leaves as they are. */
  locks?: string[];
  /** Where the photo or drawing behind the mechanism lies. */
  behind?: Placement;
  /** How it is seen, in a link. */
  view?: number[];
}

/** Of a photo or a drawing behind the mechanism: its middle and width (m), its angle (rad). */
export interface Placement {
  x: number;
  y: number;
  width: number;
  angle: number;
  opacity: number;
  locked: boolean;
}

export const rowLength = (m: Mechanism): number =>
  1 + m.states + m.outputs.length + 3 * m.picture.joints.length + 2;

/** Places in a row: of an output, and of a joint. */
export const outputPlace = (m: Mechanism, output: number): number => 1 + m.states + output;
export const jointPlace = (m: Mechanism, joint: number): number =>
  1 + m.states + m.outputs.length + 3 * joint;

/** A value, or what it starts from where a state leaves it out. */
export const givenValue = (given: Given, values: Values): number => values[given.name] ?? given.start;

/** All that is given, by value reference, with the start values of what a state leaves out. */
export function allGiven(m: Mechanism, values: Values): [number, number][] {
  return [m.tolerance, ...m.given.map((g): [number, number] => [g.reference, givenValue(g, values)])];
}

const isNumber = (value: unknown): value is number => typeof value === "number" && Number.isFinite(value);

/** A state as it came from elsewhere, held against the tables; an Error says what is wrong with it. */
export function checkState(data: unknown, tables: Tables): State {
  const state = data as Partial<State> | null;
  if (typeof state !== "object" || state === null) throw new Error("the state is no object");
  const mechanism = tables.mechanisms.find((m) => m.name === state.mechanism);
  if (!mechanism) throw new Error(`the page has no mechanism ${JSON.stringify(state.mechanism)}`);
  const { title = "", values = {}, source = "steady", duration, locks = [], behind, view } = state;
  const hold = (good: boolean, name: string, value: unknown): void => {
    if (!good) throw new Error(`${name} is ${JSON.stringify(value)} in the state`);
  };
  hold(typeof title === "string", "the title", title);
  hold(typeof values === "object" && values !== null, "values", values);
  const names = new Set(mechanism.given.map((given) => given.name));
  for (const [name, value] of Object.entries(values)) {
    if (!names.has(name)) throw new Error(`${mechanism.name} has no ${JSON.stringify(name)}`);
    hold(isNumber(value), name, value);
  }
  hold(source === "steady" || source === "run", "the source", source);
  hold(Array.isArray(locks) && locks.every((name) => names.has(name)), "locks", locks);
  const found: State = { mechanism: mechanism.name, title, values: { ...values }, source, locks };
  if (duration !== undefined) {
    hold(isNumber(duration) && duration > 0, "the duration", duration);
    found.duration = duration;
  }
  if (behind !== undefined) {
    const { x, y, width, angle, opacity, locked } = behind ?? {};
    hold([x, y, width, angle, opacity].every(isNumber) && width > 0, "what is behind", behind);
    found.behind = { x, y, width, angle, opacity, locked: locked === true };
  }
  if (view !== undefined) {
    const whole = Array.isArray(view) && view.length === 5 && view.every(isNumber);
    hold(whole && view[2] >= 0.02 && view[2] <= 200, "the view", view);
    found.view = view;
  }
  return found;
}
