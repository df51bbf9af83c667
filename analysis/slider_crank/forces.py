"""Both force problems of the generalised slider-crank, over the turn: all joint forces and moments for a given motion.

Crank and shift move as prescribed, so that the axial force on the crank is an unknown (Rahman prescribes it, erratum 7).
Then either the slider's load L is given and the crank's torque T sought, or the torque is given and the force on the slider
sought (the thesis's problem). Both hang together by the crank's equation of motion

    T = T0 - kth L,    kth = dS4/dtheta1 at the shift held,

with T0 the torque that no load takes. So the first problem is regular wherever the mechanism is assembled, and the second
has a pole where kth = 0: at the dead centres, where the slider's force has no lever on the crank. The values there are masked
with the reason.

The equations are the plant's own (`linkwork.slider_crank.dynamics`), evaluated on arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import ceil, degrees, pi, radians, tau
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from linkwork.errors import AssemblyError, InputError
from linkwork.limits import LIMIT_SINE
from linkwork.slider_crank.dynamics import Inputs
from linkwork.slider_crank.kinematics import Position
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters
from linkwork.slider_crank.published import INCH, POUND_FORCE, POUND_INCH
from linkwork.slider_crank.vectors import Vector

from ..files import write_csv
from . import mobility
from .dual_dynamics import DEAD_CENTRE
from .mobility import DeadCentre
from .shifts import (
    AngleShift,
    ConstantShift,
    GrooveShift,
    ShiftLaw,
    ShiftMotion,
    TimeShift,
    in_the_shaft,
    on_arrays,
    with_groove,
)

if TYPE_CHECKING:
    from ..figures.slider_crank import ForceScene

__all__ = [
    "AngleShift",
    "ConstantShift",
    "ForceInstant",
    "ForceTurn",
    "GrooveShift",
    "ShiftLaw",
    "ShiftMotion",
    "Solution",
    "TimeShift",
    "force_turn",
    "forces_at",
    "solve",
    "unit_table",
]

FloatArray: TypeAlias = NDArray[np.float64]
MaskedArray: TypeAlias = "np.ma.MaskedArray[Any, np.dtype[np.float64]]"

#: Angles over the turn where none are given: every degree, both ends.
SAMPLES = 361
#: Pieces of a turn in which dead centres are looked for under a law that need not repeat; two in one piece go unseen.
_PIECES = 1440
#: Sine of the angle between rod and crank axis below which frame 3 has no direction.
_PARALLEL = 1e-12
#: Angle (deg) from a singularity or a limit of assembly beyond which a value is told as an extreme, and shown.
CLEAR_DEG = 10.0
#: What is told of a mechanism whose slider force is sought in vain.
NO_LEVER = "the slider has no lever on the crank at any angle, so that the torque determines no force on it"
#: The shift where none is given.
_STILL = ConstantShift(0.0)
#: What `ForceTurn.sought` may be.
TORQUE, SLIDER_FORCE = "torque", "slider force"

#: Forces and moments by name, and whether it is a moment.
JOINTS: Mapping[str, bool] = MappingProxyType(
    {
        "bearing": False,
        "bearing_moment": True,
        "crank_pin": False,
        "slider_pin": False,
        "guide": False,
        "guide_moment": True,
    }
)
#: What forces and moments are told as.
WORDS: Mapping[str, str] = MappingProxyType(
    {
        "bearing": "force of the bearing on the crank",
        "bearing_moment": "moment of the bearing about O",
        "crank_pin": "force of the crank on the rod",
        "slider_pin": "force of the slider on the rod",
        "guide": "force of the guide on the slider",
        "guide_moment": "moment of the guide on the slider",
    }
)
#: Frames by number: of the ground, the crank, the rod and the guide.
FRAMES: Mapping[int, str] = MappingProxyType({1: "ground", 2: "crank", 3: "rod", 4: "guide"})

#: Units of a file: for each SI unit the unit that is written and what one of it is in SI.
UNITS: Mapping[str, Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "SI": {unit: (unit, 1.0) for unit in ("rad", "m", "m/s", "m/s2", "N", "N.m")},
        "inch": {
            "rad": ("deg", pi / 180.0),
            "m": ("in", INCH),
            "m/s": ("in/s", INCH),
            "m/s2": ("in/s2", INCH),
            "N": ("lb", POUND_FORCE),
            "N.m": ("lb.in", POUND_INCH),
        },
    }
)


def unit_table(units: str) -> Mapping[str, tuple[str, float]]:
    """What of `UNITS` a file is written in.

    Raises
    ------
    InputError
        If there are no such units.
    """
    if units not in UNITS:
        raise InputError(f"there are no units {units!r}: they are {' or '.join(UNITS)}")
    return UNITS[units]


class Solution(NamedTuple):
    """What `solve` finds: `Position`, `Coefficients`, `Motion` and `Reactions` of the kind of numbers that it was given."""

    position: Any
    coefficients: Any
    motion: Any
    reactions: Any
    load: Any
    ratio: Any


def solve(
    p: Constants,
    angle: Any,
    shift: ShiftMotion,
    speed: Any,
    acceleration: Any,
    *,
    given: Any,
    torque: bool,
    groove: bool,
) -> Solution:
    """Solve one of the force problems at configurations that can be assembled, on arrays or dual numbers.

    Parameters
    ----------
    p : Constants
    angle, shift, speed, acceleration
        theta1 (rad), the shift's motion, theta1' (rad/s) and theta1'' (rad/s2).
    given
        The load (N), or with ``torque`` the torque (N.m).
    torque : bool
        Whether the torque is given and the load sought. It is not finite where the ratio is zero.
    groove : bool
        Whether the parameters' groove makes the shift.

    Returns
    -------
    Solution
        ``ratio`` is minus the derivative of the torque by the load (m): kth, or with a groove in the shaft dS4/dtheta1.
    """
    f = on_arrays()
    q = f.position(angle, shift.shift, p)
    k = f.coefficients(q, p)
    x = (angle, shift.shift, speed, shift.velocity, 0.0, 0.0)
    grooved = 1.0 if groove else 0.0
    inputs = Inputs(1.0, 1.0 - grooved, grooved, 0.0, acceleration, 0.0, shift.acceleration, 0.0)
    ratio = k.kth + grooved * f.groove(angle, p).pitch * k.ks
    load = (f.motion(q, k, x, inputs, p).torque - given) / ratio if torque else given
    inputs = inputs._replace(load=load)
    m = f.motion(q, k, x, inputs, p)
    return Solution(q, k, m, f.reactions(q, x, m, inputs, p), load, ratio)


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceTurn:
    """Motion and all joint forces and moments over the turn, in one of the force problems.

    Attributes
    ----------
    parameters : SliderCrankParameters
    law : ShiftLaw
        Of the axial shift.
    sought : str
        "torque" or "slider force".
    angle, speed, acceleration : ndarray, shape (n,)
        theta1 (rad), theta1' (rad/s), theta1'' (rad/s2).
    shift, shift_velocity, shift_acceleration : ndarray, shape (n,)
        m, m/s, m/s2.
    slider_position, slider_velocity, slider_acceleration : ndarray, shape (n,)
        m, m/s, m/s2.
    torque : masked array, shape (n,)
        Torque of the drive on the crank (N.m).
    slider_force : masked array, shape (n,)
        Load on the slider (N), positive in the direction in which its position increases, -k of frame 4; spring, damper and
        friction come on top of it. Masked at a dead centre where it is sought.
    axial_force : masked array, shape (n,)
        Force on the crank along its axis (N), of all that drives, holds and springs it.
    applied_axial_force : masked array, shape (n,)
        Of it that of what drives or holds the shift: without the spring and the damper there (N).
    ratio : ndarray, shape (n,)
        Lever of the slider's force on the crank, minus dT/dL (m): kth, or dS4/dtheta1 with a groove in the shaft.
    reasons : tuple of (int, str)
        Index of each point at which something is masked, and why.
    unreachable : ndarray, shape (m,)
        Angles that were asked for and left out because the rod does not reach the guide there (rad).
    """

    parameters: SliderCrankParameters
    law: ShiftLaw
    sought: str
    angle: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    shift: FloatArray
    shift_velocity: FloatArray
    shift_acceleration: FloatArray
    slider_position: FloatArray
    slider_velocity: FloatArray
    slider_acceleration: FloatArray
    torque: MaskedArray
    slider_force: MaskedArray
    axial_force: MaskedArray
    applied_axial_force: MaskedArray
    ratio: FloatArray
    reasons: tuple[tuple[int, str], ...]
    unreachable: FloatArray
    _joints: Mapping[str, MaskedArray]
    _position: Position

    def __len__(self) -> int:
        return len(self.angle)

    @property
    def _span(self) -> tuple[float, float]:
        return float(self.angle.min()), float(self.angle.max())

    @cached_property
    def dead_centres(self) -> tuple[DeadCentre, ...]:
        """Configurations between the first and the last angle at which the slider turns back, located to the last digit."""
        return _located(self, *self._span, along=True)

    @cached_property
    def singularities(self) -> tuple[DeadCentre, ...]:
        """Configurations between the first and the last angle at which the torque does not determine the slider's force.

        The zeros of ``ratio``: the same as the dead centres but where the shift moves and no groove in the shaft makes it.
        """
        return self.dead_centres if in_the_shaft(self.law) else _located(self, *self._span, along=False)

    @cached_property
    def limits(self) -> tuple[float, ...]:
        """Crank angles (rad) from the first to the last that was asked for at which a range of assembly ends.

        There rod and guide are perpendicular, and velocity, acceleration and all forces grow without bound.
        """
        asked = np.concatenate([self.angle, self.unreachable])
        return _limits(self, float(asked.min()), float(asked.max()))

    @cached_property
    def breaks(self) -> tuple[int, ...]:
        """Index of each angle between which and the next the mechanism cannot be assembled."""
        outside = np.sort(np.concatenate([self.unreachable, self.limits]))
        low, high = np.minimum(self.angle[:-1], self.angle[1:]), np.maximum(self.angle[:-1], self.angle[1:])
        between = np.searchsorted(outside, high) - np.searchsorted(outside, low, side="right")
        return tuple(int(i) for i in np.flatnonzero(between > 0))

    @property
    def without_lever(self) -> bool:
        """Whether the slider's force is sought and has no lever on the crank at any angle."""
        return bool(np.ma.getmaskarray(self.slider_force).all()) and not self.singularities

    @cached_property
    def masked(self) -> tuple[str, ...]:
        """What is masked and why, in sentences: ``reasons`` with one for each run of angles."""
        told = [NO_LEVER] if self.without_lever else []
        dead, p = np.ma.getmaskarray(self.slider_force), self.parameters.constants()
        for flags, what, why in _undetermined(dead & (not told), self._position, p):
            for first, last in _runs(flags):
                place = f"crank angle {_deg(self.angle[first])} deg"
                if last > first:
                    ends = f"{_deg(self.angle[first])} to {_deg(self.angle[last])} deg"
                    place = f"all {last - first + 1} crank angles from {ends}"
                told.append(f"{what} at {place}: {why}")
        return tuple(told)

    def clear(self, degrees: float = CLEAR_DEG, *, poles: bool = True) -> NDArray[np.bool_]:
        """Which angles (n,) are further than ``degrees`` from where forces grow without bound.

        That is at the limits of assembly and, where the slider's force is sought, at ``singularities``; without ``poles``
        the limits alone. What is beyond the first and the last angle counts.
        """
        away = radians(degrees)
        low, high = self._span
        places = list(_limits(self, low - away, high + away))
        if poles and self.sought == SLIDER_FORCE:
            along = in_the_shaft(self.law)
            places += [c.crank_angle for c in _located(self, low - away, high + away, along=along)]
        distances = np.abs(self.angle[:, None] - np.array(places)[None, :])
        return np.asarray((distances > away).all(axis=1))

    def vector(self, name: str, frame: int = 1) -> MaskedArray:
        """Components of a force or moment, masked where it is not determined.

        Parameters
        ----------
        name : str
            ``bearing``: force of the bearing on the crank, without axial component; ``bearing_moment``: about the ground's
            origin O, the torque of the drive included; ``crank_pin``: force of the crank on the rod; ``slider_pin``: of the
            slider on the rod; ``guide``: of the guide on the slider; ``guide_moment``: about the slider pin.
        frame : int
            1 ground; 2 crank, i towards the crank pin; 3 rod, i along it from crank pin to slider pin, j perpendicular to it
            and to the crank axis; 4 guide, the slider position increasing along -k. Moments keep their points.

        Returns
        -------
        masked array, shape (n, 3)
            N or N.m.

        Raises
        ------
        InputError
            If there is no such vector or frame.
        """
        if name not in JOINTS:
            raise InputError(f"there is no joint force or moment {name!r}: the names are {', '.join(JOINTS)}")
        if frame not in FRAMES:
            raise InputError(
                f"there is no frame {frame!r}: the frames are "
                + ", ".join(f"{number} ({whose})" for number, whose in FRAMES.items())
            )
        ground = self._joints[name]
        if frame == 1:
            return ground.copy()
        f, p, q = on_arrays(), self.parameters.constants(), self._position
        components = Vector(*ground.filled(0.0).T)
        mask = np.ma.getmaskarray(ground)
        if frame == 2:
            turned = f.to_crank_frame(components, q)
        elif frame == 4:
            turned = f.to_guide_frame(components, p)
        else:
            with np.errstate(divide="ignore", invalid="ignore"):
                turned = f.to_rod_frame(components, q, p)
            mask = mask | _parallel(q, p)[:, None]
        return np.ma.MaskedArray(_joined(turned, len(self)), mask=mask, fill_value=np.nan)

    def scene(self, frame: int = 1, *, units: str = "SI") -> ForceScene:
        """What `analysis.figures.slider_crank.plot_forces` draws: motion, torque and forces, by components in a frame.

        Raises
        ------
        InputError
            If there are no such frame or units.
        """
        from ..figures.slider_crank import ForcePanel, ForceScene

        known = unit_table(units)

        def panel(title: str, si: str, curves: Mapping[str, Any]) -> ForcePanel:
            unit, one = known[si]
            drawn = {label: np.array(np.ma.filled(x, np.nan)) / one for label, x in curves.items()}
            return ForcePanel(title=title, unit=unit, curves=drawn, grows=si != "m")

        panels = [
            panel("slider position S4", "m", {"": self.slider_position}),
            panel("crank torque", "N.m", {"": self.torque}),
            panel("slider force, along -k4", "N", {"": self.slider_force}),
            panel("axial force on the crank", "N", {"": self.axial_force}),
        ]
        for name, moment in JOINTS.items():
            vector = self.vector(name, frame)
            components = {f"{axis}{frame}": vector[:, i] for i, axis in enumerate("ijk")}
            panels.append(panel(WORDS[name], "N.m" if moment else "N", components))
        sought = self.singularities if self.sought == SLIDER_FORCE else ()
        return ForceScene(
            angle=self.angle,
            panels=panels,
            clear=self.clear(),
            breaks=self.breaks,
            poles=tuple(int(np.argmin(np.abs(self.angle - place.crank_angle))) for place in sought),
            marks={f"dead centre {degrees(d.crank_angle):.1f}°": d.crank_angle for d in self.dead_centres}
            | {f"limit {degrees(end):.1f}°": end for end in self.limits},
        )

    def columns(self, units: str = "SI", frames: tuple[int, ...] = (1, 2, 3, 4)) -> dict[str, FloatArray]:
        """Everything by name with unit; NaN where a value is masked, which the last two columns tell.

        Parameters
        ----------
        units : str
            "SI", or "inch": degrees, inches, seconds and pounds force, as the thesis prints them.
        frames : tuple of int
            Frames of the joint forces and moments.

        Raises
        ------
        InputError
            If there are no such units or frames.
        """
        known = unit_table(units)
        parts: list[tuple[str, str, Any]] = [
            ("crank angle", "rad", self.angle),
            ("shift", "m", self.shift),
            ("shift velocity", "m/s", self.shift_velocity),
            ("shift acceleration", "m/s2", self.shift_acceleration),
            ("slider position", "m", self.slider_position),
            ("slider velocity", "m/s", self.slider_velocity),
            ("slider acceleration", "m/s2", self.slider_acceleration),
            ("crank torque", "N.m", self.torque),
            ("slider force", "N", self.slider_force),
            ("axial force", "N", self.axial_force),
            ("applied axial force", "N", self.applied_axial_force),
        ]
        for frame in frames:
            for name, moment in JOINTS.items():
                components = self.vector(name, frame)
                label = name.replace("_", " ")
                parts += [
                    (f"{label} {axis} in frame {frame}", "N.m" if moment else "N", components[:, i])
                    for i, axis in enumerate("ijk")
                ]
        columns = {}
        for name, unit, values in parts:
            written, one = known[unit]
            columns[f"{name} [{written}]"] = np.ma.filled(values, np.nan) / one
        dead = np.ma.getmaskarray(self.slider_force)
        return columns | {
            "dead centre (1): forces not determined": dead.astype(float),
            "rod parallel to crank axis (1): frame 3 not determined": _parallel(
                self._position, self.parameters.constants()
            ).astype(float),
        }

    def to_csv(self, path: str | Path, *, units: str = "SI", frames: tuple[int, ...] = (1, 2, 3, 4)) -> Path:
        """Write `columns` to a CSV file: a row for every angle, "nan" where a value is masked.

        Raises
        ------
        InputError
            As `columns`.
        """
        return write_csv(path, self.columns(units, frames))


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceInstant:
    """The forces of one configuration, as `ForceTurn` has them for many; None where a value is not determined.

    ``vectors`` are the joint forces and moments in the ground frame; ``reason`` says why any value is None.
    """

    angle: float
    shift: float
    slider_position: float
    slider_velocity: float
    slider_acceleration: float
    torque: float
    slider_force: float | None
    axial_force: float | None
    vectors: Mapping[str, Vector | None]
    reason: str


def force_turn(
    parameters: SliderCrankParameters,
    *,
    crank_speed: ArrayLike,
    crank_acceleration: ArrayLike = 0.0,
    shift: ShiftLaw = _STILL,
    angles: ArrayLike | None = None,
    load: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    partial: bool = False,
) -> ForceTurn:
    """Forces and moments in all joints over the turn, for a prescribed motion of crank and shift.

    Parameters
    ----------
    parameters : SliderCrankParameters
    crank_speed, crank_acceleration : array_like, scalar or shape (n,)
        theta1' (rad/s), theta1'' (rad/s2).
    shift : ShiftLaw
        `ConstantShift`, `GrooveShift`, `AngleShift`, `TimeShift` or another. The parameters' own groove is not looked at.
    angles : array_like, shape (n,), optional
        Crank angles (rad); 361 over the turn by default.
    load : array_like, scalar or shape (n,), optional
        Force on the slider (N), positive in the direction in which its position increases; the torque is sought. 0 by
        default.
    torque : array_like, scalar or shape (n,), optional
        Torque of the drive on the crank (N.m); the load on the slider is sought. Excludes ``load``.
    partial : bool
        Whether to leave out the angles at which the rod does not reach the guide, which ``unreachable`` then has.

    Raises
    ------
    InputError
        If both ``load`` and ``torque`` are given, a value is no finite number or of the wrong shape, or ``shift`` is no law.
    AssemblyError
        If the rod does not reach the guide at an angle; it tells the ranges in which it does. With ``partial`` only if it
        does at none.
    """
    if load is not None and torque is not None:
        raise InputError("both load and torque are given: give the one, and the other is sought")
    if not isinstance(shift, ShiftLaw):
        raise InputError(
            f"the shift is {shift!r}: it must be a law of the shift, such as ConstantShift(0.01) or GrooveShift(0.01, 2.0)"
        )
    wanted = "the angles must be a list of finite numbers (rad), at least one"
    th = (
        np.linspace(0.0, tau, SAMPLES)
        if angles is None
        else np.atleast_1d(_numbers(angles, f"{wanted}, not {angles!r}"))
    )
    if th.ndim != 1 or th.size == 0 or not np.isfinite(th).all():
        raise InputError(wanted)
    n = th.size
    w = _each("crank_speed", crank_speed, n)
    e = _each("crank_acceleration", crank_acceleration, n)
    given = _each("torque", torque, n) if torque is not None else _each("load", 0.0 if load is None else load, n)
    moving = ShiftMotion(*(_each(f"the shift law's {name}", x, n) for name, x in shift.at(th, w, e)._asdict().items()))
    p = with_groove(parameters.constants(), shift)
    in_shaft = in_the_shaft(shift)

    f = on_arrays()
    reached = f.assembly_square(th, moving.shift, p) >= (LIMIT_SINE * p.a2) ** 2
    if not (reached.any() if partial else reached.all()):
        raise _not_assembled(parameters, shift, th, moving.shift, reached)
    unreachable = th[~reached]
    th, w, e, given = (x[reached] for x in (th, w, e, given))
    moving = ShiftMotion(*(x[reached] for x in moving))
    n = th.size

    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        found = solve(p, th, moving, w, e, given=given, torque=torque is not None, groove=in_shaft)
    dead = np.abs(found.ratio) <= DEAD_CENTRE * p.a1 if torque is not None else np.zeros(n, dtype=bool)
    m, r = found.motion, found.reactions

    def masked(values: Any, undetermined: bool = True) -> MaskedArray:
        whole = _joined(values, n) if isinstance(values, Vector) else np.broadcast_to(values, (n,)).astype(float)
        mask = dead if undetermined else np.zeros(n, dtype=bool)
        if whole.ndim == 2:
            mask = np.repeat(mask[:, None], 3, axis=1)
        return np.ma.MaskedArray(np.where(mask, np.nan, whole), mask=mask, fill_value=np.nan)

    reasons = [
        (int(i), f"{what} at crank angle {th[i]:.9g} rad ({degrees(th[i]):.4f} deg): {why}")
        for flags, what, why in _undetermined(dead, found.position, p)
        for i in np.flatnonzero(flags)
    ]
    return ForceTurn(
        parameters=parameters,
        law=shift,
        sought=SLIDER_FORCE if torque is not None else TORQUE,
        angle=th,
        speed=w,
        acceleration=e,
        shift=moving.shift,
        shift_velocity=moving.velocity,
        shift_acceleration=moving.acceleration,
        slider_position=found.position.s4,
        slider_velocity=m.slider_velocity,
        slider_acceleration=m.slider_acceleration,
        torque=masked(given if torque is not None else m.torque, undetermined=False),
        slider_force=masked(found.load),
        axial_force=masked(r.axial),
        applied_axial_force=masked(m.force),
        ratio=found.ratio,
        reasons=tuple(reasons),
        unreachable=unreachable,
        # the slider's mass times its acceleration has no part in the load
        _joints=MappingProxyType({name: masked(getattr(r, name), name != "guide_moment") for name in JOINTS}),
        _position=found.position,
    )


def forces_at(
    parameters: SliderCrankParameters,
    angle: float,
    *,
    crank_speed: float,
    crank_acceleration: float = 0.0,
    shift: ShiftLaw = _STILL,
    load: float | None = None,
    torque: float | None = None,
) -> ForceInstant:
    """`force_turn` at one crank angle (rad).

    Raises
    ------
    InputError, AssemblyError
        As `force_turn`.
    """
    turn = force_turn(
        parameters,
        crank_speed=crank_speed,
        crank_acceleration=crank_acceleration,
        shift=shift,
        angles=[angle],
        load=load,
        torque=torque,
    )

    def determined(values: MaskedArray) -> float | None:
        return None if np.ma.getmaskarray(values)[0] else float(values[0])

    def components(name: str) -> Vector | None:
        row = turn.vector(name)[0]
        return None if np.ma.getmaskarray(row).any() else Vector(*row.tolist())

    return ForceInstant(
        angle=float(turn.angle[0]),
        shift=float(turn.shift[0]),
        slider_position=float(turn.slider_position[0]),
        slider_velocity=float(turn.slider_velocity[0]),
        slider_acceleration=float(turn.slider_acceleration[0]),
        torque=float(turn.torque[0]),
        slider_force=determined(turn.slider_force),
        axial_force=determined(turn.axial_force),
        vectors=MappingProxyType({name: components(name) for name in JOINTS}),
        reason="; ".join(why for _, why in turn.reasons),
    )


def _numbers(value: ArrayLike, wanted: str) -> FloatArray:
    """An array of floats."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(wanted) from None


def _each(name: str, value: ArrayLike, n: int) -> FloatArray:
    """A finite value for each of n angles."""
    values = _numbers(value, f"{name} is {value!r}: it must be a number in SI or an array of them")
    if values.shape not in ((), (1,), (n,)):
        raise InputError(f"{name} has the shape {values.shape}: it must be a number or have one for each of {n} angles")
    if not np.isfinite(values).all():
        raise InputError(f"{name} is {value!r}: it must be finite")
    return np.broadcast_to(values, (n,)).copy()


def _joined(vector: Vector, n: int) -> FloatArray:
    """Components as an array (n, 3)."""
    return np.stack([np.broadcast_to(x, (n,)) for x in vector], axis=-1).astype(float)


def _parallel(q: Position, p: Constants) -> NDArray[np.bool_]:
    """Where the rod is parallel to the crank axis."""
    r = on_arrays().rod(q, p)
    return np.asarray(np.hypot(r.x, r.y) <= _PARALLEL * p.a2)


def _undetermined(dead: NDArray[np.bool_], q: Position, p: Constants) -> tuple[tuple[NDArray[np.bool_], str, str], ...]:
    """Where something is masked, what there is, and why."""
    return (
        (dead, "dead centre", "the slider's force has no lever on the crank, so that the torque does not determine it"),
        (_parallel(q, p), "the rod is parallel to the crank axis", "frame 3 has no direction across it"),
    )


def _deg(angle: float) -> str:
    return f"{degrees(float(angle)):.4f}"


def _not_assembled(
    parameters: SliderCrankParameters, law: ShiftLaw, th: FloatArray, s1: FloatArray, reached: NDArray[np.bool_]
) -> AssemblyError:
    """What to raise where the rod does not reach the guide at all angles."""
    p = parameters.constants()
    square = on_arrays().assembly_square(th, s1, p)
    worst = int(np.argmin(square))
    short = float(np.sqrt(p.a2 * p.a2 - square[worst]) - p.a2)
    by_how_much = f"{short:.6g} m too short" if short > 0.0 else "perpendicular to the guide within the limit"
    places = "; ".join(
        f"{degrees(float(th[first])):.6g} to {degrees(float(th[last])):.6g} deg" for first, last in _runs(~reached)
    )
    repeating = law.repeating(parameters)
    found = mobility.ranges(parameters, repeating) if repeating is not None else ()
    within = "".join(f"; it can turn from {degrees(r.low):.6g} to {degrees(r.high):.6g} deg" for r in found) or (
        "; it can be assembled at no angle" if repeating is not None else ""
    )
    return AssemblyError(
        f"the crank cannot turn over all {th.size} angles: the rod does not reach the guide at {places}, and is at worst "
        f"{by_how_much} at crank angle {th[worst]:.9g} rad ({degrees(float(th[worst])):.4f} deg) and shift "
        f"{s1[worst]:.9g} m{within}"
    )


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2])]


def _located(turn: ForceTurn, low: float, high: float, *, along: bool) -> tuple[DeadCentre, ...]:
    """Zeros of the slider's velocity ``along`` the law of the shift, or with the shift held, from ``low`` to ``high``."""
    repeating = turn.law.repeating(turn.parameters)
    if repeating is None:
        return _sign_changes(turn, low, high, 1.0 if along else 0.0)
    find = mobility.dead_centres if along else mobility.singularities
    found = find(turn.parameters, repeating)
    moved = (c._replace(crank_angle=c.crank_angle + more) for more in _turns(low, high, repeating.span) for c in found)
    return tuple(centre for centre in moved if low <= centre.crank_angle <= high)


def _limits(turn: ForceTurn, low: float, high: float) -> tuple[float, ...]:
    """Ends of the ranges of assembly from ``low`` to ``high`` (rad)."""
    repeating = turn.law.repeating(turn.parameters)
    if repeating is None:
        square = _along(turn).square
        at = _places(low, high)
        reached = square(at) > 0.0
        return tuple(
            float(brentq(lambda x: float(square(np.array([x]))[0]), at[i], at[i + 1], xtol=1e-14))
            for i in np.flatnonzero(reached[1:] != reached[:-1])
        )
    parts = mobility.ranges(turn.parameters, repeating)
    ends = {end for part in parts if not part.full(repeating.span) for end in (part.low, part.high)}
    moved = (end + more for more in _turns(low, high, repeating.span) for end in ends)
    return tuple(sorted(end for end in moved if low <= end <= high))


def _turns(low: float, high: float, span: float) -> list[float]:
    """What angles in [0, 2 span] are moved by to have all of them from ``low`` to ``high``."""
    return [span * n for n in range(ceil(low / span) - 2, ceil(high / span) + 1)]


def _places(low: float, high: float) -> FloatArray:
    """Angles between which signs are compared."""
    return np.linspace(low, high, ceil((high - low) / tau * _PIECES) + 1)


class _Along(NamedTuple):
    """Functions of crank angles (n,): the law's shift, and what is positive where the rod reaches the guide (m2)."""

    shift: Callable[[FloatArray], ShiftMotion]
    square: Callable[[FloatArray], FloatArray]
    speed: float


def _along(turn: ForceTurn) -> _Along:
    # the slope of the shift by the angle does not depend on the speed but under a law by time, which takes no other
    speed = float(turn.speed[0]) or 1.0
    f, p = on_arrays(), turn.parameters.constants()

    def shift(angle: FloatArray) -> ShiftMotion:
        return turn.law.at(angle, np.full(angle.shape, speed), np.zeros(angle.shape))

    def square(angle: FloatArray) -> FloatArray:
        return np.asarray(f.assembly_square(angle, shift(angle).shift, p))

    return _Along(shift, square, speed)


def _sign_changes(turn: ForceTurn, low: float, high: float, pitch: float) -> tuple[DeadCentre, ...]:
    """Zeros of kth + ``pitch`` S1' ks, at 1440 places in the turn and more closely where the sign changes."""
    f, p = on_arrays(), turn.parameters.constants()
    shift, square, speed = _along(turn)

    def slope(angle: FloatArray) -> FloatArray:
        moving = shift(angle)
        k = f.coefficients(f.position(angle, moving.shift, p), p)
        return np.asarray(k.kth + pitch * moving.velocity / speed * k.ks)

    at = _places(low, high)
    reached = square(at) > (LIMIT_SINE * p.a2) ** 2
    values = np.zeros(at.shape)
    values[reached] = slope(at[reached])
    positive = values > 0.0
    found = []
    for i in np.flatnonzero((positive[1:] != positive[:-1]) & reached[1:] & reached[:-1]):
        angle = brentq(lambda x: float(slope(np.array([x]))[0]), at[i], at[i + 1], xtol=1e-14)
        moving = shift(np.array([angle]))
        q = f.position(np.array([angle]), moving.shift, p)
        outer = bool(positive[i]) == (p.branch > 0.0)
        found.append(DeadCentre(float(angle), float(moving.shift[0]), float(q.s4[0]), outer))
    return tuple(found)
