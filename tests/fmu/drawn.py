"""Draw random mechanisms of every kind, with a state, modes and inputs, for the tests of agreement and of derivatives."""

from __future__ import annotations

import random
from dataclasses import asdict, fields
from typing import Any, NamedTuple

from analysis.mechanisms import FIVE_BAR, SLIDER_CRANK
from linkwork.mechanism import Mechanism
from linkwork.parameters import fmi_name
from tests import slider_cranks, strategies
from tests.mechanisms import pendulum, rotor_on_cart

ROTOR, PENDULUM = rotor_on_cart.MECHANISM, pendulum.MECHANISM
MECHANISMS = {m.fmu: m for m in (FIVE_BAR, SLIDER_CRANK, ROTOR, PENDULUM)}


class Drawn(NamedTuple):
    """A mechanism at the start of a run: parameters, initial state, and values of its modes and inputs by their FMI names."""

    mechanism: Mechanism
    parameters: Any
    initial: Any
    modes: dict[str, int]
    inputs: dict[str, float]

    @property
    def values(self) -> dict[str, float | int]:
        """Return all values that an FMU is given, by FMI name; those of integer variables are of type int."""
        own = {fmi_name(name): value for name, value in asdict(self.parameters).items()}
        initial = {f"initial.{name}": float(value) for name, value in asdict(self.initial).items()}
        real = {n: v if n == "assembly.branch" else float(v) for n, v in own.items()}
        return real | initial | self.inputs | self.modes

    @property
    def commanded(self) -> dict[str, str]:
        """Return the inputs that command a rate under the modes, each with the name of that rate."""
        channels = [self.mechanism.channels[n] for n in self.mechanism.commands(self.modes)]
        return {channel.name: self.mechanism.freedoms[channel.freedom].rate for channel in channels}


def drawn(fmu: str, seed: int) -> Drawn:
    """Draw the case of a seed, which is the same on every machine; successive seeds go through all modes."""
    if fmu in ("FiveBarSlider", "SliderCrank"):
        mechanism = MECHANISMS[fmu]
        case = (strategies if mechanism is FIVE_BAR else slider_cranks).seeded(seed)
        modes = {"drive.mode": seed % 2}
        if mechanism is FIVE_BAR and seed % 6 < 3:
            case = strategies.rough(seed, ("torque", "speed")[seed % 2])
        if mechanism is SLIDER_CRANK:
            modes["axial.mode"] = seed // 2 % 3
        inputs = case.fmi_inputs()
        if mechanism is FIVE_BAR:
            # in proportion to the crank's inertia: a light crank would reach thousands of rad/s, and rounding errors grow
            inputs["drive.torque"] *= 100.0 * case.parameters.crank_inertia
        return Drawn(mechanism, case.parameters, case.initial, modes, inputs)
    mechanism = MECHANISMS[fmu]
    source = random.Random(seed)
    demo = next(iter(mechanism.published.values())).parameters
    parameters = mechanism.parameters(
        **{f.name: getattr(demo, f.name) * source.uniform(0.5, 2.0) for f in fields(demo)}
    )
    start = {f.name: source.uniform(-2.0, 2.0) for f in fields(mechanism.initial)}
    inputs = {name: source.uniform(-2.0, 2.0) for name in mechanism.input_names}
    modes = {mode.name: seed % 2 for mode in mechanism.modes}
    return Drawn(mechanism, parameters, mechanism.initial(**start), modes, inputs)
