/** DXF, as far as drawings of lines, circles and letters need it: written in mm, read in m. */

import type { Drawn } from "./picture";
import type { Point } from "./view";

/** Metres a unit, by the value of $INSUNITS; mm where a drawing says nothing. */
const UNITS: Record<number, number> = { 1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1 };
const MM = 1e-3;
/** Chords of a full circle. */
const CHORDS = 96;
/** Colours of layers: the numbers of the first that are seen on white and on black. */
const COLOURS = [7, 1, 5, 3, 6, 30, 150, 8];

/** Letters that every reader of DXF knows. */
const plain = (text: string): string =>
  text.replace(/[^ -~]/g, (c) => `\\U+${c.charCodeAt(0).toString(16).toUpperCase().padStart(4, "0")}`);
const layerName = (text: string): string =>
  plain(text)
    .replace(/[^\w$-]+/g, "-")
    .replace(/^-+|-+$/g, "") || "drawing";

/** A drawing as DXF of AutoCAD's release 12, which all programs read. */
export function dxfText(drawn: Drawn[]): string {
  const lines: string[] = [];
  const put = (...pairs: [number, string | number][]): void => {
    for (const [code, value] of pairs) lines.push(String(code), String(value));
  };
  const mm = (value: number): string => (value / MM).toFixed(6);
  const at = ([x, y]: Point, by = 0): [number, string][] => [
    [10 + by, mm(x)],
    [20 + by, mm(y)],
    [30 + by, "0.0"],
  ];
  put([0, "SECTION"], [2, "HEADER"], [9, "$ACADVER"], [1, "AC1009"], [9, "$INSUNITS"], [70, 4]);
  put([0, "ENDSEC"], [0, "SECTION"], [2, "TABLES"], [0, "TABLE"], [2, "LAYER"]);
  const layers = [...new Set(drawn.map((one) => layerName(one.layer)))];
  put([70, layers.length]);
  layers.forEach((name, n) =>
    put([0, "LAYER"], [2, name], [70, 0], [62, COLOURS[n % COLOURS.length]], [6, "CONTINUOUS"]),
  );
  put([0, "ENDTAB"], [0, "ENDSEC"], [0, "SECTION"], [2, "ENTITIES"]);
  for (const { layer, points, closed, radius, text, height, ends } of drawn) {
    const on: [number, string] = [8, layerName(layer)];
    if (text !== undefined) {
      put([0, "TEXT"], on, ...at(points[0]), [40, mm(height ?? MM)], [1, plain(text)]);
      if (ends) put([72, 2], ...at(points[0], 1));
    } else if (radius !== undefined) put([0, "CIRCLE"], on, ...at(points[0]), [40, mm(radius)]);
    else if (points.length === 2) put([0, "LINE"], on, ...at(points[0]), ...at(points[1], 1));
    else if (points.length > 2) {
      put([0, "POLYLINE"], on, [66, 1], ...at([0, 0]), [70, closed ? 1 : 0]);
      for (const point of points) put([0, "VERTEX"], on, ...at(point));
      put([0, "SEQEND"], on);
    }
  }
  put([0, "ENDSEC"], [0, "EOF"]);
  return `${lines.join("\r\n")}\r\n`;
}

/** The lines of a drawing (m), and what was left out of it. */
export interface Lines {
  paths: Point[][];
  left: Record<string, number>;
}

interface Entity {
  kind: string;
  pairs: [number, string][];
}

/** Points of an arc from an angle, over another (rad), without its first. */
function arc([x, y]: Point, radius: number, from: number, over: number): Point[] {
  const count = Math.max(1, Math.ceil((Math.abs(over) / (2 * Math.PI)) * CHORDS));
  return Array.from({ length: count }, (_, n) => {
    const angle = from + (over * (n + 1)) / count;
    return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
  });
}

/** Points from a to b, on an arc whose bulge is the tangent of a quarter of its angle. */
function bulged(a: Point, b: Point, bulge: number): Point[] {
  if (bulge === 0) return [b];
  const [x, y] = [b[0] - a[0], b[1] - a[1]];
  const away = (1 - bulge * bulge) / (4 * bulge);
  const centre: Point = [a[0] + x / 2 - y * away, a[1] + y / 2 + x * away];
  const from = Math.atan2(a[1] - centre[1], a[0] - centre[0]);
  return arc(centre, Math.hypot(a[0] - centre[0], a[1] - centre[1]), from, 4 * Math.atan(bulge));
}

function polyline(points: [Point, number][], closed: boolean): Point[] {
  if (points.length === 0) return [];
  const path: Point[] = [points[0][0]];
  const ends = closed ? [...points.slice(1), points[0]] : points.slice(1);
  ends.forEach(([end], n) => path.push(...bulged(points[n][0], end, points[n][1])));
  return path;
}

const number = ({ pairs }: Entity, code: number): number =>
  Number(pairs.find((pair) => pair[0] === code)?.[1] ?? 0);

/** Points with their bulges: of a polyline of two dimensions all in one entity. */
function corners({ pairs }: Entity): [Point, number][] {
  const found: [Point, number][] = [];
  for (const [code, value] of pairs) {
    if (code === 10) found.push([[Number(value), 0], 0]);
    else if (code === 20 && found.length > 0) found[found.length - 1][0][1] = Number(value);
    else if (code === 42 && found.length > 0) found[found.length - 1][1] = Number(value);
  }
  return found;
}

const entityCentre = (one: Entity): Point => [number(one, 10), number(one, 20)];

/** The path of an entity; of a POLYLINE with the vertices that follow it. */
function entityPath(one: Entity, all: Entity[], next: number): Point[] | undefined {
  const rad = Math.PI / 180;
  const closed = (number(one, 70) & 1) === 1;
  switch (one.kind) {
    case "LINE":
      return [entityCentre(one), [number(one, 11), number(one, 21)]];
    case "CIRCLE":
    case "ARC": {
      const [from, to] = one.kind === "ARC" ? [number(one, 50), number(one, 51)] : [0, 360];
      const over = (((to - from) % 360) + 360) % 360 || 360;
      const [centre, radius] = [entityCentre(one), number(one, 40)];
      const start: Point = [
        centre[0] + radius * Math.cos(from * rad),
        centre[1] + radius * Math.sin(from * rad),
      ];
      return [start, ...arc(centre, radius, from * rad, over * rad)];
    }
    case "LWPOLYLINE":
      return polyline(corners(one), closed);
    case "POLYLINE": {
      const vertices: [Point, number][] = [];
      for (let n = next; all[n]?.kind === "VERTEX"; n++)
        vertices.push([entityCentre(all[n]), number(all[n], 42)]);
      return polyline(vertices, closed);
    }
    default:
      return undefined;
  }
}

/** The lines of a DXF: LINE, LWPOLYLINE, POLYLINE, CIRCLE and ARC; an Error says where there are none. */
export function readLines(text: string): Lines {
  if (text.startsWith("AutoCAD Binary DXF")) throw new Error("a binary DXF is not read: save it as text");
  const rows = text.split(/\r\n|\r|\n/);
  const entities: Entity[] = [];
  let [section, unit, variable] = ["", MM, ""];
  let last: Entity = { kind: "", pairs: [] };
  for (let n = 0; n + 1 < rows.length; n += 2) {
    const [code, value] = [Number(rows[n]), rows[n + 1].trim()];
    if (!Number.isInteger(code)) throw new Error(`line ${n + 1} of the DXF is no group code`);
    if (code === 0) {
      last = { kind: value, pairs: [] };
      if (value === "ENDSEC") section = "";
      if (section === "ENTITIES") entities.push(last);
    } else if (code === 2 && last.kind === "SECTION") section = value;
    else if (code === 9) variable = value;
    else if (code === 70 && variable === "$INSUNITS" && section === "HEADER")
      unit = UNITS[Number(value)] ?? MM;
    else last.pairs.push([code, value]);
  }
  const found: Lines = { paths: [], left: {} };
  entities.forEach((one, n) => {
    if (["VERTEX", "SEQEND"].includes(one.kind)) return;
    const path = entityPath(one, entities, n + 1);
    if (!path) found.left[one.kind] = (found.left[one.kind] ?? 0) + 1;
    else if (path.length > 1 && path.flat().every(Number.isFinite))
      found.paths.push(path.map(([x, y]) => [x * unit, y * unit]));
  });
  if (found.paths.length === 0)
    throw new Error("the DXF has no LINE, POLYLINE, LWPOLYLINE, CIRCLE or ARC among its entities");
  return found;
}
