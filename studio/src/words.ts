/** Numbers and verdicts in words. */

import type { Orbit, Rows } from "./motions";
import {
  type Given,
  type Mechanism,
  type Output,
  outputPlace,
  rowLength,
  type Values,
  givenValue,
} from "./tables";

/** A number as people read it, with so many digits. */
export function digits(value: number, count = 4): string {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return Number(value.toPrecision(count)).toExponential().replace("e+", "e");
  return String(Number(value.toPrecision(count)));
}

export function shown(value: number, of: Given | Output, count = 4): string {
  return `${digits(value * of.factor, count)}${of.unit ? ` ${of.unit}` : ""}`;
}

const column = (m: Mechanism, rows: Rows, output: number): number[] => {
  const length = rowLength(m);
  return Array.from({ length: rows.count }, (_, i) => rows.values[i * length + outputPlace(m, output)]);
};

/** Share of the largest number of a unit below which another of that unit is rounding. */
const ROUNDING = 1e-12;
const roundings = new WeakMap<Rows, Map<string, number>>();

/** Below which size the numbers of a motion are rounding (SI), by their unit on the page. */
export function roundingSizes(m: Mechanism, rows: Rows): Map<string, number> {
  const known = roundings.get(rows);
  if (known) return known;
  const found = new Map<string, number>();
  roundings.set(rows, found);
  const length = rowLength(m);
  m.outputs.forEach(({ unit }, output) => {
    let largest = found.get(unit) ?? 0;
    for (let at = outputPlace(m, output); at < rows.values.length; at += length)
      largest = Math.max(largest, ROUNDING * Math.abs(rows.values[at]));
    found.set(unit, largest);
  });
  return found;
}

/** A number as it stands in a sentence, and the units that people read in the place of SI. */
const N = String.raw`(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)`;
const READ: [string, string, number][] = [
  ["rad/s", "rpm", 30 / Math.PI],
  ["rad", "deg", 180 / Math.PI],
  ["m", "mm", 1e3],
];
const turned = (degrees: string): string => digits(((Number(degrees) % 360) + 360) % 360);
const article = (noun: string): string => (/^[aeiou]/.test(noun) ? "an" : "a");
/** What is done to a sentence, one after another. */
const REWRITTEN: [RegExp, (whole: string, ...parts: string[]) => string][] = [
  [/^in the step from t = (\S+) s: (.*)$/, (_, time, rest) => `${rest}, after ${time} s`],
  [/in the step from t = (\S+) s: /g, (_, time) => `after ${time} s: `],
  [/limit of assembly (?:at|near) /g, () => "the links cannot be joined beyond "],
  [RegExp(`${N} rad \\(${N} deg\\)`, "g"), (_, _radians, degrees) => `${turned(degrees)} deg`],
  ...READ.map(([unit, shown, factor]): (typeof REWRITTEN)[number] => [
    RegExp(`${N} ${unit}(?![\\w/^²³]|\\.\\w)`, "g"),
    (_, value) => `${digits(factor * Number(value))} ${shown}`,
  ]),
  [
    RegExp(`(?<=\\b(?:at|near|beyond|and) )(\\w+ \\w+) (?=${N} (?:deg|mm)\\b)`, "g"),
    (_, noun) => `${article(noun)} ${noun} of `,
  ],
  [RegExp(N, "g"), (number) => (number.replace(/\D/g, "").length > 4 ? digits(Number(number)) : number)],
];

/** A sentence of the equations or of Python as people read it: in their units, and with the digits that count. */
export function plainly(sentence: string, m?: Mechanism): string {
  const [, name, value, rest] = RegExp(`^parameter (\\S+) is ${N}:(.*)`).exec(sentence) ?? [];
  const given = m?.given.find((one) => one.name === name);
  const read = given ? `the ${called(given)} is ${shown(Number(value), given)}:${rest}` : sentence;
  return REWRITTEN.reduce((text, [pattern, change]) => text.replace(pattern, change), read);
}

/** Where the crank is driven by a torque, whether there is one: of an input or of a motor. */
export function isDriven(m: Mechanism, values: Values): boolean {
  const mode = m.given.find((given) => m.crank >= 0 && given.reference === m.freedoms[m.crank].mode);
  const chosen = mode?.arguments?.[givenValue(mode, values)];
  const torques = m.given.filter((given) => given.argument === chosen);
  const forced = torques.some((given) => given.kind === "force");
  return (
    !forced ||
    torques.some(
      (given) => givenValue(given, values) !== 0 && (given.kind === "force" || given.reference === -1),
    )
  );
}

/** The least distance of a transmission angle from its limits, 0 and 180 deg; of several angles, which it is. */
function leastTransmission(m: Mechanism, rows: Rows): string {
  const least = m.transmission.map((output) =>
    Math.min(...column(m, rows, output).map((angle) => Math.min(angle, Math.PI - angle))),
  );
  const first = least.indexOf(Math.min(...least));
  const at = least.length > 1 ? ` at ${m.outputs[m.transmission[first]].name.split(".")[0]}` : "";
  return `least transmission angle ${digits((least[first] * 180) / Math.PI)} deg${at}`;
}

export const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

/** What says once more that there is no periodic motion. */
const REPEATED = /^no periodic motion found: |: there is no periodic motion( over an angle)?$/;

/** Whether the crank turns all round, how the links stand, and how far they swing. */
export function motionInWords(m: Mechanism, rows: Rows, orbit: Orbit, values: Values): string {
  // what cannot begin is said where the faults are
  if (rows.count === 0) return "";
  const parts: string[] = [];
  if (!rows.sentence && m.crank >= 0) {
    const angles = column(m, rows, m.freedoms[m.crank].coordinate);
    const whole = Math.max(...angles) - Math.min(...angles) >= m.freedoms[m.crank].period * (1 - 1e-9);
    parts.push(whole ? "turns fully" : "does not turn fully in this time");
  }
  if (m.transmission.length > 0) parts.push(leastTransmission(m, rows));
  const rounding = roundingSizes(m, rows);
  for (const output of m.moving) {
    const path = column(m, rows, output);
    const range = Math.max(...path) - Math.min(...path);
    const of = m.outputs[output];
    parts.push(
      `${called(of)} ${range > rounding.get(of.unit)! ? `varies by ${shown(range, of)}` : "at rest"}`,
    );
  }
  const sentences = [parts.join(", ")];
  if (rows.sentence) sentences.unshift(`Comes to an end: ${rows.sentence}`);
  const why = isDriven(m, values)
    ? orbit.sentence.replace(REPEATED, "")
    : "the crank is driven by a torque and none is given";
  if (!orbit.found && orbit.sentence !== rows.sentence) sentences.push(`No periodic motion found: ${why}`);
  return sentences.map((text) => `${capital(text)}.`).join(" ");
}

/** The verdict that the Floquet multipliers give. */
export function verdictInWords(
  orbit: Pick<Orbit, "found" | "size" | "multipliers">,
  tolerance: number,
): string {
  if (!orbit.found) return "no periodic motion";
  if (orbit.size === 0) return "prescribed, no freedom is left that could be unstable";
  const margin = 1 - Math.hypot(...orbit.multipliers[0]);
  if (margin > tolerance) return "stable";
  return margin < -tolerance ? "unstable" : "marginal";
}

export function multiplierInWords([real, imaginary]: [number, number]): string {
  const modulus = Math.hypot(real, imaginary);
  // a pair that is real but for rounding
  if (Math.abs(imaginary) <= 1e-12 * modulus) return digits(real);
  const size = digits(modulus);
  return `${digits(real)} ${imaginary < 0 ? "−" : "+"} ${digits(Math.abs(imaginary))}i (modulus ${size})`;
}

/** A name of the FMU as people read it. */
export const called = ({ name }: { name: string }): string => name.replaceAll(/[._]/g, " ");
