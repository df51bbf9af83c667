/** The drawing of a mechanism, by its table of parts; joints are places in a row. */

import { type Joint, jointPlace, type Mechanism, type Part, rowLength } from "./tables";
import { arrowOf, cornersOf, type Point, View } from "./view";

type Attributes = Record<string, string | number>;

const SPACE = "http://www.w3.org/2000/svg";
/** What a drawing that is saved is made of. */
const KEPT = ["polyline", "polygon", "circle", "text"]
  .map((kind) => `${kind}:not(#behind *, #markers *)`)
  .join();
/** Where the letters stand beside their joints, one after another: joints at one place can be read. */
const LETTERS: Point[] = [
  [-10, -8],
  [10, 20],
  [10, -10],
  [-10, 20],
];

export function element<K extends keyof SVGElementTagNameMap>(
  kind: K,
  parent: ParentNode,
  attributes: Attributes = {},
): SVGElementTagNameMap[K] {
  const made = document.createElementNS(SPACE, kind);
  put(made, attributes);
  parent.append(made);
  return made;
}

function put(made: Element, attributes: Attributes): void {
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
}

export const written = (points: Point[]): string =>
  points.map(([x, y]) => `${x.toFixed(2)},${y.toFixed(2)}`).join(" ");

/** A point so far along the direction from a to b, and so far to its left on the screen. */
function beside(from: Point, a: Point, b: Point, along: number, left: number): Point {
  const size = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const [x, y] = [(b[0] - a[0]) / size, (b[1] - a[1]) / size];
  return [from[0] + along * x + left * y, from[1] + along * y - left * x];
}

/** The lines of a part at the places of its joints (px). */
function linesOf(kind: Part["kind"], at: Point[]): Point[][] {
  const [a, b, c] = at;
  switch (kind) {
    case "link":
      return at.length > 2 ? [at, [a, b]] : [[a, b]];
    case "axis":
      return [[a, b]];
    case "gear": {
      const [x, y] = [b[0] - a[0], b[1] - a[1]];
      const rim = Array.from({ length: 73 }, (_, i): Point => {
        const [c, s] = [Math.cos((i * Math.PI) / 36), Math.sin((i * Math.PI) / 36)];
        return [a[0] + c * x - s * y, a[1] + s * x + c * y];
      });
      return [[a, ...rim]];
    }
    case "pivot": {
      const on = (right: number, down: number): Point => [a[0] + right, a[1] + down];
      return [[a, on(-11, 18), on(-17, 18), on(17, 18), on(11, 18), a]];
    }
    case "guide": {
      const size = Math.hypot(b[0] - a[0], b[1] - a[1]);
      return [[-1.4, 1.4].map((share) => beside(a, a, b, share * size, -13))];
    }
    case "slider":
      return [[-19, 19, 19, -19].map((along, n) => beside(a, b, c, along, n < 2 ? -12 : 12))];
    default: {
      // from the block to a wall beyond the end of the guide
      const start = beside(a, b, c, 19, kind === "spring" ? 6 : -6);
      const size = Math.hypot(c[0] - start[0], c[1] - start[1]);
      const on = (along: number, left: number): Point => beside(start, b, c, along * size, left);
      if (kind === "spring") {
        const turns = Array.from({ length: 13 }, (_, i) => on(0.1 + (0.8 * i) / 12, i % 2 ? 5 : -5));
        return [[on(0, 0), on(0.1, 0), ...turns, on(0.9, 0), on(1, 0)]];
      }
      return [
        [on(0, 0), on(0.5, 0), on(0.5, 5), on(0.5, -5)],
        [on(0.4, 6), on(0.7, 6), on(0.7, 0), on(1, 0), on(0.7, 0), on(0.7, -6), on(0.4, -6)],
      ];
    }
  }
}

interface Shape {
  part: Part;
  group: SVGGElement;
  drawn: SVGElement[];
}

/** A line, a circle or a letter of the drawing, as it is seen (m). */
export interface Drawn {
  layer: string;
  points: Point[];
  closed?: boolean;
  /** Of a circle about its point. */
  radius?: number;
  /** Of a letter that begins or ends at its point, with its height. */
  text?: string;
  height?: number;
  ends?: boolean;
}

export class Picture {
  readonly view: View;
  onDrag: (joint: number, target: Point, done: boolean) => void = () => {};
  onGrab: () => void = () => {};
  private mechanism!: Mechanism;
  private shapes: Shape[] = [];
  private handles: SVGGElement[] = [];
  private paths: SVGPolylineElement[] = [];
  private row: Float64Array = new Float64Array();
  /** The joint that is dragged, and how far it is from where it was taken (m). */
  private held = -1;
  private grip: Point = [0, 0];

  /** What is `behind` every mechanism stays there, and what is `above` it. */
  constructor(
    private readonly svg: SVGSVGElement,
    private readonly behind: SVGGElement,
    private readonly above: SVGGElement,
  ) {
    this.view = new View(svg);
    this.view.free = () => this.held < 0;
    // a finger on a free place scrolls the page; what it takes hold of it moves, and two enlarge
    svg.addEventListener(
      "touchstart",
      (event) => {
        const taken = (event.target as Element).closest('[role="button"], #behind, .drawing');
        if (event.cancelable && (taken || event.touches.length > 1)) event.preventDefault();
      },
      { passive: false },
    );
  }

  /** Draw another mechanism. */
  show(mechanism: Mechanism): void {
    this.mechanism = mechanism;
    this.view.show(mechanism.picture.planar);
    this.svg.replaceChildren(this.behind);
    const { parts, joints, paths } = mechanism.picture;
    this.shapes = [];
    const low = element("g", this.svg);
    this.paths = paths.map((_, n) => element("polyline", this.svg, { class: `path path${n}` }));
    let links = parts.filter((part) => part.kind === "link").length;
    for (const part of parts) {
      const under = ["link", "slider"].includes(part.kind) ? this.svg : low;
      const kind = part.kind === "link" ? `link link${--links % 3}` : part.kind;
      const group = element("g", under, { class: kind });
      element("title", group).textContent = part.text;
      const drawn: SVGElement[] = [];
      if (part.kind === "link" && part.joints.length > 2) drawn.push(element("polygon", group));
      drawn.push(element(part.kind === "slider" ? "polygon" : "polyline", group));
      if (part.kind === "damper") drawn.push(element("polyline", group));
      this.shapes.push({ part, group, drawn });
    }
    this.handles = joints.map((joint, number) => this.handle(joint, number));
    this.svg.append(this.above);
  }

  /** Choose the scale so that all these rows are seen. */
  fit(rows: Float64Array): void {
    const length = rowLength(this.mechanism);
    const seen: Point[] = [];
    for (let start = 0; start < rows.length; start += length)
      this.handles.forEach((_, joint) => seen.push(this.seen(rows, start, joint)));
    this.view.fit(...cornersOf(seen));
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
    if (!this.view.planar && this.handles.length > 0) this.stack(row);
    const places = this.handles.map((_, joint) => this.place(row, 0, joint));
    for (const { part, drawn } of this.shapes) {
      const visible = part.where < 0 || has(part.where);
      for (const one of drawn) one.style.display = visible ? "" : "none";
      const at = part.joints.map((joint) => places[joint]);
      if (visible) linesOf(part.kind, at).forEach((line, n) => put(drawn[n], { points: written(line) }));
    }
    this.handles.forEach((handle, joint) => {
      const [x, y] = places[joint];
      put(handle, { transform: `translate(${x.toFixed(2)} ${y.toFixed(2)})` });
    });
  }

  /** All lines, circles and letters that are seen, each on a layer of its part's name. */
  drawn(): Drawn[] {
    const found: Drawn[] = [];
    const point = ({ x, y }: { x: number; y: number }): Point => this.view.back([x, y]);
    const lines = (one: SVGElement, layer: string): void => {
      if (one.style.display === "none") return;
      const { points } = one as SVGPolylineElement;
      found.push({ layer, points: Array.from(points, point), closed: one.tagName === "polygon" });
    };
    for (const path of this.paths) lines(path, "path");
    for (const { part, drawn } of this.shapes) for (const one of drawn) lines(one, part.text);
    this.handles.forEach((handle, number) => {
      const at = this.seen(this.row, 0, number);
      const pin = handle.querySelector<SVGCircleElement>(".pin");
      if (!pin) return;
      const radius = pin.r.baseVal.value / this.view.scale;
      found.push({ layer: "joints", points: [at], radius });
      const [x, y] = LETTERS[number % LETTERS.length];
      const beside: Point = [at[0] + x / this.view.scale, at[1] - y / this.view.scale];
      const text = this.mechanism.picture.joints[number].name;
      found.push({ layer: "letters", points: [beside], text, height: 10 / this.view.scale, ends: x < 0 });
    });
    return found;
  }

  /** Width and height (px). */
  get size(): Point {
    const { width, height } = this.svg.getBoundingClientRect();
    return [width, height];
  }

  /** The picture as a file of its own, without what is behind it. */
  svgText(): string {
    const copy = this.svg.cloneNode(true) as SVGSVGElement;
    const [width, height] = this.size;
    put(copy, { xmlns: SPACE, width, height });
    for (const name of ["behind", "markers"]) copy.querySelector(`#${name}`)?.remove();
    const originals = this.svg.querySelectorAll<SVGElement>(KEPT);
    copy.querySelectorAll<SVGElement>(KEPT).forEach((one, n) => {
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

  private seen(rows: Float64Array, start: number, joint: number): Point {
    const at = start + jointPlace(this.mechanism, joint);
    return this.view.seen(rows[at], rows[at + 1], rows[at + 2]);
  }

  private place(rows: Float64Array, start: number, joint: number): Point {
    return this.view.place(this.seen(rows, start, joint));
  }

  /** Of a spatial mechanism, what is nearer covers what is behind it. */
  private stack(row: Float64Array): void {
    const near = ({ part }: Shape): number => {
      const all = part.joints.map((joint) => {
        const at = jointPlace(this.mechanism, joint);
        return this.view.nearness(row[at], row[at + 1], row[at + 2]);
      });
      return all.reduce((sum, one) => sum + one, 0) / all.length;
    };
    const order = this.shapes.map((shape): [number, SVGGElement] => [near(shape), shape.group]);
    order.sort((a, b) => a[0] - b[0]);
    let next: Element = this.handles[0];
    for (const [, group] of order.reverse()) {
      if (group.nextElementSibling !== next) this.svg.insertBefore(group, next);
      next = group;
    }
  }

  private handle({ name, text, moves, aid }: Joint, number: number): SVGGElement {
    const free = moves.length > 0;
    const handle = element("g", this.svg, { class: free ? "joint" : "joint fixed", "data-joint": name });
    if (aid) return handle;
    element("title", handle).textContent = `${name}, ${text}`;
    if (free) element("circle", handle, { r: 17, class: "reach" });
    element("circle", handle, { r: free ? 6.5 : 5, class: "pin" });
    const [x, y] = LETTERS[number % LETTERS.length];
    element("text", handle, { x, y, "text-anchor": x < 0 ? "end" : "start" }).textContent = name;
    if (!free) return handle;
    const label = `${name}, ${text}: drag it, or move it with the arrow keys`;
    put(handle, { tabindex: 0, role: "button", "aria-label": label });
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
    for (const name of ["pointerup", "pointercancel"] as const) handle.addEventListener(name, release);
    handle.addEventListener("keydown", (event) => {
      const way = arrowOf(event);
      if (!way) return;
      const [x, y] = this.seen(this.row, 0, number);
      const step = (event.shiftKey ? 20 : 2) / this.view.scale;
      this.onDrag(number, [x + step * way[0], y + step * way[1]], true);
    });
    return handle;
  }

  /** Where a pointer is, as the joints are seen (m). */
  private target(event: PointerEvent): Point {
    const [x, y] = this.view.at(event);
    return [x + this.grip[0], y + this.grip[1]];
  }
}
