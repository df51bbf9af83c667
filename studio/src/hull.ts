import type { Interval } from "./plane";

/** The corners of the convex hull, in order. */
export function hull(points: Interval[]): Interval[] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (all: Interval[]): Interval[] => {
    const kept: Interval[] = [];
    for (const point of all) {
      for (;;) {
        const [a, b] = kept.slice(-2);
        if (!b || (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) > 0) break;
        kept.pop();
      }
      kept.push(point);
    }
    return kept.slice(0, -1);
  };
  return [...half(sorted), ...half([...sorted].reverse())];
}
