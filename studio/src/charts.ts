/** Curves over a turn of the crank, or over time. */

import uPlot from "uplot";
import uplotStyle from "uplot/dist/uPlot.min.css";
import type { Rows } from "./core";
import { type Chart as Table, type Mechanism, outputAt, rowLength, type Source } from "./tables";

const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
/** Colours alone do not tell the curves apart. */
const DASHES: number[][] = [[], [7, 3], [2, 3], [9, 3, 2, 3], [4, 2], [12, 4]];
const HEIGHT = 150;

interface Chart {
  plot: uPlot;
  line: HTMLElement;
  curves: { of: number[]; factor: number }[];
}

export class Charts {
  private charts: Chart[] = [];
  private axis: number[] = [];
  private kind: Source | "" = "";
  private mechanism!: Mechanism;
  private wanted: (chart: Table) => boolean = () => true;

  constructor(private readonly place: HTMLElement) {
    const style = document.createElement("style");
    style.textContent = uplotStyle;
    document.head.append(style);
    new ResizeObserver(() => {
      for (const { plot } of this.charts) plot.setSize({ width: this.width(), height: HEIGHT });
    }).observe(place);
  }

  private width(): number {
    return Math.max(220, this.place.clientWidth - 16);
  }

  /** Make those charts of a mechanism anew that are wanted; colours of text and grid are those of the page. */
  show(mechanism: Mechanism, source: Source, wanted = this.wanted): void {
    this.mechanism = mechanism;
    this.wanted = wanted;
    this.kind = source;
    for (const { plot } of this.charts) plot.destroy();
    this.place.replaceChildren();
    const colours = getComputedStyle(document.body);
    const stroke = colours.getPropertyValue("--text");
    const grid = { stroke: colours.getPropertyValue("--line"), width: 1 };
    this.charts = mechanism.charts.filter(wanted).map(({ title, unit, factor, curves }) => {
      const box = document.createElement("figure");
      const caption = document.createElement("figcaption");
      caption.textContent = `${title} [${unit}]`;
      box.setAttribute("aria-label", `${title} in ${unit}: ${curves.map((curve) => curve.name).join(", ")}`);
      box.append(caption);
      this.place.append(box);
      const plot = new uPlot(
        {
          width: this.width(),
          height: HEIGHT,
          legend: { show: curves.length > 1, live: false },
          cursor: { drag: { x: true, y: false } },
          scales: { x: { time: false } },
          axes: [
            { stroke, grid, ticks: grid, size: 28, values: (_, ticks) => ticks.map(String) },
            { stroke, grid, ticks: grid, size: 58 },
          ],
          series: [
            { label: source === "steady" ? "crank angle [deg]" : "time [s]" },
            ...curves.map((curve, n) => ({
              label: curve.name,
              stroke: COLOURS[n % COLOURS.length],
              dash: DASHES[n % DASHES.length],
              width: 1.5,
              points: { show: false },
            })),
          ],
        },
        [[], ...curves.map(() => [])],
        box,
      );
      const line = document.createElement("div");
      line.className = "now";
      plot.over.append(line);
      return { plot, line, curves: curves.map(({ of }) => ({ of, factor })) };
    });
  }

  /** Put the curves of other rows; `axis` in deg or s. */
  data(rows: Rows, source: Source): void {
    if (source !== this.kind) this.show(this.mechanism, source);
    const m = this.mechanism;
    const length = rowLength(m);
    const crank = source === "steady" && m.crank >= 0 ? outputAt(m, m.freedoms[m.crank].coordinate) : -1;
    const value = (row: number, of: number[]): number => {
      const parts = of.map((output) => rows.values[row * length + outputAt(m, output)]);
      return parts.length === 1 ? parts[0] : Math.hypot(...parts);
    };
    const numbers = Array.from({ length: rows.count }, (_, row) => row);
    this.axis = numbers.map((row) =>
      crank < 0 ? rows.values[row * length] : (rows.values[row * length + crank] * 180) / Math.PI,
    );
    for (const { plot, curves } of this.charts)
      plot.setData([
        this.axis,
        ...curves.map(({ of, factor }) => numbers.map((row) => value(row, of) * factor)),
      ]);
  }

  /** Mark the instant that is drawn. */
  mark(row: number): void {
    for (const { plot, line } of this.charts)
      line.style.transform = `translateX(${plot.valToPos(this.axis[row] ?? 0, "x")}px)`;
  }
}
