/** From where the mechanism is seen and how large; what pointers, wheel and keys do about it. */

export type Point = [number, number];

/** Elevation and azimuth (rad) of the views of a spatial mechanism, its x axis upright and its z axis the crank's. */
export const VIEWS: Record<string, Point> = {
  first: [0.38, -0.55],
  front: [0, 0],
  top: [-Math.PI / 2, 0],
  side: [0, Math.PI / 2],
  isometric: [-Math.atan(Math.SQRT1_2), -Math.PI / 4],
};
/** Margin about what is seen (px), steps of a key (px, rad), and how much larger one is. */
const MARGIN = 70;
const STEP = 40;
const TURN = 0.1;
const LARGER = 1.25;

/** Directions of the arrow keys, to the right and upwards. */
const ARROWS: Record<string, Point> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

/** The direction of an arrow key, which nothing else hears of then; nothing of another key. */
export function arrowOf(event: KeyboardEvent): Point | undefined {
  const way = ARROWS[event.key];
  if (way) event.preventDefault();
  if (way) event.stopPropagation();
  return way;
}

/** The lower left and the upper right corner of what lies about points. */
export function cornersOf(points: Iterable<Point>): [Point, Point] {
  const [low, high]: [Point, Point] = [
    [Infinity, Infinity],
    [-Infinity, -Infinity],
  ];
  for (const point of points)
    for (const n of [0, 1]) {
      low[n] = Math.min(low[n], point[n]);
      high[n] = Math.max(high[n], point[n]);
    }
  return [low, high];
}

const clamp = (value: number, most: number): number => Math.max(-most, Math.min(most, value));

/** Rows of the matrix from places to what is seen, both in m, and in the third what is nearer. */
export function viewMatrix(planar: boolean, [up, round]: Point): number[] {
  if (planar) return [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const [s, c, t, d] = [Math.sin(up), Math.cos(up), Math.sin(round), Math.cos(round)];
  return [0, d, t, c, s * t, -s * d, -s, t * c, -d * c];
}

export class View {
  matrix: number[] = viewMatrix(true, [0, 0]);
  /** After a change of what is seen. */
  onChange: () => void = () => {};
  /** Whether a pointer beside the joints is the view's: not while one of them is dragged. */
  free: () => boolean = () => true;
  planar = true;
  private angles: Point = [...VIEWS.first];
  private zoom = 1;
  private shift: Point = [0, 0];
  private size: Point = [1, 1];
  private whole = 1;
  private middle: Point = [0, 0];
  private readonly pointers = new Map<number, Point>();

  constructor(private readonly svg: SVGSVGElement) {
    svg.addEventListener("pointerdown", (event) => this.press(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"] as const)
      svg.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    svg.addEventListener(
      "wheel",
      (event) => {
        // of a mouse with the control key; two fingers on a pad say the same
        if (!event.ctrlKey) return;
        event.preventDefault();
        this.enlarge(Math.exp(-clamp(event.deltaY, 100) / 200), this.at(event));
      },
      { passive: false },
    );
    svg.addEventListener("keydown", (event) => this.key(event));
  }

  /** Pixels a metre. */
  get scale(): number {
    return this.whole * this.zoom;
  }

  /** What is seen in the middle (m). */
  get centre(): Point {
    return [this.middle[0] + this.shift[0], this.middle[1] + this.shift[1]];
  }

  /** Turn, zoom and shift as numbers, to be kept in a link. */
  get kept(): number[] {
    return [...this.angles, this.zoom, ...this.shift];
  }

  /** Begin with another mechanism, or with what was kept. */
  show(planar: boolean, kept: number[] = [...VIEWS.first, 1, 0, 0]): void {
    this.planar = planar;
    this.angles = [kept[0], kept[1]];
    this.zoom = kept[2];
    this.shift = [kept[3], kept[4]];
    this.matrix = viewMatrix(planar, this.angles);
  }

  /** All that lies between two corners (m) is seen, but for what the user has changed. */
  fit(low: Point, high: Point): void {
    const { width, height } = this.svg.getBoundingClientRect();
    // what lies on one line has no extent across it
    if (!(Math.max(high[0] - low[0], high[1] - low[1]) > 0) || width === 0) return;
    const room = [Math.max(50, width - 2 * MARGIN), Math.max(50, height - 2 * MARGIN)];
    this.whole = Math.min(...room.map((size, n) => size / Math.max(high[n] - low[n], 1e-9)));
    this.middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.size = [width, height];
    this.svg.setAttribute("viewBox", `${-width / 2} ${-height / 2} ${width} ${height}`);
  }

  /** Width and height of what is seen (m). */
  get extent(): Point {
    return [this.size[0] / this.scale, this.size[1] / this.scale];
  }

  seen(x: number, y: number, z: number): Point {
    const m = this.matrix;
    return [m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z];
  }

  nearness(x: number, y: number, z: number): number {
    const m = this.matrix;
    return m[6] * x + m[7] * y + m[8] * z;
  }

  /** Where on the drawing something is that is seen (px). */
  place([x, y]: Point): Point {
    const [cx, cy] = this.centre;
    return [(x - cx) * this.scale, (cy - y) * this.scale];
  }

  /** What is seen at a place of the drawing (m). */
  back([x, y]: Point): Point {
    const [cx, cy] = this.centre;
    return [cx + x / this.scale, cy - y / this.scale];
  }

  /** What is seen under a pointer (m). */
  at(event: MouseEvent): Point {
    return this.back(this.pixel(event));
  }

  /** One of the views by name, or with `all` what fits; it is drawn by who asks for it. */
  look(name: string): void {
    if (name in VIEWS) this.angles = [...VIEWS[name]];
    if (name === "all") [this.zoom, this.shift] = [1, [0, 0]];
    this.matrix = viewMatrix(this.planar, this.angles);
  }

  /** Larger by a factor, so that one point stays where it is. */
  enlarge(factor: number, about: Point = this.centre): void {
    const share = 1 / factor;
    if (!(this.zoom * factor > 0.02 && this.zoom * factor < 200)) return;
    const [cx, cy] = this.centre;
    this.shift = [
      this.shift[0] + (about[0] - cx) * (1 - share),
      this.shift[1] + (about[1] - cy) * (1 - share),
    ];
    this.zoom *= factor;
    this.onChange();
  }

  larger(): void {
    this.enlarge(LARGER);
  }

  smaller(): void {
    this.enlarge(1 / LARGER);
  }

  private pan(right: number, down: number): void {
    this.shift = [this.shift[0] - right / this.scale, this.shift[1] + down / this.scale];
    this.onChange();
  }

  private turn(right: number, down: number): void {
    this.angles = [clamp(this.angles[0] + down, Math.PI / 2), this.angles[1] + right];
    this.matrix = viewMatrix(this.planar, this.angles);
    this.onChange();
  }

  private pixel(event: MouseEvent): Point {
    const box = this.svg.getBoundingClientRect();
    return [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
  }

  private press(event: PointerEvent): void {
    if (!this.free() || this.pointers.size > 1) return;
    this.svg.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.pixel(event));
  }

  /** One finger or the mouse turns, or moves what cannot be turned; two enlarge and move. */
  private move(event: PointerEvent): void {
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    const now = this.pixel(event);
    this.pointers.set(event.pointerId, now);
    const [right, down] = [now[0] - last[0], now[1] - last[1]];
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const before = Math.hypot(last[0] - other[0], last[1] - other[1]);
      const after = Math.hypot(now[0] - other[0], now[1] - other[1]);
      const about = this.back([(last[0] + other[0]) / 2, (last[1] + other[1]) / 2]);
      if (before > 0 && after > 0) this.enlarge(after / before, about);
      this.pan(right / 2, down / 2);
    } else if (this.planar || event.shiftKey) this.pan(right, down);
    else this.turn(right / 150, down / 150);
  }

  private key(event: KeyboardEvent): void {
    if (event.target !== this.svg) return;
    const way = arrowOf(event);
    if (!way) return;
    if (this.planar || event.shiftKey) this.pan(-STEP * way[0], STEP * way[1]);
    else this.turn(TURN * way[0], -TURN * way[1]);
  }
}
