"""Generate random valid five-bar sliders in random states, with nonzero values of all parameters.

`draw` describes a case by two functions that supply numbers and choices. `seeded` makes cases reproducible from a seed; `cases`
is a hypothesis strategy that shrinks. No case is rejected, because each is built backwards: first ground link, guide, crank and
freedoms, then the transmission angle, then the lengths of coupler and rocker that have this angle.
"""

import random
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import asin, cos, hypot, pi, sin, sqrt
from typing import Any, NamedTuple, TypeVar

from hypothesis import strategies as st

from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import Constants, FiveBarParameters, InitialState

#: Least |sin(rocker angle - coupler angle)| in the drawn states.
LEAST_SINE = 0.1

T = TypeVar("T")
Uniform = Callable[[float, float], float]
#: A function that makes a random case from a source of numbers and a source of choices.
Draw = Callable[[Uniform, Callable[[], bool]], T]


class Case(NamedTuple):
    """A mechanism, a state of it, and its inputs under drives by torque and by speed."""

    parameters: FiveBarParameters
    state: dynamics.State
    torque_inputs: dynamics.Inputs
    speed_inputs: dynamics.Inputs

    @property
    def p(self) -> Constants:
        return self.parameters.constants()

    def inputs(self, drive: str) -> dynamics.Inputs:
        """Return the inputs under the drive "torque" or "speed"."""
        return self.torque_inputs if drive == "torque" else self.speed_inputs

    def read(self, drive: str) -> dynamics.Inputs:
        """Return the inputs as the plant should read them under a drive: they are the same as `inputs`."""
        return self.inputs(drive)

    def fmi_inputs(self) -> dict[str, float]:
        """Return the inputs by their FMI names; the commanded speed is that of the state."""
        i = self.torque_inputs
        return {
            "drive.torque": i.torque,
            "drive.speed": self.state[2],
            "drive.acceleration": self.speed_inputs.acceleration,
            "slider.force": i.force,
            "load.fx": i.load_x,
            "load.fy": i.load_y,
        }

    def under(self, drive: str) -> dynamics.State:
        """Return the state under a drive: it is the same for both drives."""
        return self.state

    @property
    def initial(self) -> InitialState:
        """Return the state as the initial state of a run."""
        th2, u, w2, v, _, _ = self.state
        return InitialState(crank_angle=th2, crank_speed=w2, slider_position=u, slider_velocity=v)


def draw(uniform: Uniform, choose: Callable[[], bool]) -> Case:
    """Draw a case; ``uniform(low, high)`` supplies numbers, ``choose()`` the assembly."""
    l1 = uniform(0.1, 0.5)
    l2 = l1 * uniform(0.1, 0.5)
    alpha = uniform(-pi, pi)
    th2 = uniform(-2.0 * pi, 2.0 * pi)
    u = l1 * uniform(-0.3, 0.3)
    branch = 1 if choose() else -1
    # BD is at least l1 - l2 - |u| >= 0.2 l1; the transmission angle and the ratio l3 / l4 then determine both lengths
    bd = hypot(l1 + u * cos(alpha) - l2 * cos(th2), u * sin(alpha) - l2 * sin(th2))
    margin = asin(1.01 * LEAST_SINE)
    angle = uniform(margin, pi - margin)
    ratio = uniform(0.5, 2.0)
    l4 = bd / sqrt(1.0 + ratio**2 - 2.0 * ratio * cos(angle))
    l3 = ratio * l4

    def link(length: float) -> tuple[float, float, float, float]:
        """Return mass, inertia about the centre of mass, and distance and angle of the centre of mass of a link."""
        mass = uniform(0.05, 1.0)
        return mass, mass * (length * uniform(0.2, 0.5)) ** 2, length * uniform(-0.2, 1.0), uniform(-pi, pi)

    m2, inertia2, cog2, nu2 = link(l2)
    m3, inertia3, cog3, nu3 = link(l3)
    m4, inertia4, cog4, nu4 = link(l4)
    parameters = FiveBarParameters(
        ground_length=l1, crank_length=l2, coupler_length=l3, rocker_length=l4, crank_mass=m2, coupler_mass=m3,
        rocker_mass=m4, slider_mass=uniform(0.1, 1.0), crank_inertia=inertia2 + m2 * cog2**2, coupler_inertia=inertia3,
        rocker_inertia=inertia4, crank_cog_distance=cog2, coupler_cog_distance=cog3, rocker_cog_distance=cog4,
        crank_cog_angle=nu2, coupler_cog_angle=nu3, rocker_cog_angle=nu4, slider_guide_angle=alpha,
        slider_stiffness=uniform(0.0, 2000.0), slider_spring_free_position=l1 * uniform(-0.2, 0.2),
        slider_damping=uniform(0.0, 30.0), slider_coulomb_friction=uniform(0.0, 5.0),
        coupler_point_distance=l3 * uniform(-0.5, 1.5), coupler_point_angle=uniform(-pi, pi), gravity=uniform(0.0, 20.0),
        ground_inclination=uniform(-pi, pi), assembly_branch=branch,
    )  # fmt: skip
    state = (th2, u, uniform(-30.0, 30.0), uniform(-1.0, 1.0), 0.0, 0.0)
    force, load_x, load_y = uniform(-50.0, 50.0), uniform(-50.0, 50.0), uniform(-50.0, 50.0)
    return Case(
        parameters,
        state,
        dynamics.Inputs(0.0, uniform(-5.0, 5.0), 0.0, force, load_x, load_y),
        dynamics.Inputs(1.0, 0.0, uniform(-500.0, 500.0), force, load_x, load_y),
    )


@st.composite
def drawn(draw_from: st.DrawFn, draw: Draw[T]) -> T:
    """Return a hypothesis strategy of the cases that ``draw`` makes."""
    numbers = partial(st.floats, allow_subnormal=False)
    return draw(lambda low, high: draw_from(numbers(low, high)), lambda: draw_from(st.booleans()))


def suppliers(draw: Draw[T]) -> tuple[Callable[[int], T], Callable[[], st.SearchStrategy[T]], Callable[[], Any]]:
    """Return three functions for ``draw``: the case of a seed, a strategy of cases, and a strategy of mechanisms.

    The case of a seed is the same on every machine.
    """

    def seeded(seed: int) -> T:
        source = random.Random(seed)
        return draw(source.uniform, lambda: source.random() < 0.5)

    return seeded, lambda: drawn(draw), lambda: drawn(draw).map(lambda case: case.parameters)


seeded, cases, mechanisms = suppliers(draw)

#: Names of the parameters of friction that depends on the joint forces.
PINS = tuple(f"pin_{pin}_friction_radius" for pin in "ABCD")
FRICTION = ("slider_friction_coefficient", *PINS)


def rough(seed: int, drive: str, *only: str) -> Case:
    """Return the case of a seed with friction in the joints, in the named parameters only or in all.

    The friction is reduced until the mechanism does not jam.
    """
    case, source = seeded(seed), random.Random(seed)
    most = dict.fromkeys(PINS, 0.3 * case.parameters.crank_length) | {"slider_friction_coefficient": 0.8}
    values = {name: source.uniform(0.3, 1.0) * most[name] for name in only or FRICTION}
    while True:
        case = case._replace(parameters=replace(case.parameters, **values))
        if dynamics.clearance(case.state, case.inputs(drive), case.p) > 0.01:
            return case
        values = {name: 0.5 * value for name, value in values.items()}
