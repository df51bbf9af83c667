/** Points as people write them: x and y in mm, a line each. */

import { Wrong } from "./elements";
import type { Point } from "./view";
import { digits } from "./words";

/** The points of a text (m); empty lines count for nothing. */
export function readPoints(text: string): Point[] {
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

export const writePoints = (points: Point[]): string =>
  points.map((point) => point.map((value) => digits(1e3 * value, 7)).join(" ")).join("\n");

/** Of a path, at least. */
const LEAST = 3;

/** The points of a path that can be searched for; of a closed one that ends with its first point again without that. */
export function soundPath(points: Point[], closed: boolean): Point[] {
  const same = (n: number, m: number): boolean => points[n].join() === points[m].join();
  const all = closed && points.length > LEAST && same(0, points.length - 1) ? points.slice(0, -1) : points;
  const count = all.length;
  if (count === 0) throw new Wrong("Draw a path first, or take that of the mechanism: there is none yet");
  if (count < LEAST)
    throw new Wrong(`The path has ${count} point${count === 1 ? "" : "s"}: it needs at least ${LEAST}`);
  const again = all.findIndex((_, n) => n > 0 && same(n, n - 1));
  if (again > 0) throw new Wrong(`Points ${again} and ${again + 1} of the path are the same: take one away`);
  return all;
}
