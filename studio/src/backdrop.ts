/** A photo or a drawing behind the mechanism: it never leaves the machine, only where it lies is kept. */

import { readLines } from "./dxf";
import { button, make } from "./elements";
import { element } from "./picture";
import type { Placement } from "./tables";
import { arrowOf, cornersOf, type Point, type View } from "./view";
import { digits } from "./words";

interface Field {
  key: keyof Placement;
  label: string;
  unit: string;
  factor: number;
  step: number;
}

const FIELDS: Field[] = [
  { key: "x", label: "middle, to the right", unit: "mm", factor: 1e3, step: 1 },
  { key: "y", label: "middle, upwards", unit: "mm", factor: 1e3, step: 1 },
  { key: "width", label: "width", unit: "mm", factor: 1e3, step: 1 },
  { key: "angle", label: "turned", unit: "deg", factor: 180 / Math.PI, step: 1 },
];

export interface BackdropListener {
  /** The picture lies elsewhere; `done` when that is to be undone as one step. */
  change(placement: Placement, done: boolean): void;
  fault(sentence: string): void;
}

export class Backdrop {
  private placement: Placement | undefined;
  /** Height over width of what is shown; 0 where there is nothing. */
  private ratio = 0;
  private address = "";
  /** The two points whose distance is known (m). */
  private points: [Point, Point] = [
    [0, 0],
    [0, 0],
  ];
  private readonly inside = make("div");
  private readonly box = make(
    "details",
    {},
    make("summary", { textContent: "Photo or drawing behind" }),
    this.inside,
  );
  private readonly fields = new Map<string, HTMLInputElement>();
  private readonly marks: SVGGElement[] = [];
  private readonly line: SVGPolylineElement;

  constructor(
    private readonly place: HTMLElement,
    private readonly group: SVGGElement,
    private readonly markers: SVGGElement,
    private readonly view: View,
    private readonly listener: BackdropListener,
  ) {
    this.line = element("polyline", markers);
    for (const number of [0, 1]) this.marks.push(this.mark(number));
    this.form();
    this.dragged(group, (by, done) => {
      if (!this.placement) return;
      const { x, y } = this.placement;
      this.put({ ...this.placement, x: x + by[0], y: y + by[1] }, done);
    });
    this.draw();
  }

  /** Show a file: a photo, an SVG as a picture that runs nothing, or the lines of a DXF. */
  async load(file: File): Promise<void> {
    this.listener.fault("");
    try {
      if (/\.dxf$/i.test(file.name)) this.lines(await file.text());
      else if (file.type.startsWith("image/")) await this.photo(file);
      else throw new Error("is no PNG, JPEG, SVG or DXF");
      this.box.open = true;
      this.draw();
    } catch (error) {
      this.listener.fault(`${file.name}: ${error instanceof Error ? error.message : "cannot be read"}`);
    }
  }

  /** It lies as a state says. */
  show(placement: Placement | undefined): void {
    this.placement = placement;
    this.draw();
  }

  /** Draw it where it lies in the view. */
  draw(): void {
    const now = this.placement;
    const shown = this.ratio > 0 && now !== undefined;
    this.place.classList.toggle("empty", !shown);
    const measuring = shown && !now.locked;
    this.group.style.display = shown ? "" : "none";
    this.markers.style.display = measuring ? "" : "none";
    if (!shown) return;
    const [x, y] = this.view.place([now.x, now.y]);
    const size = now.width * this.view.scale;
    const turned = (-now.angle * 180) / Math.PI;
    this.group.setAttribute("transform", `translate(${x} ${y}) rotate(${turned}) scale(${size})`);
    this.group.setAttribute("opacity", String(now.opacity));
    this.group.classList.toggle("locked", now.locked);
    const ends = this.points.map((point) => this.view.place(point));
    this.line.setAttribute("points", ends.map((end) => end.join()).join(" "));
    this.marks.forEach((mark, n) => mark.setAttribute("transform", `translate(${ends[n].join(" ")})`));
    for (const { key, factor } of FIELDS) this.write(key, (now[key] as number) * factor);
    this.write("distance", this.distance() * 1e3);
    this.fields.get("opacity")!.value = String(now.opacity);
    this.fields.get("locked")!.checked = now.locked;
  }

  private write(key: string, value: number): void {
    const field = this.fields.get(key)!;
    if (document.activeElement !== field) field.value = digits(value, 6);
  }

  private put(placement: Placement, done: boolean): void {
    this.placement = placement;
    this.draw();
    this.listener.change(placement, done);
  }

  private async photo(file: File): Promise<void> {
    const address = URL.createObjectURL(file);
    const image = new Image();
    image.src = address;
    try {
      await image.decode();
    } catch {
      URL.revokeObjectURL(address);
      throw new Error("is no picture that this browser reads");
    }
    this.clear();
    this.address = address;
    this.ratio = image.naturalHeight / image.naturalWidth || 1;
    element("image", this.group, { ...this.frame, href: address, preserveAspectRatio: "none" });
    this.begin(this.view.centre, Math.min(this.view.extent[0], this.view.extent[1] / this.ratio));
  }

  private lines(text: string): void {
    const { paths, left } = readLines(text);
    const [low, high] = cornersOf(paths.flat());
    const width = high[0] - low[0] || high[1] - low[1];
    if (!(width > 0)) throw new Error("all its lines are at one point");
    this.clear();
    const middle: Point = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.ratio = (high[1] - low[1]) / width || 1e-3;
    const drawn = paths.map((path) =>
      path.map(([x, y]) => `${(x - middle[0]) / width} ${(middle[1] - y) / width}`).join("L"),
    );
    element("rect", this.group, this.frame);
    const d = drawn.map((one) => `M${one}`).join("");
    element("path", this.group, { d, "vector-effect": "non-scaling-stroke" });
    // a drawing says itself how large it is, and where it lies
    this.begin(middle, width);
    const kinds = Object.entries(left).map(([kind, count]) => `${count} ${kind}`);
    if (kinds.length > 0) this.listener.fault(`left out of the drawing: ${kinds.join(", ")}`);
  }

  /** What is shown, of a width of 1 about the origin. */
  private get frame(): Record<string, number> {
    return { x: -0.5, y: -this.ratio / 2, width: 1, height: this.ratio };
  }

  private clear(): void {
    if (this.address) URL.revokeObjectURL(this.address);
    this.address = "";
    this.group.replaceChildren();
  }

  /** Where it lies at first; where a link or an undone step has said so, there. */
  private begin([x, y]: Point, width: number): void {
    const now = this.placement ?? { x, y, width, angle: 0, opacity: 0.5, locked: false };
    const reach = now.width / 4;
    this.points = [
      [now.x - reach, now.y],
      [now.x + reach, now.y],
    ];
    this.put(now, true);
  }

  private distance(): number {
    const [a, b] = this.points;
    return Math.hypot(b[0] - a[0], b[1] - a[1]);
  }

  /** The picture larger or smaller about the first point, so that the two points are so far apart. */
  private rescale(distance: number): void {
    const factor = distance / this.distance();
    const now = this.placement;
    if (!now || !(factor > 0 && Number.isFinite(factor))) return;
    const [a, b] = this.points;
    const from = ([x, y]: Point): Point => [a[0] + factor * (x - a[0]), a[1] + factor * (y - a[1])];
    this.points = [a, from(b)];
    const [x, y] = from([now.x, now.y]);
    this.put({ ...now, x, y, width: now.width * factor }, true);
  }

  /** One of the two points, to be dragged or moved by the arrow keys. */
  private mark(number: number): SVGGElement {
    const name = `point ${number + 1} of a known distance`;
    const label = `${name}: drag it, or move it with the arrow keys`;
    const mark = element("g", this.markers, { tabindex: 0, role: "button", "aria-label": label });
    element("title", mark).textContent = name;
    element("circle", mark, { r: 12 });
    element("polyline", mark, { points: "-12,0 12,0" });
    element("polyline", mark, { points: "0,-12 0,12" });
    const move = (by: Point): void => {
      const [x, y] = this.points[number];
      this.points[number] = [x + by[0], y + by[1]];
      this.draw();
    };
    this.dragged(mark, move);
    mark.addEventListener("keydown", (event) => {
      const way = arrowOf(event);
      if (!way) return;
      const step = (event.shiftKey ? 20 : 1) / this.view.scale;
      move([way[0] * step, way[1] * step]);
    });
    return mark;
  }

  /** Call with how far a pointer goes (m) that takes an element. */
  private dragged(taken: SVGElement, move: (by: Point, done: boolean) => void): void {
    let last: Point | undefined;
    taken.addEventListener("pointerdown", (event) => {
      if (taken === this.group && this.placement?.locked) return;
      event.stopPropagation();
      event.preventDefault();
      taken.setPointerCapture(event.pointerId);
      last = this.view.at(event);
    });
    const go = (event: PointerEvent, done: boolean): void => {
      if (!last) return;
      const now = this.view.at(event);
      const by: Point = [now[0] - last[0], now[1] - last[1]];
      last = done ? undefined : now;
      move(by, done);
    };
    taken.addEventListener("pointermove", (event) => go(event, false));
    for (const name of ["pointerup", "pointercancel"] as const)
      taken.addEventListener(name, (event) => go(event, true));
  }

  // Its fields

  private input(type: string, key: string, label: string, unit = ""): HTMLInputElement {
    const field = make("input", { type });
    this.fields.set(key, field);
    const className = key === "file" ? "" : "placed";
    this.inside.append(make("label", { className }, `${label} `, field, unit));
    return field;
  }

  private form(): void {
    this.place.append(this.box);
    const file = this.input(
      "file",
      "file",
      "PNG, JPEG, SVG or DXF, also dropped on the page; it stays on this machine",
    );
    file.accept = "image/*,.dxf";
    file.addEventListener("change", () => {
      const chosen = file.files?.[0];
      file.value = "";
      if (chosen) void this.load(chosen);
    });
    for (const { key, label, unit, factor, step } of FIELDS) {
      const field = this.input("number", key, label, unit);
      field.step = String(step);
      field.addEventListener("change", () => {
        const value = field.valueAsNumber / factor;
        if (this.placement && Number.isFinite(value) && (key !== "width" || value > 0))
          this.put({ ...this.placement, [key]: value }, true);
      });
    }
    const distance = this.input("number", "distance", "distance of the two points", "mm");
    distance.step = "any";
    distance.min = "0";
    distance.addEventListener("change", () => this.rescale(distance.valueAsNumber / 1e3));
    const opacity = this.input("range", "opacity", "opacity");
    Object.assign(opacity, { min: "0", max: "1", step: "0.05" });
    for (const name of ["input", "change"])
      opacity.addEventListener(name, () => {
        if (this.placement)
          this.put({ ...this.placement, opacity: opacity.valueAsNumber }, name === "change");
      });
    const locked = this.input("checkbox", "locked", "locked");
    locked.addEventListener("change", () => {
      if (this.placement) this.put({ ...this.placement, locked: locked.checked }, true);
    });
    const away = button("Take it away", () => {
      this.clear();
      this.ratio = 0;
      this.draw();
    });
    away.className = "placed";
    this.inside.append(away);
    addEventListener("dragover", (event) => {
      if (event.dataTransfer?.types.includes("Files")) event.preventDefault();
    });
    addEventListener("drop", (event) => {
      const dropped = event.dataTransfer?.files[0];
      if (!dropped) return;
      event.preventDefault();
      void this.load(dropped);
    });
  }
}
