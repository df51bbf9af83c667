/** A path that is drawn over the mechanism, by hand or by its points, and curves beside it. */

import { element, written } from "./picture";
import type { Point, View } from "./view";

/** Points of a path that was drawn; the share of its extent within which its ends are one. */
const POINTS = 72;
const NEAR = 0.2;

const distance = (a: Point, b: Point): number => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** Points at equal steps along a path. */
export function resampled(points: Point[], closed: boolean, count: number): Point[] {
  const all = closed ? [...points, points[0]] : points;
  const along = [0];
  for (let n = 1; n < all.length; n++) along.push(along[n - 1] + distance(all[n - 1], all[n]));
  const length = along[along.length - 1];
  let part = 0;
  return Array.from({ length: count }, (_, n) => {
    const at = (n * length) / (closed ? count : count - 1);
    while (part < along.length - 2 && along[part + 1] < at) part++;
    const share = Math.min(1, (at - along[part]) / (along[part + 1] - along[part] || 1));
    const [[x, y], [u, v]] = [all[part], all[part + 1]];
    return [x + share * (u - x), y + share * (v - y)];
  });
}

/** Whether a path that was drawn comes back to where it began. */
export function comesBack(points: Point[]): boolean {
  const [first, last] = [points[0], points[points.length - 1]];
  const extent = Math.max(...points.map((point) => distance(first, point)));
  return points.length > 3 && distance(first, last) < NEAR * extent;
}

export class Sketch {
  points: Point[] = [];
  closed = true;
  /** Called where the path is another. */
  onChange: () => void = () => {};
  onDrawing: (drawing: boolean) => void = () => {};
  private beside: Point[] = [];
  private drawing = false;
  private readonly layer: SVGGElement;

  constructor(
    private readonly view: View,
    private readonly svg: SVGSVGElement,
  ) {
    this.layer = element("g", svg);
    // before the joints and the view hear of it
    svg.addEventListener("pointerdown", (event) => this.begin(event), true);
  }

  /** Begin over another mechanism. */
  show(): void {
    this.svg.append(this.layer);
    this.put([], true);
  }

  /** Let the next stroke on the picture be the path. */
  listen(drawing: boolean): void {
    this.drawing = drawing;
    this.onDrawing(drawing);
  }

  get listening(): boolean {
    return this.drawing;
  }

  put(points: Point[], closed: boolean, beside: Point[] = []): void {
    this.points = points;
    this.closed = closed;
    this.beside = beside;
    this.draw();
    this.onChange();
  }

  private begin(event: PointerEvent): void {
    if (!this.drawing) return;
    const { svg } = this;
    event.stopImmediatePropagation();
    event.preventDefault();
    svg.setPointerCapture(event.pointerId);
    const stroke: Point[] = [this.view.at(event)];
    this.put(stroke, false);
    const stop = new AbortController();
    const options = { signal: stop.signal };
    svg.addEventListener(
      "pointermove",
      (now) => {
        stroke.push(this.view.at(now));
        this.draw();
      },
      options,
    );
    const end = (): void => {
      stop.abort();
      this.listen(false);
      const closed = comesBack(stroke);
      if (stroke.length > 3) this.put(resampled(stroke, closed, POINTS), closed);
      else this.put([], true);
    };
    for (const name of ["pointerup", "pointercancel"] as const) svg.addEventListener(name, end, options);
  }

  draw(): void {
    const line = (points: Point[], closed: boolean, name: string): void => {
      if (points.length < 2) return;
      const all = (closed ? [...points, points[0]] : points).map((point) => this.view.place(point));
      element("polyline", this.layer, { class: name, points: written(all) });
    };
    this.layer.replaceChildren();
    line(this.points, this.closed, "wanted");
    line(this.beside, this.closed, "beside");
  }
}
