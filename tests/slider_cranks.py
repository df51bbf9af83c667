"""Generate random valid slider-cranks in random states, with nonzero values of all parameters.

As in `strategies`, `draw` describes a case by two functions that supply numbers and choices. `seeded` makes cases reproducible
from a seed; `cases` is a hypothesis strategy that shrinks. The rod's length is chosen last, so that the rod reaches the guide
both at the drawn state and where the groove puts the crank.
"""

from collections.abc import Callable
from math import cos, hypot, pi, sin, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from linkwork.slider_crank import dynamics
from linkwork.slider_crank.parameters import Constants, InitialState, SliderCrankParameters
from tests.strategies import Uniform, suppliers

if TYPE_CHECKING:
    from analysis.slider_crank import JointLoads

#: Drives of crank and shift by name, as the values speed_drive, shift_drive, groove of `dynamics.Inputs`.
DRIVES = {
    "torque-force": (0.0, 0.0, 0.0),
    "torque-shift": (0.0, 1.0, 0.0),
    "torque-groove": (0.0, 0.0, 1.0),
    "speed-force": (1.0, 0.0, 0.0),
    "speed-shift": (1.0, 1.0, 0.0),
    "speed-groove": (1.0, 0.0, 1.0),
}


class Case(NamedTuple):
    """A mechanism, a state of it, and its inputs: torque, accelerations, axial force, load."""

    parameters: SliderCrankParameters
    state: dynamics.State
    torque: float
    acceleration: float
    force: float
    shift_acceleration: float
    load: float

    @property
    def p(self) -> Constants:
        return self.parameters.constants()

    @property
    def initial(self) -> InitialState:
        """Return the state as the initial state of a run."""
        th, s1, w, v, _, _ = self.state
        return InitialState(crank_angle=th, crank_speed=w, shift_position=s1, shift_velocity=v)

    def inputs(self, drive: str) -> dynamics.Inputs:
        """Return the inputs under one of `DRIVES`; inputs that the drive should not read have values too, see `read`."""
        acting = (self.torque, self.acceleration, self.force, self.shift_acceleration, self.load)
        return dynamics.Inputs(*DRIVES[drive], *acting)

    def read(self, drive: str) -> dynamics.Inputs:
        """Return the inputs as the plant should read them under a drive: inputs that belong to other drives are zero."""
        i = self.inputs(drive)
        return i._replace(
            torque=0.0 if i.speed_drive else i.torque,
            acceleration=i.acceleration if i.speed_drive else 0.0,
            force=0.0 if i.shift_drive or i.groove else i.force,
            shift_acceleration=i.shift_acceleration if i.shift_drive else 0.0,
        )

    def fmi_inputs(self) -> dict[str, float]:
        """Return the inputs by their FMI names; the commanded speeds are those of the state."""
        return {
            "drive.torque": self.torque,
            "drive.speed": self.state[2],
            "drive.acceleration": self.acceleration,
            "axial.force": self.force,
            "axial.speed": self.state[3],
            "axial.acceleration": self.shift_acceleration,
            "slider.load": self.load,
        }

    def under(self, drive: str) -> dynamics.State:
        """Return the state under one of `DRIVES`: a groove determines shift and axial velocity."""
        return dynamics.impose_groove(self.state, DRIVES[drive][2], self.p)


def draw(uniform: Uniform, choose: Callable[[], bool]) -> Case:
    """Draw a case; ``uniform(low, high)`` supplies numbers, ``choose()`` choices such as a sign or the assembly."""

    def either(low: float, high: float) -> float:
        return uniform(low, high) * (1.0 if choose() else -1.0)

    a1 = uniform(0.1, 0.5)
    a4 = a1 * either(0.1, 1.5)
    twist = uniform(-pi, 2.0 * pi)
    th = uniform(-2.0 * pi, 2.0 * pi)
    s1 = a1 * either(0.05, 1.0)
    amplitude, ratio = a1 * either(0.1, 0.6), either(0.3, 2.5)

    def distance(shift: float) -> float:
        return hypot(a1 * cos(th) + a4, a1 * sin(th) * cos(twist) - shift * sin(twist))

    a2 = sqrt(max(distance(s1), distance(amplitude * sin(ratio * th))) ** 2 + (a1 * uniform(1.0, 4.0)) ** 2)
    m1, m2, m3 = uniform(0.1, 2.0), uniform(0.1, 2.0), uniform(0.1, 2.0)
    crank_cog = a1 * either(0.05, 0.8), a1 * either(0.05, 0.4), a1 * either(0.05, 0.5)
    radius = a1 * uniform(0.2, 0.5)
    parameters = SliderCrankParameters(
        crank_length=a1, rod_length=a2, guide_offset=a4, guide_twist=twist, crank_mass=m1, rod_mass=m2, slider_mass=m3,
        crank_inertia=m1 * (radius**2 + crank_cog[0] ** 2 + crank_cog[1] ** 2), crank_cog_x=crank_cog[0],
        crank_cog_y=crank_cog[1], crank_cog_z=crank_cog[2], crank_product_xz=m1 * a1 * a1 * either(0.01, 0.3),
        crank_product_yz=m1 * a1 * a1 * either(0.01, 0.3), rod_inertia=m2 * (a2 * uniform(0.1, 0.4)) ** 2,
        rod_cog_distance=a2 * uniform(-0.2, 1.2), slider_cog_x=a1 * either(0.05, 0.5), slider_cog_y=a1 * either(0.05, 0.5),
        slider_cog_z=a1 * either(0.05, 0.5), slider_stiffness=uniform(10.0, 2000.0),
        slider_spring_free_position=a1 * either(0.1, 2.0), slider_damping=uniform(0.1, 30.0),
        slider_coulomb_friction=uniform(0.1, 5.0), shift_stiffness=uniform(10.0, 2000.0),
        shift_spring_free_position=a1 * either(0.1, 0.5), shift_damping=uniform(0.1, 30.0), groove_amplitude=amplitude,
        groove_ratio=ratio, gravity_x=either(0.5, 20.0), gravity_y=either(0.5, 20.0), gravity_z=either(0.5, 20.0),
        assembly_branch=1 if choose() else -1,
    )  # fmt: skip
    state = (th, s1, either(0.5, 30.0), either(0.05, 2.0), 0.0, 0.0)
    acting = (either(low, high) for low, high in ((0.1, 20.0), (1.0, 500.0), *3 * [(0.1, 50.0)]))
    return Case(parameters, state, *acting)


seeded, cases, mechanisms = suppliers(draw)


def components(loads: "JointLoads", name: str, frame: int) -> Any:
    """Return the components of a force or moment by dual vectors in frame 1 (ground), 2 (crank), 3 (rod) or 4 (guide), (n, 3).

    In frame 3 the axis i is along the rod, j perpendicular to rod and crank axis.
    """
    closure, vector = loads.closure, getattr(loads, name)
    i = closure.rod_frame.real[..., 0]
    j = np.cross([0.0, 0.0, 1.0], i)
    j /= np.linalg.norm(j, axis=-1, keepdims=True)
    rod = np.stack([i, j, np.cross(i, j)], -1)
    axes = {1: np.eye(3)[None], 2: closure.crank_frame.real, 3: rod, 4: closure.guide_frame.real}
    return np.einsum("nji,nj->ni", np.broadcast_to(axes[frame], rod.shape), vector)
