/** The force in a joint as a vector over the motion, with the envelope of all of them. */

import { make } from "./elements";
import type { Rows } from "./motions";
import { hull } from "./hull";
import { type Interval, Plane } from "./plane";
import { type Chart, type Mechanism, outputPlace, rowLength } from "./tables";
import { called, digits } from "./words";

const HEIGHT = 300;

export class Forces {
  readonly box = make("figure");
  private readonly joint = make("select", { "aria-label": "Joint" });
  private readonly sides = make("select", { "aria-label": "Seen along" });
  private readonly words = make("div", { className: "told" });
  private readonly plane: Plane;
  private mechanism!: Mechanism;
  private chart: Chart | undefined;
  private rows: Rows | undefined;
  private row = 0;

  constructor() {
    for (const select of [this.joint, this.sides]) select.addEventListener("change", () => this.draw());
    this.box.append(make("div", { className: "axes" }, "Force on ", this.joint, this.sides));
    this.plane = new Plane(this.box, HEIGHT);
    this.plane.canvas.setAttribute("role", "img");
    this.plane.onSize = () => this.draw();
    this.box.append(this.words);
  }

  show(mechanism: Mechanism): void {
    this.mechanism = mechanism;
    this.chart = mechanism.charts.find((chart) => chart.kind === "forces");
    this.joint.replaceChildren(
      ...(this.chart?.curves ?? []).map((curve, n) => new Option(called(curve), String(n))),
    );
    const spatial = this.chart?.curves.some(({ of }) => of.length > 2) ?? false;
    this.sides.replaceChildren(...["x, y", "y, z", "x, z"].map((name) => new Option(name, name)));
    this.sides.hidden = !spatial;
  }

  data(rows: Rows): void {
    this.rows = rows;
    this.draw();
  }

  mark(row: number): void {
    if (row === this.row) return;
    this.row = row;
    this.draw();
  }

  private draw(): void {
    const { plane, rows, chart } = this;
    const curve = chart?.curves[Number(this.joint.value)];
    if (!rows?.count || !curve || this.box.clientWidth === 0) return;
    const sides = this.sides.value.split(", ");
    const length = rowLength(this.mechanism);
    const places = sides.map((side) => {
      const number = curve.of["xyz".indexOf(side)] as number | undefined;
      return number === undefined ? -1 : outputPlace(this.mechanism, number);
    });
    const points = Array.from({ length: rows.count }, (_, row): Interval => {
      const [x, y] = places.map((place) => (place < 0 ? 0 : rows.values[row * length + place]));
      return [x, y];
    });
    const sizes = points.map(([x, y]) => Math.hypot(x, y));
    const most = sizes.indexOf(Math.max(...sizes));
    const reach = 1.06 * sizes[most] || 1;
    const [x, y] = [0, 1].map((axis): Interval => {
      const all = points.map((point) => point[axis]);
      return [Math.min(0, ...all) - 0.06 * reach, Math.max(0, ...all) + 0.06 * reach];
    });
    plane.frame(x, y, [`f${sides[0]} [N]`, `f${sides[1]} [N]`], true);
    const c = plane.context;
    const envelope = hull(points);
    c.lineWidth = 1.2;
    c.strokeStyle = plane.colour("soft");
    plane.line([...envelope, ...envelope.slice(0, 1)], [5, 4]);
    c.lineWidth = 2;
    c.strokeStyle = plane.colour("accent");
    plane.line(points);
    c.strokeStyle = plane.colour("bad");
    plane.line([[0, 0], points[Math.min(this.row, points.length - 1)]]);
    const [fx, fy] = points[most];
    const angle = (Math.atan2(fy, fx) * 180) / Math.PI;
    this.words.textContent =
      `Greatest ${digits(sizes[most])} N towards ${digits(angle, 3)} deg. Curve: the tip of the force over the motion; ` +
      "straight line: the force at this instant; dashed: the envelope.";
    plane.canvas.setAttribute(
      "aria-label",
      `Force on ${called(curve)} as a vector; ${this.words.textContent}`,
    );
  }
}
