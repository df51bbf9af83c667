import assert from "node:assert/strict";
import { test } from "node:test";
import { dxfText, readLines } from "../src/dxf";
import { points } from "./wheel";

const drawing = (...rows: (string | number)[]): string =>
  ["0", "SECTION", "2", "ENTITIES", ...rows, "0", "ENDSEC", "0", "EOF"].join("\n");

function near(found: number[][], wanted: number[][]): void {
  assert.equal(found.length, wanted.length);
  found.flat().forEach((value, n) => assert.ok(Math.abs(value - wanted.flat()[n]) < 1e-9, `${value}`));
}

test("what is written is read again", () => {
  const text = dxfText([
    { layer: "ground link", points: points("0 0, 0.1 -0.05") },
    { layer: "päth", points: points("0 0, 0.1 0, 0.1 0.2"), closed: true },
    { layer: "joints", points: [[0.3, 0]], radius: 0.01 },
    { layer: "letters", points: [[0.3, 0]], text: "Ä", height: 0.01 },
  ]);
  assert.match(text, /ground-link/);
  assert.match(text, /\\U\+00C4/);
  assert.ok(/^[ -~\r\n]*$/.test(text));
  const { paths, left } = readLines(text);
  near(paths[0], points("0 0, 0.1 -0.05"));
  near(paths[1], points("0 0, 0.1 0, 0.1 0.2, 0 0"));
  for (const [x, y] of paths[2]) assert.ok(Math.abs(Math.hypot(x - 0.3, y) - 0.01) < 1e-9);
  assert.deepEqual(left, { TEXT: 1 });
});

test("an arc goes round against the clock, from its first angle to its second", () => {
  const rows = ["0", "ARC", "10", 1, "20", 2, "40", 5, "50", 270, "51", 0];
  const [path] = readLines(drawing(...rows)).paths;
  near([path[0], path.at(-1)!], points("1e-3 -3e-3, 6e-3 2e-3"));
  assert.ok(path.every(([x, y]) => x > 1e-3 - 1e-12 && y < 2e-3 + 1e-12));
});

test("a bulge of one is half a circle to the right of the chord", () => {
  const corners = ["10", 0, "20", 0, "42", 1, "10", 2, "20", 0];
  const [path] = readLines(drawing("0", "LWPOLYLINE", "70", 0, ...corners)).paths;
  for (const [x, y] of path) assert.ok(Math.abs(Math.hypot(x - 1e-3, y) - 1e-3) < 1e-12);
  assert.ok(Math.min(...path.map((point) => point[1])) < -0.99e-3);
  near([path.at(-1)!], [[2e-3, 0]]);
});

test("a drawing is in its own unit", () => {
  const head = ["0", "SECTION", "2", "HEADER", "9", "$INSUNITS", "70", "1", "0", "ENDSEC", ""].join("\r\n");
  const line = drawing("0", "LINE", "10", 0, "20", 0, "11", 1, "21", 0).replaceAll("\n", "\r\n");
  near(readLines(head + line).paths[0], [
    [0, 0],
    [0.0254, 0],
  ]);
});

for (const [text, said] of [
  ["AutoCAD Binary DXF\r\n", /binary/],
  ["no drawing\nat all", /line 1 .* no group code/],
  [drawing("0", "TEXT", "1", "x"), /no LINE/],
  [drawing("0", "LINE", "10", "x", "20", 0, "11", 1, "21", 0), /no LINE/],
  ["", /no LINE/],
] as const)
  test(`${JSON.stringify(text.slice(0, 50))} is refused`, () => {
    assert.throws(() => readLines(text), said);
  });
