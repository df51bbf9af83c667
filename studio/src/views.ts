/** What stands beside the mechanism, one thing at a time: curves over the motion, forces, the response, stability. */

import { Charts } from "./charts";
import { make } from "./elements";
import type { Rows } from "./motions";
import { Forces } from "./forces";
import { Response } from "./response";
import type { Go } from "./search";
import type { Context } from "./varied";
import { Stability } from "./stability";
import type { Chart, Mechanism, Source } from "./tables";
import style from "./views.css";

const TABS = {
  motion: "Motion, torque",
  forces: "Joint forces",
  power: "Power, transmission",
  response: "Over speed",
  stability: "Stability chart",
} as const;

type Tab = keyof typeof TABS;

export class Views {
  readonly response: Response;
  readonly stability: Stability;
  private readonly charts: Charts;
  private readonly forces = new Forces();
  private readonly buttons = new Map<Tab, HTMLButtonElement>();
  private readonly panel = make("div", { id: "view", role: "tabpanel" });
  private tab: Tab = "motion";
  private mechanism!: Mechanism;
  private rows: Rows | undefined;
  private source: Source = "steady";
  private row = 0;

  constructor(place: HTMLElement, go: Go, tolerance: number) {
    document.head.append(make("style", { textContent: style }));
    const list = make("div", { className: "buttons", role: "tablist", "aria-label": "Charts" });
    const names = Object.keys(TABS) as Tab[];
    for (const name of names) {
      const attributes = { role: "tab", "aria-controls": "view" };
      const button = make("button", { id: `tab ${name}`, textContent: TABS[name], ...attributes });
      button.addEventListener("click", () => this.open(name));
      this.buttons.set(name, button);
      list.append(button);
    }
    list.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!way) return;
      event.preventDefault();
      this.open(names[(names.indexOf(this.tab) + way + names.length) % names.length]);
      this.buttons.get(this.tab)!.focus();
    });
    const curves = make("div", { id: "curves" });
    this.response = new Response(go, tolerance);
    this.stability = new Stability(go, tolerance);
    this.panel.append(curves, this.forces.box, this.response.box, this.stability.box);
    place.append(list, this.panel);
    this.charts = new Charts(curves);
  }

  /** Show another mechanism, or the same in other colours. */
  show(mechanism: Mechanism, source: Source, bytes?: ArrayBuffer): void {
    this.mechanism = mechanism;
    this.source = source;
    this.forces.show(mechanism);
    if (bytes) {
      this.rows = undefined;
      this.response.open(mechanism, bytes.slice(0));
      this.stability.open(mechanism, bytes.slice(0));
    }
    this.open(this.tab);
  }

  open(tab: Tab): void {
    this.tab = tab;
    for (const [name, button] of this.buttons) {
      button.setAttribute("aria-selected", String(name === tab));
      button.tabIndex = name === tab ? 0 : -1;
    }
    this.panel.setAttribute("aria-labelledby", `tab ${tab}`);
    this.forces.box.hidden = tab !== "forces";
    this.response.box.hidden = tab !== "response";
    this.stability.box.hidden = tab !== "stability";
    this.charts.show(this.mechanism, this.source, ({ kind }: Chart) => kind === tab);
    this.response.show(tab === "response");
    this.stability.show(tab === "stability");
    if (this.rows) this.data(this.rows, this.source);
  }

  /** Other rows of the motion. */
  data(rows: Rows, source: Source): void {
    this.rows = rows;
    this.source = source;
    this.charts.data(rows, source);
    if (this.tab === "forces") this.forces.data(rows);
    this.mark(this.row);
  }

  /** Another motion, and what it is of. */
  see(context: Context): void {
    this.response.see(context);
    this.stability.see(context);
  }

  /** Mark the instant that is drawn. */
  mark(row: number): void {
    this.row = row;
    this.charts.mark(row);
    if (this.tab === "forces") this.forces.mark(row);
  }
}
