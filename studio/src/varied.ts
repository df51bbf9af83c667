/** What can vary of a mechanism under the values that it has, and what swings then. */

import type { Orbit } from "./motions";
import { type Given, type Mechanism, type Output, type Values, givenValue } from "./tables";

export interface Context {
  mechanism: Mechanism;
  values: Values;
  orbit: Orbit;
  natural: number;
}

/** What can vary: real parameters, and inputs that act. */
export function variables({ mechanism, values }: Context): Given[] {
  const acts = (given: Given): boolean => {
    const mode = mechanism.given.find((one) => one.arguments?.includes(given.argument ?? ""));
    const chosen = !mode || mode.arguments![givenValue(mode, values)] === given.argument;
    return chosen && (given.kind !== "motor" || hasMotor(mechanism, values));
  };
  return mechanism.given.filter((given) => !given.choices && given.section !== "Start" && acts(given));
}

const hasMotor = (mechanism: Mechanism, values: Values): boolean =>
  mechanism.given.some((given) => given.reference === -1 && givenValue(given, values) !== 0);

/** What drives the crank: its speed, its torque, or the field of its motor. */
export function driving(context: Context): Given | undefined {
  const { mechanism, values } = context;
  const all = variables(context);
  const motor = hasMotor(mechanism, values) ? all.find((given) => given.reference === -3) : undefined;
  return (
    motor ??
    all.find((given) => given.freedom === mechanism.crank && given.unit === "rpm") ??
    all.find((given) => given.freedom === mechanism.crank)
  );
}

/** The outputs whose amplitudes are meant, by their places in the state. */
export function swinging({ mechanism: { freedoms, outputs }, orbit: { places } }: Context): Output[] {
  const n = freedoms.length;
  return places.map((place) => outputs[place < n ? freedoms[place].coordinate : freedoms[place - n].rate]);
}
