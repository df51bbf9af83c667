/** What came of a job, as the page shows it: tables with small pictures, charts, files. */

import { look, makePlot } from "./charts";
import { button, line, make } from "./elements";
import { save } from "./exports";
import { element, written } from "./picture";
import type { Answer, File, Small } from "./server";
import { cornersOf, type Point } from "./view";
import { plainly } from "./words";

/** Of a small picture, in px. */
const [WIDTH, HEIGHT, EDGE] = [120, 76, 5];

export function fileButton({ name, base64 }: File): HTMLButtonElement {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  return button(`Save ${name}`, () => save(name, new Blob([bytes])));
}

/** A linkage in the plane of its path, with the path that was wanted. */
export function smallPicture({ links, curves }: Small, wanted: Point[], closed: boolean): SVGSVGElement {
  const svg = element("svg", document.createDocumentFragment(), {
    viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
    class: "small",
    "aria-hidden": "true",
  });
  const [low, high] = cornersOf([...links, ...curves, wanted].flat());
  const scale = Math.min(
    (WIDTH - 2 * EDGE) / (high[0] - low[0] || 1),
    (HEIGHT - 2 * EDGE) / (high[1] - low[1] || 1),
  );
  const place = ([x, y]: Point): Point => [
    WIDTH / 2 + scale * (x - (low[0] + high[0]) / 2),
    HEIGHT / 2 - scale * (y - (low[1] + high[1]) / 2),
  ];
  const draw = (points: Point[], name: string): void =>
    void element("polyline", svg, { class: name, points: written(points.map(place)) });
  draw(closed ? [...wanted, wanted[0]] : wanted, "wanted");
  for (const curve of curves) draw(curve, "beside");
  for (const link of links) draw(link, "bar");
  return svg;
}

/** The table of an answer; `last` is what stands at the end of a row. */
export function answerTable(answer: Answer, wanted: Point[], last?: (row: number) => Node[]): HTMLElement {
  const { headings, rows, files } = answer.table!;
  const made = make("table");
  const head = made.createTHead().insertRow();
  // under a picture there is room for buttons, which a phone shows first
  const atEnd = last && !answer.pictures;
  for (const text of headings) head.append(make("th", { textContent: text, scope: "col" }));
  if (atEnd) head.insertCell();
  const body = made.createTBody();
  rows.forEach((cells, n) => {
    const row = body.insertRow();
    for (const text of cells) row.insertCell().textContent = text;
    const picture = answer.pictures?.[n];
    if (picture) row.cells[0].append(smallPicture(picture, wanted, answer.closed ?? true));
    if (last)
      (atEnd ? row.insertCell() : row.cells[0]).append(
        line(...last(n), ...(files?.[n] ?? []).map(fileButton)),
      );
  });
  return make("div", { className: "wide" }, made);
}

/** Curves over an axis that has a name and a unit. */
export function drawCurves(
  place: HTMLElement,
  title: string,
  axis: string,
  x: number[],
  curves: { label: string; y: number[] }[],
): void {
  const box = make("figure", {}, make("figcaption", { textContent: title }));
  place.append(box);
  // the first is wide, so that it is seen under the second
  const looks = curves.map(({ label }, n) => look(label, n, n === 0 && curves.length > 1 ? 4 : 1.5));
  const plot = makePlot(box, axis, looks, { width: Math.max(220, place.clientWidth - 24) });
  plot.setData([x, ...curves.map(({ y }) => y)]);
}

/** All of an answer but for what the page does with it: words, charts, files. */
export function showAnswer(place: HTMLElement, answer: Answer, table: HTMLElement | undefined): void {
  place.replaceChildren(make("p", { textContent: plainly(answer.words) }), ...(table ? [table] : []));
  for (const { title, unit, axis, x, y } of answer.charts ?? [])
    drawCurves(place, `${title} [${unit}]`, axis, x, [{ label: title, y }]);
  if (answer.files) place.append(line(...answer.files.map(fileButton)));
}
