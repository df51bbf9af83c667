/** Numbers and verdicts in words. */

import type { Orbit, Rows } from "./core";
import { type Given, type Mechanism, type Output, outputAt, rowLength, type Source } from "./tables";

/** A number as people read it, with so many digits. */
export function digits(value: number, count = 4): string {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(count - 1).replace("e+", "e");
  return String(Number(value.toPrecision(count)));
}

export function shown(value: number, of: Given | Output, count = 4): string {
  return `${digits(value * of.factor, count)}${of.unit ? ` ${of.unit}` : ""}`;
}

const column = (m: Mechanism, rows: Rows, output: number): number[] => {
  const length = rowLength(m);
  return Array.from({ length: rows.count }, (_, i) => rows.values[i * length + outputAt(m, output)]);
};

/** The least distance of the transmission angle from its limits, 0 and 180 deg (rad). */
export function leastTransmission(m: Mechanism, rows: Rows): number {
  return Math.min(...column(m, rows, m.transmission).map((angle) => Math.min(angle, Math.PI - angle)));
}

/** Whether the crank turns all round, how the links stand, and how far they swing. */
export function motionInWords(m: Mechanism, rows: Rows, source: Source, orbit: Orbit): string {
  const parts: string[] = [];
  if (rows.sentence) parts.push(`Comes to an end: ${rows.sentence}`);
  else if (m.crank >= 0) {
    const turned = column(m, rows, m.freedoms[m.crank].coordinate);
    const whole = Math.max(...turned) - Math.min(...turned) >= m.freedoms[m.crank].period * (1 - 1e-9);
    parts.push(whole ? "Turns fully" : "Does not turn fully in this time");
  }
  if (m.transmission >= 0 && rows.count > 0)
    parts.push(`least transmission angle ${digits((leastTransmission(m, rows) * 180) / Math.PI)} deg`);
  for (const output of rows.count > 0 ? m.moving : []) {
    const path = column(m, rows, output);
    const range = Math.max(...path) - Math.min(...path);
    const of = m.outputs[output];
    if (range > 0) parts.push(`${of.name.replace(".", " ")} over ${shown(range, of)}`);
  }
  const why =
    source === "run" && !orbit.found && orbit.sentence ? ` No periodic motion: ${orbit.sentence}.` : "";
  return `${parts.join(", ")}.${why}`;
}

/** The verdict that the Floquet multipliers give. */
export function verdictInWords(
  orbit: Pick<Orbit, "found" | "size" | "multipliers">,
  tolerance: number,
): string {
  if (!orbit.found) return "no periodic motion";
  if (orbit.size === 0) return "prescribed: no freedom is left that could be unstable";
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
