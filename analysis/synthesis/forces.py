"""Forces on the pins of a four-bar or a slider-crank that runs at a constant speed, as a bound and as what is made small.

They are those of the plant with its slider held, traced for exact derivatives by the dimensions; masses follow from the
dimensions by one law (`masses`, `making.Make`). What is found is run in the compiled plant itself (`pin_forces`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import isfinite, pi
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.five_bar.dynamics import Inputs as Acting
from linkwork.five_bar.dynamics import Motion
from linkwork.five_bar.parameters import FiveBarParameters, InitialState

from ..mechanisms import FIVE_BAR
from ..numerics import symbolic
from ..run import Inputs, of_parameters, simulate
from ..units import Amount, in_si, quantity
from . import masses
from .constraints import Along, Demand, Least, Require, Way
from .limit_positions import grid, looked
from .linkage import Linkage
from .making import FAR, USUAL_MAKE, Make
from .masses import on_line
from .tasks import Normal

FloatArray = NDArray[np.float64]
PINS = "ABCD"
#: Samples of a turn that is run.
TURN = 720
#: Mass of the slider that stands for a fixed pivot in such a run, in masses of the links.
HEAVY = 1e8


def pin_functions(
    d: Any, make: Make, crank_angle: Any, *, straight: bool = False, sliding: bool = False
) -> dict[str, tuple[Any, Any]]:
    """Components of the force in each pin along and across the ground link (N), of CasADi's symbols and numbers.

    Parameters
    ----------
    d : namespace
        Dimensions by their names in `Linkage`, the branch too.
    make : Make
    crank_angle : column
        th2 (rad).
    straight : bool
        Whether the coupler point is on the line of B and C, see `masses.bodies`.
    sliding : bool
        Whether it is a slider-crank: D is then the force of the guide on its slider.
    """
    casadi = symbolic.library()
    kind, plant, law = _traced()
    line = make.density * make.width * make.thickness
    links = {name: getattr(d, name) for name in ("ground_length", "crank_length", "coupler_length", "rocker_length")}
    far = FAR * d.coupler_length
    if sliding:
        links |= {"ground_length": d.ground_length + far, "rocker_length": far}
    made = law(
        d.crank_length,
        d.coupler_length,
        links["rocker_length"],
        d.point_distance,
        d.point_angle,
        line,
        make.width,
        straight,
    )
    parameters = kind(
        **_DEFAULTS
        | links
        | made
        | make.weighed(made)
        | (make.sliding(far) if sliding else {})
        | {
            "slider_mass": 1.0,
            "coupler_point_distance": d.point_distance,
            "coupler_point_angle": d.point_angle,
            "gravity": make.gravity,
            "ground_inclination": d.ground_angle,
            "assembly_branch": d.branch,
        }
    )
    p = parameters.constants()
    load = make.load_along(casadi.cos(d.ground_angle), casadi.sin(d.ground_angle))
    w2 = make.speed
    g = plant.position(crank_angle, 0.0, p)
    k = plant.coefficients(g, p)
    w3, w4 = k.k32 * w2, k.k42 * w2
    # the slider is held and the crank's speed constant: what is left are the centripetal accelerations
    e3, e4 = plant.centripetal(g, w2, w3, w4, p)
    held = Motion(w3, w4, 0.0, 0.0, e3, e4, 0.0, 0.0, 0.0, 0.0, 0.0)
    f = plant.reactions(g, (crank_angle, 0.0, w2, 0.0, 0.0, 0.0), held, Acting(1.0, 0.0, 0.0, 0.0, *load), p)
    return {"A": (f.ax, f.ay), "B": (f.bx, f.by), "C": (f.cx, f.cy), "D": (f.dx, f.dy)}


@cache
def _traced() -> tuple[Any, Any, Any]:
    """The plant's parameters and functions, and the law of the masses, for CasADi's symbols."""
    casadi = symbolic.library()
    plant = of_parameters(FIVE_BAR)
    law = symbolic.traced((masses,), min=casadi.fmin, max=casadi.fmax)
    return type(plant.parameters), plant.functions, law.bodies


_DEFAULTS: dict[str, Any] = {
    field.name: field.default
    for field in FiveBarParameters.__dataclass_fields__.values()
    if isinstance(field.default, float)
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PinForces:
    """The forces on the pins over a turn at constant speed, or over the way of a task.

    Attributes
    ----------
    rotation : ndarray, shape (n,)
        Of the crank, from the start of the task (rad).
    force : ndarray, shape (n, 4)
        On the pins A to D (N).
    moved : float
        How far the slider that stands for the fixed pivot moved (m).
    """

    rotation: FloatArray
    force: FloatArray
    moved: float

    @property
    def greatest(self) -> float:
        """The greatest force on any pin (N)."""
        return float(self.force.max())

    @property
    def pin(self) -> str:
        """The pin that it is on."""
        return PINS[int(self.force.max(axis=0).argmax())]

    @property
    def at(self) -> float:
        """The crank's rotation there (rad)."""
        return float(self.rotation[int(self.force.max(axis=1).argmax())])

    def of(self, pins: str) -> float:
        """The greatest force on some of the pins (N)."""
        return float(self.force[:, [PINS.index(pin) for pin in pins]].max())


def pin_forces(
    linkage: Linkage, make: Make, rotation: tuple[float, float] | None = None, *, run: bool = True
) -> PinForces:
    """Forces on the pins of a linkage at constant speed.

    They are of a run of the compiled plant, its slider so heavy that it stays where it is, its weight carried by the control
    force; or of the plant's equations alone.

    Parameters
    ----------
    linkage : Linkage
        With a fixed pivot, or a slider-crank: D is then the force of the guide on its slider.
    make : Make
    rotation : (float, float), optional
        From which rotation of the crank to which one (rad); a turn by default.
    run : bool
        Whether the plant is run.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    AssemblyError
        If the links cannot be joined somewhere.
    """
    if linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: of a moved one see motion.inverse_dynamics")
    begin, end = (0.0, 2.0 * pi) if rotation is None else rotation
    if not run:
        return _held(linkage, make, np.linspace(begin, end, TURN + 1))
    made = make.moving(linkage)
    heavy = HEAVY * (made.crank_mass + made.coupler_mass + made.rocker_mass)
    parameters = replace(made, slider_mass=heavy, slider_stiffness=0.0, slider_damping=0.0, slider_coulomb_friction=0.0)
    x, y = make.load_along(np.cos(linkage.ground_angle), np.sin(linkage.ground_angle))
    weight = heavy * make.gravity * float(np.sin(linkage.ground_angle))
    acting = Inputs(speed=make.speed, force=weight, load_x=float(x), load_y=float(y))
    start = InitialState(crank_angle=begin + linkage.crank_phase)
    samples = np.linspace(0.0, (end - begin) / make.speed, TURN + 1)
    done = simulate(parameters, acting, initial=start, samples=samples)
    if done.time[-1] < samples[-1]:
        raise InputError(
            f"the plant did not run from a crank rotation of {begin:.6g} rad to {end:.6g} rad: {done.message}"
        )
    force = np.column_stack([np.hypot(done[f"pin.{pin}.fx"], done[f"pin.{pin}.fy"]) for pin in PINS])
    moved = float(np.abs(done["slider.position"]).max())
    return PinForces(rotation=begin + make.speed * done.time, force=force, moved=moved)


def _held(linkage: Linkage, make: Make, rotation: FloatArray) -> PinForces:
    """By the plant's equations, its slider held."""
    casadi, d = symbolic.library(), SimpleNamespace(**linkage.values())
    straight = on_line(linkage.coupler_length, linkage.point_distance, linkage.point_angle)
    th2 = casadi.DM(linkage.crank_angle(rotation))
    found = pin_functions(d, make, th2, straight=straight, sliding=linkage.slides)
    force = np.column_stack([np.hypot(*(np.array(f).ravel() for f in found[pin])) for pin in PINS])
    if not np.isfinite(force).all():
        at = float(rotation[np.argmin(np.isfinite(force).all(axis=1))])
        raise AssemblyError(f"the links cannot be joined at a crank rotation of {at:.6g} rad")
    return PinForces(rotation=rotation, force=force, moved=0.0)


def _check_pins(pins: str) -> None:
    if not pins or not set(pins) <= set(PINS):
        raise ParameterError("pins", pins, "be some of the letters ABCD")


class _Forces(Demand):
    """What the forces on the pins are about."""

    __slots__ = ()
    make: Make
    pins: str

    def along(self, way: Way) -> Along:
        """The forces on the pins (N), a column each."""
        ends, turn = way.ends("a force on the pins"), way.turn

        def magnitudes(d: Any, rotation: Any) -> Any:
            casadi = symbolic.library()
            th2 = rotation if turn else rotation + d.crank_phase
            found = pin_functions(d, self.make, th2, straight=way.straight, sliding=way.sliding)
            # a force of zero has a slope, too
            chosen = [found[pin] for pin in self.pins]
            return casadi.horzcat(*(casadi.sqrt(x * x + y * y + 1e-18) for x, y in chosen))

        return Along(
            function=magnitudes,
            name="force on the pins",
            unit="N",
            rotation=grid(ends),
            ends=looked(ends),
            symbolic=True,
        )


@in_si(force="N")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MaxPinForce(_Forces):
    """No pin carries more than this, over a turn of the crank or, where it need not turn fully, on the way of the task.

    Attributes
    ----------
    force : float
        N.
    make : Make
        Masses, gravity, load, and the constant speed of the crank.
    pins : str
        Which pins: letters of "ABCD".
    """

    force: Amount
    make: Make = USUAL_MAKE
    pins: str = PINS

    def __post_init__(self) -> None:
        if not (isfinite(self.force) and self.force > 0.0):
            raise ParameterError("greatest pin force", self.force, "be a finite number greater than zero (N)")
        _check_pins(self.pins)

    def requires(self, way: Way) -> tuple[Require, ...]:
        """The forces less the bound."""
        forces = self.along(way)

        def excess(d: Any, rotation: Any) -> Any:
            return forces.function(d, rotation) - self.force

        return (replace(forces, function=excess, scale=self.force),)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastPinForce(_Forces):
    """Of the linkages whose greatest error stays below a bound, that whose pins carry least is sought.

    Attributes
    ----------
    error : float or str
        Bound of the greatest error, as of the objective "worst" (m; of a rocker function rad).
    make : Make
        Masses, gravity, load, and the constant speed of the crank.
    pins : str
        Which pins: letters of "ABCD".
    """

    seeks: ClassVar[bool] = True

    error: Amount
    make: Make = USUAL_MAKE
    pins: str = PINS

    def __post_init__(self) -> None:
        _check_pins(self.pins)

    def requires(self, way: Way) -> tuple[Require, ...]:
        """Nothing by itself."""
        return ()

    def sought(self, way: Way, normal: Normal) -> Least:
        """The forces, and the bound of the error in normal form."""
        error = quantity(self.error, "rad" if normal.of_rocker else "m", "greatest error")
        if not (isfinite(error) and error > 0.0):
            raise ParameterError("greatest error", self.error, "be a finite number greater than zero")
        return Least(self.along(way), error / normal.unit)


#: The constraints that are about pin forces.
FORCES = (MaxPinForce, LeastPinForce)
