"""Solve the two force problems of the generalised slider-crank: all joint forces and moments of a motion over the turn.

Crank and shift move as prescribed, so that the axial force on the crank is an unknown (Rahman prescribes it, erratum 7).
Either the slider's load L is given and the crank's torque T is sought, or the torque is given and the load is sought (the
thesis's problem). Load and torque are related by the crank's equation of motion

    T = T0 - kth L,    kth = dS4/dtheta1 with the shift held constant,

where T0 is the torque without load. The first problem is therefore regular wherever the mechanism can be assembled, and the
second has a pole where kth = 0: at the dead centres, where the slider's force has no lever arm about the crank axis. The
values there are masked; `ForceTurn.mask_reasons` gives the reason.

The equations are the plant's own (`linkwork.slider_crank.dynamics`), evaluated on arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import degrees, radians, tau
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError
from linkwork.limits import LIMIT_SINE
from linkwork.slider_crank.dynamics import Inputs
from linkwork.slider_crank.kinematics import Position
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters
from linkwork.slider_crank.vectors import Vector

from ..display import format_range
from ..numerics.tracing import ReboundFunctions
from ..run import complete_speed, float_array, require_kind, takes_published
from ..units import Amount, in_si
from . import mobility, quantities
from .mobility import DeadCentre
from .quantities import JOINTS, FloatArray, MaskedArray, array_per_angle, masked_array
from .shifts import ConstantShift, Course, ShiftLaw, ShiftMotion, has_shaft_groove, plant_functions, with_groove

#: Default number of angles over the turn: one for every degree, both ends included.
SAMPLES = 361
#: Sine of the angle between rod and crank axis below which frame 3 has no direction.
_PARALLEL = 1e-12
#: Least angle (deg) from a singularity or a limit of assembly at which a value is reported as an extreme, and drawn.
CLEAR_DEG = 10.0
#: Reason why the slider force cannot be found at any angle.
NO_LEVER = "the slider has no lever on the crank at any angle, so that the torque determines no force on it"
#: Reason why the slider force cannot be found at a dead centre.
_NO_LEVER_HERE = "the slider's force has no lever on the crank, so that the torque does not determine it"
#: The shift by default.
_STILL = ConstantShift(0.0)
#: Values of `ForceTurn.sought`.
TORQUE, SLIDER_FORCE = "torque", "slider force"


class Solution(NamedTuple):
    """Result of `solve`: position, velocity coefficients, motion, reactions, load (N), ratio (m); arrays or dual numbers."""

    position: Any
    coefficients: Any
    motion: Any
    reactions: Any
    load: Any
    ratio: Any


def solve(
    f: ReboundFunctions,
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
    """Solve one of the force problems at configurations that can be assembled, on arrays, dual numbers or symbols.

    ``f`` are the plant's equations for arrays, dual numbers or symbols. The other arguments are constants, theta1 (rad), the
    shift's motion, theta1' (rad/s) and theta1'' (rad/s2). ``given`` is the load (N) or, if ``torque`` is true, the torque
    (N.m); in the second case the load is sought, which is not finite where the ratio is zero. ``groove`` says whether the
    parameters' groove makes the shift. The ratio is minus the derivative of the torque with respect to the load (m): kth, or
    dS4/dtheta1 if a groove in the shaft makes the shift.
    """
    q = f.position(angle, shift.shift, p)
    k = f.coefficients(q, p)
    x = (angle, shift.shift, speed, shift.velocity, 0.0, 0.0)
    grooved = 1.0 if groove else 0.0
    inputs = Inputs(1.0, 1.0 - grooved, grooved, 0.0, acceleration, 0.0, shift.acceleration, 0.0)
    ratio = k.kth + grooved * f.groove(angle, p).pitch * k.ks
    if not torque:
        inputs = inputs._replace(load=given)
    m = f.motion(q, k, x, inputs, p)
    if torque:
        inputs = inputs._replace(load=(m.torque - given) / ratio)
        loaded = f.motion(q, k, x, inputs, p)
        # the load changes no acceleration; in their formulas an infinite one, times 0, would give NaN
        m = m._replace(torque=loaded.torque, force=loaded.force, groove_force=loaded.groove_force)
    return Solution(q, k, m, f.reactions(q, x, m, inputs, p), inputs.load, ratio)


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceTurn:
    """Motion and all joint forces and moments over the turn, in one of the force problems.

    Attributes
    ----------
    parameters : SliderCrankParameters
    law : ShiftLaw
        Law of the axial shift.
    sought : str
        "torque" or "slider force".
    angle, speed, acceleration : ndarray, shape (n,)
        theta1 (rad), theta1' (rad/s), theta1'' (rad/s2).
    shift, shift_velocity, shift_acceleration : ndarray, shape (n,)
        Axial shift of the crank and its rates (m, m/s, m/s2).
    slider_position, slider_velocity, slider_acceleration : ndarray, shape (n,)
        Motion of the slider (m, m/s, m/s2).
    torque : masked array, shape (n,)
        Torque of the drive on the crank (N.m).
    slider_force : masked array, shape (n,)
        Load on the slider (N), positive in the direction in which the slider position increases, -k of frame 4; the forces of
        spring, damper and friction are not part of it. A load that is sought is masked at dead centres.
    axial_force : masked array, shape (n,)
        Total force on the crank along its axis (N): drive of the shift, spring and damper together.
    applied_axial_force : masked array, shape (n,)
        Axial force of the drive that moves or holds the shift (N): without the spring and the damper.
    ratio : ndarray, shape (n,)
        Lever arm of the slider's force about the crank axis, -dT/dL (m): kth, or dS4/dtheta1 with a groove in the shaft.
    unreachable : ndarray, shape (m,)
        Requested crank angles (rad) that were left out because the rod does not reach the guide there.
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
    unreachable: FloatArray
    _joints: Mapping[str, MaskedArray]
    _position: Position

    def __repr__(self) -> str:
        left_out = f", {len(self.unreachable)} left out: not assembled" if len(self.unreachable) else ""
        torque, force = (
            format_range(x.compressed(), unit) for x, unit in ((self.torque, "N.m"), (self.slider_force, "N"))
        )
        found = f"crank torque {torque}, slider force {force}"
        return f"<ForceTurn: {len(self)} crank angles{left_out}; {self.sought} sought; {found}>"

    def __len__(self) -> int:
        return len(self.angle)

    @property
    def _course(self) -> Course:
        return Course(self.parameters, self.law, float(self.speed[0]))

    @property
    def _span(self) -> tuple[float, float]:
        return float(self.angle.min()), float(self.angle.max())

    @cached_property
    def dead_centres(self) -> tuple[DeadCentre, ...]:
        """Return the dead centres of the slider between the first and the last angle, exact to rounding errors."""
        return self._course.zeros(*self._span, held=False)

    @cached_property
    def singularities(self) -> tuple[DeadCentre, ...]:
        """Return the configurations between first and last angle in which the torque does not determine the slider force.

        There ``ratio`` is zero. These configurations are the dead centres, unless the shift moves without a groove in the
        shaft.
        """
        return self._course.zeros(*self._span, held=not has_shaft_groove(self.law))

    @cached_property
    def limits(self) -> tuple[float, ...]:
        """Return the crank angles (rad) between the first and the last given angle at which a range of assembly ends.

        At these angles rod and guide are perpendicular. Velocity, acceleration and all forces grow without bound near them.
        """
        asked = np.concatenate([self.angle, self.unreachable])
        return self._course.limits(float(asked.min()), float(asked.max()))

    @cached_property
    def breaks(self) -> tuple[int, ...]:
        """Return each index i such that the mechanism cannot be assembled somewhere between angles i and i + 1."""
        outside = np.sort(np.concatenate([self.unreachable, self.limits]))
        low, high = np.minimum(self.angle[:-1], self.angle[1:]), np.maximum(self.angle[:-1], self.angle[1:])
        between = np.searchsorted(outside, high) - np.searchsorted(outside, low, side="right")
        return tuple(int(i) for i in np.flatnonzero(between > 0))

    @property
    def without_lever(self) -> bool:
        """Return whether the slider force is unknown and has no lever arm about the crank axis at any angle."""
        return bool(np.ma.getmaskarray(self.slider_force).all()) and not self.singularities

    @property
    def _parallel(self) -> NDArray[np.bool_]:
        """Return a mask (n,) of the angles at which the rod is parallel to the crank axis."""
        p = self.parameters.constants()
        r = plant_functions().rod(self._position, p)
        return np.asarray(np.hypot(r.x, r.y) <= _PARALLEL * p.a2)

    @cached_property
    def mask_reasons(self) -> tuple[str, ...]:
        """Return sentences that say where values are masked and why, one for each group of consecutive angles."""
        sentences = [NO_LEVER] if self.without_lever else []
        dead = np.ma.getmaskarray(self.slider_force) & (not sentences)
        for flags, what, why in (
            (dead, "dead centre", _NO_LEVER_HERE),
            (self._parallel, "the rod is parallel to the crank axis", "frame 3 has no direction across it"),
        ):
            for first, last in _runs(flags):
                place = f"crank angle {_degrees_text(self.angle[first])} deg"
                if last > first:
                    ends = f"{_degrees_text(self.angle[first])} to {_degrees_text(self.angle[last])} deg"
                    place = f"all {last - first + 1} crank angles from {ends}"
                sentences.append(f"{what} at {place}: {why}")
        return tuple(sentences)

    def clear(self, degrees: float = CLEAR_DEG, *, poles: bool = True) -> NDArray[np.bool_]:
        """Return a mask (n,) of the angles that are further than ``degrees`` from every angle at which forces become infinite.

        Forces become infinite (poles) at the limits of assembly and, if the slider force is unknown, at the singularities.
        If ``poles`` is False, only the limits of assembly count. Poles before the first and after the last angle also count.
        """
        away = radians(degrees)
        low, high = self._span
        reach = low - away, high + away
        places = list(self._course.limits(*reach))
        if poles and self.sought == SLIDER_FORCE:
            places += [c.crank_angle for c in self._course.zeros(*reach, held=not has_shaft_groove(self.law))]
        distances = np.abs(self.angle[:, None] - np.array(places)[None, :])
        return np.asarray((distances > away).all(axis=1))

    def vector(self, name: str, frame: int = 1) -> MaskedArray:
        """Return the components of a force or moment, masked where it is undetermined.

        Parameters
        ----------
        name : str
            ``bearing``: force of the bearing on the crank, without axial component; ``bearing_moment``: its moment about the
            ground's origin O, the torque of the drive included; ``crank_pin``: force of the crank on the rod; ``slider_pin``:
            force of the slider on the rod; ``guide``: force of the guide on the slider; ``guide_moment``: its moment about the
            slider pin.
        frame : int
            1 ground; 2 crank, i towards the crank pin; 3 rod, i along the rod from crank pin to slider pin, j perpendicular to
            rod and crank axis; 4 guide, the slider position increases along -k. Moments stay about the same points.

        Returns
        -------
        masked array, shape (n, 3)
            N or N.m.

        Raises
        ------
        InputError
            If there is no such vector or frame.
        """
        quantities.check_joint(name, frame)
        ground = self._joints[name]
        if frame == 1:
            return ground.copy()
        f, p, q = plant_functions(), self.parameters.constants(), self._position
        components = Vector(*ground.filled(0.0).T)
        mask = np.ma.getmaskarray(ground)
        if frame == 2:
            turned = f.to_crank_frame(components, q)
        elif frame == 4:
            turned = f.to_guide_frame(components, p)
        else:
            with np.errstate(divide="ignore", invalid="ignore"):
                turned = f.to_rod_frame(components, q, p)
            mask = mask | self._parallel[:, None]
        return np.ma.MaskedArray(_stack_components(turned, len(self)), mask=mask, fill_value=np.nan)

    def columns(self, units: str = "SI") -> dict[str, FloatArray]:
        """Return all quantities as columns of a file, by name with unit; masked values are NaN, the last two columns say why.

        Parameters
        ----------
        units : str
            "SI", or "inch": degrees, inches, seconds and pounds force, as the thesis prints them.

        Raises
        ------
        InputError
            If there are no such units.
        """
        known = quantities.unit_table(units)
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
        parts += [
            (f"{name.replace('_', ' ')} {axis} in frame {frame}", joint.unit, values)
            for frame in range(1, 5)
            for name, joint in JOINTS.items()
            for axis, values in zip("ijk", self.vector(name, frame).T)
        ]
        columns = {f"{name} [{known[unit][0]}]": np.ma.filled(x, np.nan) / known[unit][1] for name, unit, x in parts}
        return columns | {
            "dead centre (1): forces not determined": np.ma.getmaskarray(self.slider_force).astype(float),
            "rod parallel to crank axis (1): frame 3 not determined": self._parallel.astype(float),
        }


@takes_published(
    crank_speed=complete_speed,
    # a set of another mechanism, which has no shift, is refused below
    shift=lambda known, shift: ConstantShift(getattr(known.initial, "shift_position", 0.0)) if shift is None else shift,
)
@in_si(crank_speed="rad/s", crank_acceleration="rad/s2", angles="rad", load="N", torque="N.m")
def force_turn(
    parameters: Any,
    *,
    crank_speed: ArrayLike | None = None,
    crank_acceleration: ArrayLike = 0.0,
    shift: ShiftLaw = _STILL,
    angles: ArrayLike | None = None,
    load: ArrayLike | Amount = None,
    torque: ArrayLike | Amount = None,
    partial: bool = False,
) -> ForceTurn:
    """Compute forces and moments in all joints over the turn for a prescribed motion of crank and shift.

    Parameters
    ----------
    parameters : SliderCrankParameters
        Parameters, or a published set or its name. A set also provides defaults of crank speed and shift.
    crank_speed, crank_acceleration : array_like, scalar or shape (n,)
        theta1' (rad/s), theta1'' (rad/s2). Here and below, a number may be given as text with its unit, such as "50 rpm".
    shift : ShiftLaw
        `ConstantShift`, `GrooveShift`, `AngleShift`, `TimeShift` or another law; by default the shift is 0. The groove in the
        parameters is not used.
    angles : array_like, shape (n,), optional
        Crank angles (rad); 361 over the turn by default.
    load : array_like, scalar or shape (n,), optional
        Force on the slider (N), positive in the direction in which its position increases, 0 by default; the torque is
        computed.
    torque : array_like, scalar or shape (n,), optional
        Torque of the drive on the crank (N.m); the load on the slider is computed. Not together with ``load``.
    partial : bool
        Whether to leave out the angles at which the rod does not reach the guide; ``unreachable`` lists them.

    Raises
    ------
    InputError
        If the parameters are not those of a slider-crank, the crank speed is missing, both ``load`` and ``torque`` are given, a
        value is not finite or has the wrong shape, or ``shift`` is not a `ShiftLaw`.
    AssemblyError
        If the rod does not reach the guide at some angle; the message gives the ranges in which it does. If ``partial`` is
        true, only if the rod reaches the guide at no angle.

    Examples
    --------
    >>> from analysis import force_turn
    >>> turn = force_turn("rahman-a4-10-s1-3.5", load="-20 lbf")
    >>> f"{turn.torque.max():.2f} N.m"
    '45.93 N.m'
    """
    require_kind(
        parameters,
        SliderCrankParameters,
        "parameters",
        "SliderCrankParameters or a set of them, such as 'rahman-ideal'; simulate has the joint forces of any mechanism",
    )
    if crank_speed is None:
        raise InputError("the crank speed is missing: only a published set brings its own")
    if load is not None and torque is not None:
        raise InputError("both load and torque are given: give one of them, and the other is computed")
    if not isinstance(shift, ShiftLaw):
        raise InputError(
            f"the shift is {shift!r}: it must be a law of the shift, such as ConstantShift(0.01) or GrooveShift(0.01, 2.0)"
        )
    th = _crank_angles(angles)
    n = th.size
    w, e = array_per_angle("crank_speed", crank_speed, n), array_per_angle("crank_acceleration", crank_acceleration, n)
    known, value = ("load", 0.0 if load is None else load) if torque is None else ("torque", torque)
    given = array_per_angle(known, value, n)
    shifts = shift.at(th, w, e)._asdict()
    moving = ShiftMotion(*(array_per_angle(f"the shift law's {name}", x, n) for name, x in shifts.items()))
    f, p = plant_functions(), with_groove(parameters.constants(), shift)
    reached = f.assembly_square(th, moving.shift, p) >= (LIMIT_SINE * p.a2) ** 2
    if not (reached.any() if partial else reached.all()):
        raise _assembly_error(parameters, shift, th, moving.shift, reached)
    unreachable = th[~reached]
    th, w, e, given = (x[reached] for x in (th, w, e, given))
    moving = ShiftMotion(*(x[reached] for x in moving))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        found = solve(f, p, th, moving, w, e, given=given, torque=torque is not None, groove=has_shaft_groove(shift))
    n, m, r = th.size, found.motion, found.reactions
    never = np.zeros(n, dtype=bool)
    dead = never if torque is None else np.abs(found.ratio) <= quantities.DEAD_CENTRE * p.a1

    def scalar(values: Any, where: NDArray[np.bool_] = dead) -> MaskedArray:
        return masked_array(np.broadcast_to(values, (n,)), where)

    # the moment on the guide does not depend on the load
    masks = {name: (never if name == "guide_moment" else dead)[:, None] for name in JOINTS}
    joints = {name: masked_array(_stack_components(getattr(r, name), n), mask) for name, mask in masks.items()}
    return ForceTurn(
        parameters=parameters,
        law=shift,
        sought=TORQUE if torque is None else SLIDER_FORCE,
        angle=th,
        speed=w,
        acceleration=e,
        shift=moving.shift,
        shift_velocity=moving.velocity,
        shift_acceleration=moving.acceleration,
        slider_position=found.position.s4,
        slider_velocity=m.slider_velocity,
        slider_acceleration=m.slider_acceleration,
        torque=scalar(m.torque if torque is None else given, never),
        slider_force=scalar(found.load),
        axial_force=scalar(r.axial),
        applied_axial_force=scalar(m.force),
        ratio=found.ratio,
        unreachable=unreachable,
        _joints=MappingProxyType(joints),
        _position=found.position,
    )


def _crank_angles(angles: ArrayLike | None) -> FloatArray:
    """Return the given crank angles as an array (n,), or `SAMPLES` angles over a turn."""
    if angles is None:
        return np.linspace(0.0, tau, SAMPLES)
    message = "the angles must be a list of finite numbers (rad), at least one"
    th = np.atleast_1d(float_array(angles, f"{message}, not {angles!r}"))
    if th.ndim != 1 or th.size == 0 or not np.isfinite(th).all():
        raise InputError(message)
    return th


def _stack_components(vector: Vector, n: int) -> FloatArray:
    """Return the components of a vector as an array (n, 3)."""
    return np.stack([np.broadcast_to(x, (n,)) for x in vector], axis=-1).astype(float)


def _degrees_text(angle: float) -> str:
    return f"{degrees(float(angle)):.4f}"


def _assembly_error(
    parameters: SliderCrankParameters, law: ShiftLaw, th: FloatArray, s1: FloatArray, reached: NDArray[np.bool_]
) -> AssemblyError:
    """Return the error of crank angles at which the rod does not reach the guide, with the ranges in which it does."""
    p = parameters.constants()
    square = plant_functions().assembly_square(th, s1, p)
    worst = int(np.argmin(square))
    short = float(np.sqrt(p.a2 * p.a2 - square[worst]) - p.a2)
    by_how_much = f"{short:.6g} m too short" if short > 0.0 else "perpendicular to the guide within the limit"
    places = "; ".join(
        f"{degrees(float(th[first])):.6g} to {degrees(float(th[last])):.6g} deg" for first, last in _runs(~reached)
    )
    repeating = law.periodic_shift(parameters)
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
    """Return the first and the last index of each group of consecutive true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2])]
