/** Buttons, lists and keys about the mechanism: what they do is told by who makes them. */

import { make } from "./elements";
import type { Playback } from "./playback";
import { type Source, type State, type Tables, givenValue } from "./tables";
import { digits, multiplierInWords, verdictInWords } from "./words";
import type { Answer } from "./worker";

const RATES = [1, 1 / 2, 1 / 5, 1 / 10, 1 / 20, 1 / 50, 1 / 100];
/** Views by their keys. */
const LOOKS: Record<string, string> = {
  "-": "smaller",
  "+": "larger",
  "0": "all",
  "1": "front",
  "2": "top",
  "3": "side",
  "4": "isometric",
};

export const by = <T extends Element>(id: string): T => document.getElementById(id) as unknown as T;

export interface Actions {
  undo: () => void;
  redo: () => void;
  assembly: () => void;
  theme: () => void;
  play: () => void;
  /** One of the views, by its name. */
  look: (name: string) => void;
  /** So many rows on, or back. */
  step: (rows: number) => void;
  go: (row: number) => void;
  choose: (source: Source) => void;
  save: (form: string) => void;
  /** A published set. */
  take: (state: State) => void;
}

const BUTTONS = ["undo", "redo", "assembly", "theme", "play"] as const;

export class Controls {
  private readonly rate = by<HTMLSelectElement>("rate");
  private readonly sets = by<HTMLSelectElement>("set");
  private readonly source = by<HTMLSelectElement>("source");

  constructor(
    private readonly tables: Tables,
    private readonly actions: Actions,
  ) {
    for (const value of RATES) this.rate.add(new Option(value === 1 ? "1" : `1/${1 / value}`, String(value)));
    this.rate.value = String(1 / 10);
    this.listSets();
    for (const id of BUTTONS) by(id).addEventListener("click", () => actions[id]());
    for (const button of document.querySelectorAll<HTMLElement>("[data-look]"))
      button.addEventListener("click", () => actions.look(button.dataset.look!));
    const choice = by<HTMLSelectElement>("save");
    choice.addEventListener("change", () => {
      actions.save(choice.value);
      choice.value = "";
    });
    by("scrub").addEventListener("input", () => actions.go(Number(by<HTMLInputElement>("scrub").value)));
    this.source.addEventListener("change", () => actions.choose(this.source.value as Source));
    addEventListener("keydown", (event) => this.key(event));
  }

  /** Share of the true speed. */
  get speed(): number {
    return Number(this.rate.value);
  }

  private listSets(): void {
    this.sets.add(new Option("values of its own", ""));
    for (const m of this.tables.mechanisms)
      for (const { name, source } of m.sets) {
        const text = `${m.title}: ${name}`;
        this.sets.add(make("option", { text, value: `${m.name}/${name}`, title: source }));
      }
    this.sets.addEventListener("change", () => {
      const [mechanism, name] = this.sets.value.split("/");
      const set = this.tables.mechanisms.find((m) => m.name === mechanism)?.sets.find((s) => s.name === name);
      if (set) this.actions.take({ mechanism, title: set.source, values: { ...set.values } });
    });
  }

  /** What a state is called, and the published set that it is, if it is one. */
  name({ mechanism, title, values }: State): void {
    by("title").textContent = title;
    const { given, sets } = this.tables.mechanisms.find((m) => m.name === mechanism)!;
    const set = sets.find((known) =>
      given.every((g) => givenValue(g, known.values) === givenValue(g, values)),
    );
    this.sets.value = set ? `${mechanism}/${set.name}` : "";
  }

  /** Which motion is shown, of which one that is not there cannot be chosen, and whether the periodic one is stable. */
  motion({ orbit, source, milliseconds }: Answer): void {
    const [steady] = this.source.options;
    steady.disabled = !orbit.found;
    steady.text = orbit.found ? "periodic" : "periodic (none found)";
    this.source.value = source;
    const verdict = orbit.found ? verdictInWords(orbit, this.tables.tolerance) : "none found";
    const place = by<HTMLElement>("floquet");
    const className = verdict === "unstable" || !orbit.found ? "unstable" : "";
    place.replaceChildren("Periodic motion: ", make("b", { textContent: verdict, className }));
    if (orbit.size > 0)
      place.append(`; Floquet multipliers ${orbit.multipliers.map(multiplierInWords).join(", ")}`);
    place.title = `computed in ${digits(milliseconds, 2)} ms`;
    place.dataset.multipliers = JSON.stringify(orbit.multipliers);
  }

  show({ moving, row, count }: Playback): void {
    by("play").textContent = moving ? "Pause" : "Move";
    const scrub = by<HTMLInputElement>("scrub");
    scrub.max = String(Math.max(0, count - 1));
    scrub.value = String(row);
  }

  private key(event: KeyboardEvent): void {
    const { actions } = this;
    const target = event.target as Element;
    const control = event.ctrlKey || event.metaKey;
    const key = event.key.toLowerCase();
    let action: (() => void) | undefined;
    if (control && key === "z") action = event.shiftKey ? actions.redo : actions.undo;
    else if (control && key === "y") action = actions.redo;
    else if (!target.matches?.("input, select, textarea") && !control && !event.altKey)
      action = {
        " ": target.matches?.("button, summary, a") ? undefined : actions.play,
        a: actions.assembly,
        l: actions.theme,
        ",": () => actions.step(-1),
        ".": () => actions.step(1),
        ...Object.fromEntries(Object.entries(LOOKS).map(([name, look]) => [name, () => actions.look(look)])),
      }[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }
}
