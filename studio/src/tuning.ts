/** The form of a range of speeds in which something must not lie. */

import { line, make, number, part, tick, Wrong } from "./elements";
import { type Given, type Mechanism, type State, givenValue } from "./tables";
import { called } from "./words";

const RPM = 30 / Math.PI;
/** What may change. */
const SECTIONS = ["Dimensions", "Spring, damper, friction", "Masses"];

export interface TuningForm {
  mechanism: Mechanism;
  state: () => State;
  /** A button that begins a job. */
  begin: (text: string, kind: string, wanted: () => object) => HTMLButtonElement;
}

export function tuningPart({ mechanism, state, begin }: TuningForm, first: State): HTMLElement {
  const value = (given: Given, of = state()): number => givenValue(given, of.values);
  const speed = mechanism.given.find((given) => given.unit === "rpm" && given.argument !== undefined);
  const now = speed ? Math.abs(value(speed, first)) * RPM : 0;
  const [from, low, lowest] = number("speeds from", "rpm", Number((0.95 * now).toFixed(1)) || "");
  const [to, high, highest] = number("to", "rpm", Number((1.05 * now).toFixed(1)) || "");
  const [share, percent] = number("each by at most", "%", 10);
  const wishes = { no_resonance: "no resonance", no_jump: "no jump", no_unstable: "no unstable motion" };
  const ticks = Object.entries(wishes).map(([name, text], n) => ({ name, box: tick(text, n === 0) }));
  const may = mechanism.given
    .filter((given) => SECTIONS.includes(given.section) && !given.choices)
    .map((given) => ({ given, box: tick(called(given), given.role === "stiffness") }));
  const wanted = (): object => {
    const range = [low(), high()];
    if (!(range[0] < range[1]))
      throw new Wrong(
        `The speeds are from ${lowest.value} to ${highest.value} rpm: the first must be the lower`,
        lowest,
      );
    if (!ticks.some(({ box }) => box[1].checked))
      throw new Wrong("Nothing is ticked that must not lie in the range: tick at least one", ticks[0].box[1]);
    const change = may.filter(({ box }) => box[1].checked);
    if (change.length === 0)
      throw new Wrong("Tick at least one dimension, spring or mass that may change", may[0]?.box[1]);
    const none = change.find(({ given }) => value(given) === 0);
    if (none)
      throw new Wrong(
        `The ${called(none.given)} is 0, and a share of it is 0 too: give it another value first, or take its tick away`,
        none.box[1],
      );
    return {
      speeds: range.map((rpm) => rpm / RPM),
      share: percent() / 100,
      change: change.map(({ given }) => given.name),
      ...Object.fromEntries(ticks.map(({ name, box }) => [name, box[1].checked])),
    };
  };
  return part(
    "A range of speeds without resonance",
    line(from, to, ...ticks.map(({ box }) => box[0])),
    make("fieldset", {}, make("legend", { textContent: "What may change" }), ...may.map(({ box }) => box[0])),
    line(begin("Change least", "tune", wanted), share),
  );
}
