import assert from "node:assert/strict";
import { test } from "node:test";
import { View, viewMatrix, VIEWS } from "../src/view";

for (const [name, angles] of Object.entries({ ...VIEWS, other: [0.3, 2.1] as [number, number] }))
  for (const planar of [true, false])
    test(`from ${name} three directions at right angles are seen${planar ? ", planar" : ""}`, () => {
      const m = viewMatrix(planar, angles);
      const [a, b, c] = [m.slice(0, 3), m.slice(3, 6), m.slice(6)];
      const cross = [0, 1, 2].map((i) => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
      cross.forEach((value, i) => assert.ok(Math.abs(value - c[i]) < 1e-12));
      for (const row of [a, b, c]) assert.ok(Math.abs(Math.hypot(...row) - 1) < 1e-12);
    });

test("from the front the axis of the crank is a point, from the side it is not", () => {
  assert.ok(Math.hypot(viewMatrix(false, VIEWS.front)[2], viewMatrix(false, VIEWS.front)[5]) < 1e-12);
  assert.ok(Math.abs(viewMatrix(false, VIEWS.side)[2]) > 1 - 1e-12);
  const corner = viewMatrix(false, VIEWS.isometric).slice(6).map(Math.abs);
  for (const value of corner) assert.ok(Math.abs(value - Math.sqrt(1 / 3)) < 1e-12);
});

test("what lies on one line fits too", () => {
  const box = { width: 640, height: 340 };
  const svg = { addEventListener: () => {}, setAttribute: () => {}, getBoundingClientRect: () => box };
  const view = new View(svg as unknown as SVGSVGElement);
  view.fit([0, -0.1], [0, 0.1]);
  assert.deepEqual([view.scale, view.place([0, 0.1])], [1000, [0, -100]]);
});
