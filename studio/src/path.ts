/** The form of a path: drawn, taken from the mechanism or written, and what is wanted of it. */

import type { Rows } from "./motions";
import { button, type Child, line, make, number, part, tick, Wrong } from "./elements";
import { readPoints, soundPath, writePoints } from "./points";
import { resampled, type Sketch } from "./sketch";
import { jointPlace, type Mechanism, outputPlace, rowLength } from "./tables";
import type { Point } from "./view";

/** Points of a path that is taken from the mechanism. */
const POINTS = 72;

export interface PathForm {
  mechanism: Mechanism;
  sketch: Sketch;
  /** Kinds of linkages that Python searches. */
  kinds: string[];
  rows: () => Rows | undefined;
  /** A button that begins a job. */
  begin: (text: string, kind: string, wanted: () => object) => HTMLButtonElement;
  /** Say what is wrong with what was just written; nothing where it is right again. */
  wrong: (found: Wrong | undefined) => void;
}

/** The path as it is drawn and written: what stands in the form, and what is wanted of Python. */
function drawing(form: PathForm): { rows: Child[]; target: () => object } {
  const { mechanism, sketch } = form;
  const svg = document.getElementById("picture")!;
  const draw = button("Draw a path on the picture", () => sketch.listen(!sketch.listening));
  draw.setAttribute("aria-pressed", "false");
  const [closed, isClosed] = tick("closed", true);
  const points = make("textarea", {
    rows: 6,
    spellcheck: false,
    placeholder: "x and y of a point in mm, a line each",
    "aria-label": "Points of the path: x and y in mm, a line each",
  });
  sketch.onDrawing = (drawing) => {
    draw.setAttribute("aria-pressed", String(drawing));
    svg.classList.toggle("drawing", drawing);
  };
  /** What is wrong with the points as they are written, which the path on the picture is not. */
  let wrong: Wrong | undefined;
  sketch.onChange = () => {
    isClosed.checked = sketch.closed;
    points.value = writePoints(sketch.points);
    if (wrong) form.wrong((wrong = undefined));
  };
  isClosed.addEventListener("change", () => sketch.put(sketch.points, isClosed.checked));
  points.addEventListener("change", () => {
    wrong = undefined;
    try {
      sketch.put(readPoints(points.value), isClosed.checked);
    } catch (error) {
      wrong = new Wrong((error as Error).message, points);
    }
    form.wrong(wrong);
  });
  const target = (): object => {
    if (wrong) throw wrong;
    const { closed } = sketch;
    return { points: soundPath(sketch.points, closed), closed };
  };
  const take = button("Take the path of the mechanism", () => {
    const found = ownPath(mechanism, form.rows());
    if (found) sketch.put(found, true);
  });
  const written = make("details", {}, make("summary", { textContent: "Its points" }), points);
  return { rows: [line(draw, take, closed), written], target };
}

export function pathPart(form: PathForm): HTMLElement {
  const { rows, target } = drawing(form);
  const [angle, leastAngle] = number("transmission angle at least", "deg", 40, { least: 0, below: 90 });
  const [longest, longestLink] = number("largest link", "mm", "", { above: 0, missing: Infinity });
  const [harmonics, count] = number("harmonics", "", 2, { least: 1, whole: true });
  const [stroke, greatest] = number("stroke at most", "mm", "", { above: 0, missing: Infinity });
  const length = (name: string, mm: number): object => (Number.isFinite(mm) ? { [name]: mm / 1e3 } : {});
  const kinds = form.kinds.map((kind, n) => ({
    kind,
    box: tick(`${kind.replace("geared-", "geared ")}s`, n === 0),
  }));
  const linkages = form.begin("Find linkages", "linkages", () => {
    const wanted = kinds.filter(({ box }) => box[1].checked).map(({ kind }) => kind);
    if (wanted.length === 0)
      throw new Wrong("No kind of linkage is ticked: tick at least one that may do it", kinds[0].box[1]);
    return {
      ...target(),
      ...length("longest", longestLink()),
      kinds: wanted,
      least_transmission: (leastAngle() * Math.PI) / 180,
    };
  });
  const slider = form.begin("Move the slider for it", "slider", () => ({
    ...target(),
    ...length("stroke", greatest()),
    harmonics: count(),
  }));
  const moves = form.mechanism.given.some((given) => given.name === "initial.slider_position");
  return part(
    "A path",
    ...rows,
    line(linkages, ...kinds.map(({ box }) => box[0])),
    line(angle, longest),
    ...(moves ? [line(slider, harmonics, stroke)] : []),
  );
}

/** The path of the mechanism's own point, to be changed by its points. */
function ownPath(m: Mechanism, rows: Rows | undefined): Point[] | undefined {
  const joint = m.picture.paths[0];
  if (!rows || rows.count < 4 || joint === undefined) return undefined;
  const length = rowLength(m);
  const { crank, freedoms } = m;
  const turned = (n: number): number =>
    crank < 0 ? 0 : rows.values[n * length + outputPlace(m, freedoms[crank].coordinate)];
  const all: Point[] = [];
  // a turn of the crank, without its end
  for (let n = 0; n < rows.count; n++) {
    if (crank >= 0 && Math.abs(turned(n) - turned(0)) >= freedoms[crank].period * (1 - 1e-6)) break;
    const at = n * length + jointPlace(m, joint);
    all.push([rows.values[at], rows.values[at + 1]]);
  }
  return resampled(all, true, POINTS);
}
