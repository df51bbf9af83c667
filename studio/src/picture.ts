/** The drawing of a mechanism, by its table of parts; joints are places in a row. */

import { jointAt, type Mechanism, type Part, rowLength } from "./tables";

type Point = [number, number];
type Attributes = Record<string, string | number>;

const SPACE = "http://www.w3.org/2000/svg";
/** Elevation and azimuth (rad) from which a spatial mechanism is seen first, its x axis upright. */
const VIEW: Point = [0.38, -0.55];
const MARGIN = 70;
/** Where the letters stand beside their joints, one after another: joints at one place can be read. */
const LETTERS: Point[] = [
  [-10, -8],
  [10, 20],
  [10, -10],
  [-10, 20],
];

function element<K extends keyof SVGElementTagNameMap>(
  kind: K,
  parent: Element,
  attributes: Attributes = {},
): SVGElementTagNameMap[K] {
  const made = document.createElementNS(SPACE, kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  parent.append(made);
  return made;
}

const written = (points: Point[]): string =>
  points.map(([x, y]) => `${x.toFixed(2)},${y.toFixed(2)}`).join(" ");

/** A point so far along the direction from a to b, and so far to its left on the screen. */
function beside(from: Point, a: Point, b: Point, along: number, left: number): Point {
  const size = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const [x, y] = [(b[0] - a[0]) / size, (b[1] - a[1]) / size];
  return [from[0] + along * x + left * y, from[1] + along * y - left * x];
}

interface Shape {
  part: Part;
  drawn: SVGElement[];
}

export class Picture {
  /** Rows of the matrix from places to what is seen, both in m. */
  view: number[] = [1, 0, 0, 0, 1, 0];
  onDrag: (joint: number, target: Point, done: boolean) => void = () => {};
  onGrab: () => void = () => {};
  onTurn: () => void = () => {};
  private mechanism!: Mechanism;
  private shapes: Shape[] = [];
  private handles: SVGGElement[] = [];
  private paths: SVGPolylineElement[] = [];
  private angles: Point = [...VIEW];
  private scale = 1;
  private centre: Point = [0, 0];
  private row: Float64Array = new Float64Array();
  /** The joint that is dragged, and how far it is from where it was taken (m). */
  private held = -1;
  private grip: Point = [0, 0];

  constructor(private readonly svg: SVGSVGElement) {
    svg.addEventListener("pointerdown", (event) => this.turn(event));
  }

  /** Draw another mechanism. */
  show(mechanism: Mechanism): void {
    this.mechanism = mechanism;
    this.angles = [...VIEW];
    this.look();
    this.svg.replaceChildren();
    const { parts, joints, paths } = mechanism.picture;
    this.shapes = [];
    const behind = element("g", this.svg);
    this.paths = paths.map((_, n) => element("polyline", this.svg, { class: `path path${n}` }));
    let links = parts.filter((part) => part.kind === "link").length;
    for (const part of parts) {
      const under = ["link", "slider"].includes(part.kind) ? this.svg : behind;
      const kind = part.kind === "link" ? `link link${--links % 3}` : part.kind;
      const group = element("g", under, { class: kind });
      element("title", group).textContent = part.text;
      const drawn: SVGElement[] = [];
      if (part.kind === "link" && part.joints.length > 2) drawn.push(element("polygon", group));
      const lines = { pivot: 1, link: 0, guide: 1, slider: 0, spring: 1, damper: 2, axis: 1 }[part.kind];
      for (let i = 0; i < lines; i++) drawn.push(element("polyline", group));
      if (part.kind === "link") drawn.push(element("polyline", group));
      if (part.kind === "slider") drawn.push(element("polygon", group));
      this.shapes.push({ part, drawn });
    }
    this.handles = joints.map((joint, number) => this.handle(joint.name, joint.text, joint.moves, number));
  }

  /** Choose the scale so that all these rows are seen. */
  fit(rows: Float64Array): void {
    const { width, height } = this.svg.getBoundingClientRect();
    const length = rowLength(this.mechanism);
    let [low, high]: Point[] = [
      [Infinity, Infinity],
      [-Infinity, -Infinity],
    ];
    for (let start = 0; start < rows.length; start += length)
      for (let joint = 0; joint < this.handles.length; joint++) {
        const seen = this.seen(rows, start, joint);
        low = [Math.min(low[0], seen[0]), Math.min(low[1], seen[1])];
        high = [Math.max(high[0], seen[0]), Math.max(high[1], seen[1])];
      }
    if (!(high[0] > low[0]) || width === 0) return;
    const room = [Math.max(50, width - 2 * MARGIN), Math.max(50, height - 2 * MARGIN)];
    this.scale = Math.min(room[0] / (high[0] - low[0]), room[1] / Math.max(high[1] - low[1], 1e-9));
    this.centre = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.svg.setAttribute("viewBox", `${-width / 2} ${-height / 2} ${width} ${height}`);
  }

  /** Draw the paths of the joints over all these rows. */
  drawPaths(rows: Float64Array): void {
    const length = rowLength(this.mechanism);
    this.mechanism.picture.paths.forEach((joint, n) => {
      const points: Point[] = [];
      for (let start = 0; start < rows.length; start += length) points.push(this.place(rows, start, joint));
      this.paths[n].setAttribute("points", written(points));
    });
  }

  /** Draw one configuration; `has` says of a part's parameter whether it is not zero. */
  draw(row: Float64Array, has: (reference: number) => boolean): void {
    this.row = row;
    const places = this.handles.map((_, joint) => this.place(row, 0, joint));
    for (const { part, drawn } of this.shapes) {
      const visible = part.where < 0 || has(part.where);
      for (const one of drawn) one.style.display = visible ? "" : "none";
      if (visible)
        this.shape(
          part,
          drawn,
          part.joints.map((joint) => places[joint]),
        );
    }
    this.handles.forEach((handle, joint) => {
      handle.setAttribute(
        "transform",
        `translate(${places[joint][0].toFixed(2)} ${places[joint][1].toFixed(2)})`,
      );
    });
  }

  /** The picture as a file of its own. */
  svgText(): string {
    const copy = this.svg.cloneNode(true) as SVGSVGElement;
    const { width, height } = this.svg.getBoundingClientRect();
    copy.setAttribute("xmlns", SPACE);
    copy.setAttribute("width", String(width));
    copy.setAttribute("height", String(height));
    const originals = this.svg.querySelectorAll<SVGElement>("polyline, polygon, circle, text");
    copy.querySelectorAll<SVGElement>("polyline, polygon, circle, text").forEach((one, n) => {
      const style = getComputedStyle(originals[n]);
      for (const name of [
        "fill",
        "stroke",
        "stroke-width",
        "stroke-dasharray",
        "stroke-linecap",
        "fill-opacity",
        "font",
      ])
        one.style.setProperty(name, style.getPropertyValue(name));
      if (style.display === "none" || one.classList.contains("reach")) one.remove();
    });
    return new XMLSerializer().serializeToString(copy);
  }

  private shape(part: Part, drawn: SVGElement[], at: Point[]): void {
    const set = (n: number, points: Point[]): void => drawn[n].setAttribute("points", written(points));
    const [a, b, c] = at;
    if (part.kind === "link")
      for (let n = 0; n < drawn.length; n++) set(n, n < drawn.length - 1 ? at : [a, b]);
    else if (part.kind === "axis") set(0, [a, b]);
    else if (part.kind === "pivot") {
      const [x, y] = a;
      set(0, [a, [x - 11, y + 18], [x - 17, y + 18], [x + 17, y + 18], [x + 11, y + 18], a]);
    } else if (part.kind === "guide") {
      const size = Math.hypot(b[0] - a[0], b[1] - a[1]);
      set(0, [beside(a, a, b, -1.4 * size, -13), beside(a, a, b, 1.4 * size, -13)]);
    } else if (part.kind === "slider")
      set(0, [
        beside(a, b, c, -19, -12),
        beside(a, b, c, 19, -12),
        beside(a, b, c, 19, 12),
        beside(a, b, c, -19, 12),
      ]);
    else {
      // from the block to a wall beyond the end of the guide
      const start = beside(a, b, c, 19, part.kind === "spring" ? 6 : -6);
      const size = Math.hypot(c[0] - start[0], c[1] - start[1]);
      if (part.kind === "spring") {
        const turns = Array.from({ length: 13 }, (_, i): Point => [0.1 + (0.8 * i) / 12, i % 2 ? 5 : -5]);
        const all: Point[] = [[0, 0], [0.1, 0], ...turns, [0.9, 0], [1, 0]];
        set(
          0,
          all.map(([share, left]) => beside(start, b, c, share * size, left)),
        );
      } else {
        const on = (along: number, left: number): Point => beside(start, b, c, along * size, left);
        set(0, [on(0, 0), on(0.5, 0), on(0.5, 5), on(0.5, -5)]);
        set(1, [on(0.4, 6), on(0.7, 6), on(0.7, 0), on(1, 0), on(0.7, 0), on(0.7, -6), on(0.4, -6)]);
      }
    }
  }

  private seen(rows: Float64Array, start: number, joint: number): Point {
    const at = start + jointAt(this.mechanism, joint);
    const [x, y, z] = [rows[at], rows[at + 1], rows[at + 2]];
    const v = this.view;
    return [v[0] * x + v[1] * y + v[2] * z, v[3] * x + v[4] * y + v[5] * z];
  }

  private place(rows: Float64Array, start: number, joint: number): Point {
    const [x, y] = this.seen(rows, start, joint);
    return [(x - this.centre[0]) * this.scale, (this.centre[1] - y) * this.scale];
  }

  private look(): void {
    const [up, round] = this.angles;
    const [s, c, t, d] = [Math.sin(up), Math.cos(up), Math.sin(round), Math.cos(round)];
    this.view = this.mechanism.picture.planar ? [1, 0, 0, 0, 1, 0] : [0, d, t, c, s * t, -s * d];
  }

  private handle(name: string, text: string, moves: number[], number: number): SVGGElement {
    const free = moves.length > 0;
    const handle = element("g", this.svg, { class: free ? "joint" : "joint fixed", "data-joint": name });
    element("title", handle).textContent = `${name}, ${text}`;
    if (free) element("circle", handle, { r: 17, class: "reach" });
    element("circle", handle, { r: free ? 6.5 : 5, class: "pin" });
    const [x, y] = LETTERS[number % LETTERS.length];
    element("text", handle, { x, y, "text-anchor": x < 0 ? "end" : "start" }).textContent = name;
    if (!free) return handle;
    handle.setAttribute("tabindex", "0");
    handle.setAttribute("role", "button");
    handle.setAttribute("aria-label", `${name}, ${text}: drag it, or move it with the arrow keys`);
    handle.addEventListener("pointerdown", (event) => {
      event.stopPropagation();
      event.preventDefault();
      handle.focus();
      handle.setPointerCapture(event.pointerId);
      this.onGrab();
      this.grip = [0, 0];
      const [from, at] = [this.target(event), this.seen(this.row, 0, number)];
      this.grip = [at[0] - from[0], at[1] - from[1]];
      this.held = number;
    });
    handle.addEventListener("pointermove", (event) => {
      if (this.held === number) this.onDrag(number, this.target(event), false);
    });
    const release = (event: PointerEvent): void => {
      if (this.held !== number) return;
      this.held = -1;
      this.onDrag(number, this.target(event), true);
    };
    handle.addEventListener("pointerup", release);
    handle.addEventListener("pointercancel", release);
    handle.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!way) return;
      event.preventDefault();
      event.stopPropagation();
      const [x, y] = this.seen(this.row, 0, number);
      const step = (event.shiftKey ? 20 : 2) / this.scale;
      this.onDrag(number, [x + step * way[0], y + step * way[1]], true);
    });
    return handle;
  }

  /** Where a pointer is, as the joints are seen (m). */
  private target(event: PointerEvent): Point {
    const box = this.svg.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
    return [this.centre[0] + x / this.scale + this.grip[0], this.centre[1] - y / this.scale + this.grip[1]];
  }

  /** Turn a spatial mechanism by a drag beside its joints. */
  private turn(event: PointerEvent): void {
    if (this.mechanism.picture.planar) return;
    this.svg.setPointerCapture(event.pointerId);
    let last: Point = [event.clientX, event.clientY];
    const move = (now: PointerEvent): void => {
      this.angles[1] += (now.clientX - last[0]) / 150;
      this.angles[0] = Math.max(-1.5, Math.min(1.5, this.angles[0] + (now.clientY - last[1]) / 150));
      last = [now.clientX, now.clientY];
      this.look();
      this.onTurn();
    };
    const stop = new AbortController();
    this.svg.addEventListener("pointermove", move, { signal: stop.signal });
    for (const name of ["pointerup", "pointercancel"] as const)
      this.svg.addEventListener(name, () => stop.abort(), { signal: stop.signal });
  }
}
