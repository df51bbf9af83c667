/** The form of a path: drawn, taken from the mechanism or written, and what is wanted of it. */

import type { Rows } from "./core";
import { button, type Child, line, make, number, part, tick, Wrong } from "./elements";
import { pointsOf, textOf } from "./points";
import { resampled, type Sketch } from "./sketch";
import { jointAt, type Mechanism, outputAt, rowLength } from "./tables";
import type { Point } from "./view";

/** Points of a path that is taken from the mechanism. */
const POINTS = 72;
/** Of a path, at least. */
const LEAST = 3;

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

export function pathPart(form: PathForm): HTMLElement {
  const { mechanism, sketch } = form;
  const svg = document.getElementById("picture")!;
  const draw = button("Draw a path on the picture", () => sketch.listen(!sketch.listening));
  draw.setAttribute("aria-pressed", "false");
  const [closed, isClosed] = tick("closed", true);
  const points = make("textarea", { rows: 6, spellcheck: false });
  points.placeholder = "x and y of a point in mm, a line each";
  points.setAttribute("aria-label", "Points of the path: x and y in mm, a line each");
  sketch.onDrawing = (drawing) => {
    draw.setAttribute("aria-pressed", String(drawing));
    svg.classList.toggle("drawing", drawing);
  };
  /** What is wrong with the points as they are written, which the path on the picture is not. */
  let wrong: Wrong | undefined;
  sketch.onChange = () => {
    isClosed.checked = sketch.closed;
    points.value = textOf(sketch.points);
    if (wrong) form.wrong((wrong = undefined));
  };
  isClosed.addEventListener("change", () => sketch.put(sketch.points, isClosed.checked));
  points.addEventListener("change", () => {
    wrong = undefined;
    try {
      sketch.put(pointsOf(points.value), isClosed.checked);
    } catch (error) {
      wrong = new Wrong((error as Error).message, points);
    }
    form.wrong(wrong);
  });
  const target = (): object => {
    if (wrong) throw wrong;
    const { closed } = sketch;
    const ends = [sketch.points[0], sketch.points[sketch.points.length - 1]];
    // a closed path that was written with its first point again at the end
    const again = closed && sketch.points.length > LEAST && ends[0].join() === ends[1].join();
    const all = again ? sketch.points.slice(0, -1) : sketch.points;
    const count = all.length;
    if (count === 0)
      throw new Wrong("Draw a path first, or take that of the mechanism: there is none yet", draw);
    if (count < LEAST)
      throw new Wrong(
        `The path has ${count} point${count === 1 ? "" : "s"}: it needs at least ${LEAST}`,
        points,
      );
    const same = all.findIndex((point, n) => n > 0 && point.join() === all[n - 1].join());
    if (same > 0)
      throw new Wrong(`Points ${same} and ${same + 1} of the path are the same: take one away`, points);
    return { points: all, closed };
  };
  const [angle, leastAngle] = number("transmission angle at least", "deg", 40, { least: 0, below: 90 });
  const [longest, longestLink] = number("longest link", "mm", "", { above: 0, missing: Infinity });
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
  const moves = mechanism.given.some((given) => given.name === "initial.slider_position");
  const take = button("Take the path of the mechanism", () => {
    const found = ownPath(mechanism, form.rows());
    if (found) sketch.put(found, true);
  });
  const rows: Child[] = [
    line(draw, take, closed),
    make("details", {}, make("summary", { textContent: "Its points" }), points),
    line(linkages, ...kinds.map(({ box }) => box[0])),
    line(angle, longest),
  ];
  return part("A path", ...rows, ...(moves ? [line(slider, harmonics, stroke)] : []));
}

/** The path of the mechanism's own point, to be changed by its points. */
function ownPath(m: Mechanism, rows: Rows | undefined): Point[] | undefined {
  const joint = m.picture.paths[0];
  if (!rows || rows.count < 4 || joint === undefined) return undefined;
  const length = rowLength(m);
  const { crank, freedoms } = m;
  const turned = (n: number): number =>
    crank < 0 ? 0 : rows.values[n * length + outputAt(m, freedoms[crank].coordinate)];
  const all: Point[] = [];
  // a turn of the crank, without its end
  for (let n = 0; n < rows.count; n++) {
    if (crank >= 0 && Math.abs(turned(n) - turned(0)) >= freedoms[crank].period * (1 - 1e-6)) break;
    const at = n * length + jointAt(m, joint);
    all.push([rows.values[at], rows.values[at + 1]]);
  }
  return resampled(all, true, POINTS);
}
