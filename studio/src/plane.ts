/** A plane with axes on a canvas: curves that turn back, squares, vectors. */

import { make } from "./elements";
import { digits } from "./words";

export type Interval = [number, number];

const MARGIN = { left: 58, right: 12, top: 10, bottom: 40 };
const RATIO = 2;

/** Round numbers between two values, about so many. */
export function ticks([low, high]: Interval, count: number): number[] {
  const size = (high - low) / count;
  const round = 10 ** Math.floor(Math.log10(size));
  const step = round * ([1, 2, 5].find((n) => n * round >= size) ?? 10);
  const first = Math.ceil(low / step - 1e-9) + 0;
  const found: number[] = [];
  for (let n = first; n * step <= high + 1e-9 * step; n++) found.push(n * step);
  return found;
}

export class Plane {
  readonly canvas = make("canvas", { className: "plane" });
  readonly context = this.canvas.getContext("2d")!;
  private x: Interval = [0, 1];
  private y: Interval = [0, 1];
  private width = 300;
  private colours = getComputedStyle(document.documentElement);
  /** To be called when there is another size to draw in. */
  onSize: () => void = () => {};

  constructor(
    place: HTMLElement,
    private readonly height: number,
  ) {
    place.append(this.canvas);
    new ResizeObserver(() => {
      if (place.clientWidth === 0 || place.clientWidth === this.width) return;
      this.width = place.clientWidth;
      this.onSize();
    }).observe(place);
  }

  colour(name: string): string {
    return this.colours.getPropertyValue(`--${name}`);
  }

  /** Begin anew with these ranges; `equal`: a unit is as long along both axes. */
  frame(x: Interval, y: Interval, names: [string, string], equal = false): void {
    const [width, height] = [this.width, this.height];
    const c = this.context;
    this.canvas.width = RATIO * width;
    this.canvas.height = RATIO * height;
    this.canvas.style.height = `${height}px`;
    c.scale(RATIO, RATIO);
    const room = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom];
    if (equal) {
      const scale = Math.max((x[1] - x[0]) / room[0], (y[1] - y[0]) / room[1]);
      [x, y] = [x, y].map((range, n): Interval => {
        const [middle, half] = [(range[0] + range[1]) / 2, (scale * room[n]) / 2];
        return [middle - half, middle + half];
      });
    }
    [this.x, this.y] = [x, y];
    c.font = "12px system-ui, sans-serif";
    c.lineWidth = 1;
    c.strokeStyle = this.colour("line");
    c.fillStyle = this.colour("text");
    c.textAlign = "center";
    for (const value of ticks(x, Math.max(3, room[0] / 90))) {
      this.mark(value, "x");
      const text = digits(value, 6);
      // the last one stays inside
      const most = width - c.measureText(text).width / 2;
      c.fillText(text, Math.min(this.px(value), most), height - MARGIN.bottom + 15);
    }
    c.textAlign = "right";
    for (const value of ticks(y, Math.max(3, room[1] / 45))) {
      this.mark(value, "y");
      c.fillText(digits(value, 6), MARGIN.left - 6, this.py(value) + 4);
    }
    c.textAlign = "center";
    c.fillText(names[0], MARGIN.left + room[0] / 2, height - 6);
    c.save();
    c.translate(12, MARGIN.top + room[1] / 2);
    c.rotate(-Math.PI / 2);
    c.fillText(names[1], 0, 0);
    c.restore();
    // what is drawn from now on stays inside
    c.beginPath();
    c.rect(MARGIN.left, MARGIN.top, room[0], room[1]);
    c.clip();
  }

  px(value: number): number {
    const room = this.width - MARGIN.left - MARGIN.right;
    return MARGIN.left + (room * (value - this.x[0])) / (this.x[1] - this.x[0]);
  }

  py(value: number): number {
    const room = this.height - MARGIN.top - MARGIN.bottom;
    return MARGIN.top + room - (room * (value - this.y[0])) / (this.y[1] - this.y[0]);
  }

  /** The place of a pointer. */
  at(event: MouseEvent): Interval {
    const box = this.canvas.getBoundingClientRect();
    const share = [
      (event.clientX - box.left - MARGIN.left) / (this.width - MARGIN.left - MARGIN.right),
      1 - (event.clientY - box.top - MARGIN.top) / (this.height - MARGIN.top - MARGIN.bottom),
    ];
    const [x, y] = [this.x, this.y].map((range, n) => range[0] + share[n] * (range[1] - range[0]));
    return [x, y];
  }

  line(points: Interval[], dash: number[] = []): void {
    const c = this.context;
    c.setLineDash(dash);
    c.beginPath();
    points.forEach(([x, y], n) => c[n ? "lineTo" : "moveTo"](this.px(x), this.py(y)));
    c.stroke();
    c.setLineDash([]);
  }

  /** A line across the whole plane at a value along one of its axes. */
  mark(value: number, axis: "x" | "y"): void {
    const ends = axis === "x" ? this.y : this.x;
    this.line(ends.map((end): Interval => (axis === "x" ? [value, end] : [end, value])));
  }

  /** A rectangle with slanting lines in it: it can be told apart without its colour. */
  hatch([left, right]: Interval, [low, high]: Interval, gap: number): void {
    const c = this.context;
    const [x, y] = [Math.round(this.px(left)), Math.round(this.py(high))];
    const [width, height] = [Math.round(this.px(right)) - x, Math.round(this.py(low)) - y];
    c.save();
    c.beginPath();
    c.rect(x, y, width, height);
    c.clip();
    c.beginPath();
    // on one raster over the whole plane
    for (let at = Math.floor((x + y) / gap) * gap; at < x + y + width + height; at += gap) {
      c.moveTo(at - y, y);
      c.lineTo(at - y - height, y + height);
    }
    c.stroke();
    c.restore();
  }
}
