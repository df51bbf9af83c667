/** Points as people write them: x and y in mm, a line each. */

import { Wrong } from "./elements";
import type { Point } from "./view";
import { digits } from "./words";

/** The points of a text (m); empty lines count for nothing. */
export function pointsOf(text: string): Point[] {
  return text.split("\n").flatMap((row, n): Point[] => {
    const words = row.trim().split(/[\s,;]+/);
    if (words.length === 1 && words[0] === "") return [];
    const values = words.map(Number);
    if (values.length === 2 && values.every(Number.isFinite)) return [[values[0] / 1e3, values[1] / 1e3]];
    throw new Wrong(
      `line ${n + 1} of the points is "${row.trim()}": it must be two numbers, x and y in mm, such as 12.5 -30`,
    );
  });
}

export const textOf = (points: Point[]): string =>
  points.map((point) => point.map((value) => digits(1e3 * value, 7)).join(" ")).join("\n");
