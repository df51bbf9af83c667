"""Compute the effect of manufacturing tolerances on the slider-crank: exact sensitivities, estimates of the spread.

The nominal mechanism and its motion are a `ForceTurn`. An error is added to one dimension, mass or setting; all other values
and the motion of the crank stay the same. The derivatives are exact: the plant's own equations are evaluated on dual
numbers (`analysis.numerics.dual`).

The linear estimate adds the variances of independent errors, each times the square of its derivative. It fails where the
derivatives vanish: at the ideal mechanism (S1 = a4 = 0, alpha4 = 270 deg) the slider's position is of the second order in S1
and alpha4 at every angle, and in a4 at 90 and 270 deg. Therefore there is also an estimate to second order. A Monte Carlo
analysis (`sampling`) evaluates the same equations on random samples and shows where the linear estimate fails.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from math import isfinite, sqrt
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.parameters import field_name
from linkwork.slider_crank import variables
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters

from ..display import format_range
from ..files import unknown_name
from ..numerics.dual import Dual, dual
from ..numerics.dual import variables as independent
from ..numerics.tracing import ReboundFunctions
from ..run import require_kind, require_list
from ..units import Amount, si
from .forces import SLIDER_FORCE, ForceTurn, solve
from .quantities import JOINTS, FloatArray, MaskedArray, masked_array
from .shifts import GrooveShift, ShiftMotion, groove_motion, has_shaft_groove, plant_functions

#: Settings that may be in error besides the mechanism's parameters: the crank angle and the axial shift, by output name.
ANGLE, SHIFT = "crank.angle", "shift.position"
#: The errors for which sensitivities are computed by default: theta1, S1, a1, a2, a4, alpha4.
DIMENSIONS = (ANGLE, SHIFT, "crank.length", "rod.length", "guide.offset", "guide.twist")
_ERRORS = {
    v.name: v
    for v in variables.VARIABLES
    if v.name in (ANGLE, SHIFT)
    or (
        v.kind == "Real"
        and field_name(v.name) in SliderCrankParameters.__dataclass_fields__
        and not v.name.startswith("groove.")
    )
}
#: Names of all parameters and settings that may be in error, with their units; and their symbols in the thesis, if any.
ERRORS: Mapping[str, str] = MappingProxyType({name: v.unit for name, v in _ERRORS.items()})
SYMBOLS: Mapping[str, str] = MappingProxyType({name: v.symbol for name, v in _ERRORS.items() if v.symbol})

#: Quantities that do not depend on forces.
KINEMATIC = ("slider.position", "slider.velocity", "slider.acceleration")
#: Vector of `Reactions` and its component, by the name of the output in the FMI interface.
_COMPONENTS = {
    f"{vector.removesuffix('_moment')}.{'m' if vector.endswith('_moment') else 'f'}{axis}": (vector, axis)
    for vector in JOINTS
    for axis in "xyz"
}
#: All quantities that have sensitivities, by the names of the FMI interface, with their units. Vectors are in the ground
#: frame, the moment of the bearing about O; bearing.fz is the axial force. In the thesis's problem, where the torque is given,
#: drive.applied_torque has no sensitivity and slider.load is the force that is sought.
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        v.name: v.unit
        for v in variables.VARIABLES
        if v.name in (*KINEMATIC, *_COMPONENTS, "drive.applied_torque", "slider.load")
    }
)
#: Quantities that do not depend on the load if it is sought, and are therefore determined at a dead centre, too.
FREE_OF_LOAD = (*KINEMATIC, "drive.applied_torque", "guide.mx", "guide.my", "guide.mz")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivities:
    """Exact first derivatives of quantities with respect to errors, at the n angles of a turn.

    Attributes
    ----------
    turn : ForceTurn
        The nominal mechanism and its motion.
    names : tuple of str
        Names of the m errors.
    values : mapping
        Nominal values of each quantity, by name: masked array (n,).
    derivatives : mapping
        Derivatives of each quantity with respect to the errors, by the name of the quantity: masked array (m, n), in the unit
        of the quantity divided by that of the error. If the load is unknown, quantities that depend on it are masked at the
        dead centres.
    """

    turn: ForceTurn
    names: tuple[str, ...]
    values: Mapping[str, MaskedArray]
    derivatives: Mapping[str, MaskedArray]

    def __repr__(self) -> str:
        return f"<Sensitivities of {', '.join(self.derivatives)} to {', '.join(self.names)} at {len(self.turn)} crank angles>"

    def derivative(self, quantity: str, error: str) -> MaskedArray:
        """Return the derivative of a quantity with respect to an error, shape (n,).

        Raises
        ------
        ParameterError
            If there is no such quantity or error in this result.
        """
        check_names((quantity,), self.derivatives, "quantity")
        check_names((error,), self.names, "error")
        return cast(MaskedArray, self.derivatives[quantity][self.names.index(error)])


def sensitivities(
    turn: ForceTurn, errors: Sequence[str] = DIMENSIONS, quantities: Sequence[str] = tuple(QUANTITIES)
) -> Sensitivities:
    """Compute the derivatives of motion, torque and joint forces with respect to dimensions, masses and settings.

    Parameters
    ----------
    turn : ForceTurn
        The nominal mechanism. The motion of the crank, the rates of the shift, and the given load or torque are held constant.
        An error of the crank angle does not change the shift, unless a groove in the shaft makes it; an error of a length does
        not change masses, centres of mass or moments of inertia.
    errors : sequence of str
        Names of `ERRORS`; by default `DIMENSIONS`.
    quantities : sequence of str
        Names of `QUANTITIES`; by default all.

    Raises
    ------
    ParameterError
        If an error or a quantity does not exist.
    InputError
        If an error is given more than once.
    """
    require_turn(turn)
    check_names(errors, ERRORS, "error")
    check_names(quantities, QUANTITIES, "quantity")
    # the last error of a name would take the derivatives from the others
    for name in errors:
        if (times := list(errors).count(name)) > 1:
            raise InputError(f"{name} is given {times} times: give it once")
    n, m = len(turn), len(errors)
    found, _ = perturb(turn, error_variables(errors, n)).evaluate(quantities)
    values, derivatives = {}, {}
    for name in quantities:
        # at a dead centre quantities that depend on an unknown load are undetermined
        x, dead = dual(found[name]), np.ma.getmaskarray(turn.slider_force) & (name not in FREE_OF_LOAD)
        values[name] = masked_array(np.broadcast_to(x.real, (n,)), dead)
        derivatives[name] = masked_array(np.broadcast_to(x.dual, (m, n)), dead)
    return Sensitivities(
        turn=turn, names=tuple(errors), values=MappingProxyType(values), derivatives=MappingProxyType(derivatives)
    )


class Instant(NamedTuple):
    """Nominal motion, and the given load or torque, at points of a turn: numbers, arrays or symbols."""

    angle: Any
    speed: Any
    acceleration: Any
    shift: Any
    shift_velocity: Any
    shift_acceleration: Any
    given: Any


@dataclass(frozen=True, slots=True)
class PerturbedTurn:
    """Mechanism and motion with errors, at points of a turn: constants, crank angle and shift.

    ``load_sought`` and ``grooved`` say which force problem is solved, as ``torque`` and ``groove`` of `forces.solve`.
    """

    load_sought: bool
    grooved: bool
    nominal: Instant
    p: Constants
    angle: Any
    moving: ShiftMotion
    functions: ReboundFunctions

    @property
    def assembly_square(self) -> Any:
        """Return squared rod length minus squared distance of pin from guide (m2); positive if the rod reaches the guide."""
        return self.functions.assembly_square(self.angle, self.moving.shift, self.p)

    def evaluate(self, quantities: Collection[str]) -> tuple[dict[str, Any], Any]:
        """Return the values of quantities by name, and the lever arm of the slider's force about the crank axis (m).

        Forces are computed only if a quantity depends on them; otherwise the lever arm is 0.
        """
        p, moving = self.p, self.moving
        w, e, given = self.nominal.speed, self.nominal.acceleration, self.nominal.given
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if set(quantities) <= set(KINEMATIC):
                return self._motion(quantities, w, e), 0.0
            f, torque, groove = self.functions, self.load_sought, self.grooved
            s = solve(f, p, self.angle, moving, w, e, given=given, torque=torque, groove=groove)
        found = {
            "slider.position": s.position.s4,
            "slider.velocity": s.motion.slider_velocity,
            "slider.acceleration": s.motion.slider_acceleration,
            "drive.applied_torque": given if self.load_sought else s.motion.torque,
            "slider.load": s.load,
        }
        found |= {name: getattr(getattr(s.reactions, vector), axis) for name, (vector, axis) in _COMPONENTS.items()}
        found["bearing.fz"] = s.reactions.axial
        return {name: found[name] for name in quantities}, s.ratio

    def _motion(self, quantities: Collection[str], w: Any, e: Any) -> dict[str, Any]:
        f, p, moving = self.functions, self.p, self.moving
        q = f.position(self.angle, moving.shift, p)
        found = {"slider.position": q.s4}
        if set(quantities) != {"slider.position"}:
            k = f.coefficients(q, p)
            found["slider.velocity"] = k.kth * w + k.ks * moving.velocity
            centripetal = f.centripetal(q, k, w, moving.velocity, p)
            found["slider.acceleration"] = k.kth * e + k.ks * moving.acceleration + centripetal
        return {name: found[name] for name in quantities}


def instant(turn: ForceTurn, at: Any) -> Instant:
    """Return the motion and the given load or torque at the points of a turn with the indices ``at``."""
    given = (turn.torque if turn.sought == SLIDER_FORCE else turn.slider_force).data[at]
    shift = turn.shift[at], turn.shift_velocity[at], turn.shift_acceleration[at]
    return Instant(turn.angle[at], turn.speed[at], turn.acceleration[at], *shift, given)


def nominal_values(turn: ForceTurn) -> dict[str, float]:
    """Return the parameters by field name.

    If the axial shift follows a `GrooveShift`, its amplitude and ratio replace those of the parameters.
    """
    values = {field.name: getattr(turn.parameters, field.name) for field in fields(turn.parameters)}
    if isinstance(turn.law, GrooveShift):
        values |= {"groove_amplitude": turn.law.amplitude, "groove_ratio": turn.law.ratio}
    return values


def perturb(turn: ForceTurn, errors: Mapping[str, Any]) -> PerturbedTurn:
    """Add ``errors``, arrays or dual numbers by name, to the mechanism at all points of the turn."""
    load_sought, grooved = turn.sought == SLIDER_FORCE, has_shaft_groove(turn.law)
    return add_errors(plant_functions(), load_sought, grooved, nominal_values(turn), instant(turn, slice(None)), errors)


def add_errors(
    f: ReboundFunctions,
    load_sought: bool,
    grooved: bool,
    values: Mapping[str, Any],
    nominal: Instant,
    errors: Mapping[str, Any],
) -> PerturbedTurn:
    """Add ``errors`` by name to the parameters ``values`` and to the motion.

    ``f`` are the plant's equations for the type of the errors: arrays, dual numbers or symbols.
    """
    moved = {field_name(name): values[field_name(name)] + x for name, x in errors.items() if name not in (ANGLE, SHIFT)}
    p = f.find(SliderCrankParameters.constants)(SimpleNamespace(**{**values, **moved}))
    angle = nominal.angle + errors.get(ANGLE, 0.0)
    moving = ShiftMotion(nominal.shift, nominal.shift_velocity, nominal.shift_acceleration)
    if grooved:
        moving = groove_motion(f, p, angle, nominal.speed, nominal.acceleration)
    moving = moving._replace(shift=moving.shift + errors.get(SHIFT, 0.0))
    return PerturbedTurn(load_sought, grooved, nominal, p, angle, moving, f)


def error_variables(names: Sequence[str], n: int, moved: int = 0, step: float = 0.0) -> dict[str, Dual]:
    """Return errors at n points by name, as independent dual variables.

    The error with the index ``moved`` has the value ``step``, all others are zero.
    """
    values = np.zeros((len(names), n))
    values[moved] = step
    return dict(zip(names, independent(*values)))


def check_names(names: Sequence[str], known: Collection[str], kind: str) -> None:
    """Check that quantities or errors of these names exist.

    Raises UnknownNameError if one does not, and InputError if a text is given instead of a list.
    """
    require_list(names, kind)
    for name in names:
        if name not in known:
            raise unknown_name(name, known, f"{kind} {name!r}")


# Estimates without samples

#: Standard deviations in the half width of a normal tolerance.
NORMAL_EXTENT = 3.0
#: By distribution: half width divided by standard deviation, and fourth moment divided by the square of the variance.
_DISTRIBUTIONS = {"normal": (NORMAL_EXTENT, 3.0), "uniform": (sqrt(3.0), 1.8), "triangular": (sqrt(6.0), 2.4)}


@dataclass(frozen=True, slots=True)
class Tolerance:
    """A random error of one dimension, mass or setting, independent of all other errors, with zero mean.

    Parameters
    ----------
    name : str
        One of `ERRORS`: a parameter of the mechanism by its FMI name, "shift.position" or "crank.angle".
    half_width : float or str
        Half the width of the tolerance zone, in the SI unit of the quantity in error, or text with a unit, such as "0.1 mm".
        For a normal distribution it is three standard deviations; a few errors then lie outside the zone.
    distribution : str
        "normal", "uniform" or "triangular".

    Raises
    ------
    ParameterError
        If there is no such error.
    InputError
        If the half width is not a finite number above zero, or the distribution is not one of the three.
    """

    name: str
    half_width: Amount
    distribution: str = "normal"

    def __post_init__(self) -> None:
        check_names((self.name,), ERRORS, "error")
        value = si(self.half_width, ERRORS[self.name], f"half width of {self.name}")
        object.__setattr__(self, "half_width", value)
        if self.distribution not in _DISTRIBUTIONS:
            raise InputError(
                f"the distribution of {self.name} is {self.distribution!r}: it must be one of {', '.join(_DISTRIBUTIONS)}"
            )
        if not (isinstance(value, (int, float, np.number)) and isfinite(value) and value > 0.0):
            found = f"{value!r} {ERRORS[self.name]}".rstrip()
            raise InputError(f"the tolerance of {self.name} is {found}: it must be a finite number greater than zero")

    @property
    def deviation(self) -> float:
        """Return the standard deviation."""
        return float(self.half_width) / _DISTRIBUTIONS[self.distribution][0]

    def draw(self, generator: np.random.Generator, samples: int) -> FloatArray:
        """Draw random errors, shape (samples,)."""
        if self.distribution == "normal":
            return generator.normal(0.0, self.deviation, samples)
        if self.distribution == "uniform":
            return generator.uniform(-self.half_width, self.half_width, samples)
        return generator.triangular(-self.half_width, 0.0, self.half_width, samples)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """Estimated effect of m tolerances on one quantity, at the n angles of a turn; masked arrays.

    Attributes
    ----------
    nominal : masked array, shape (n,)
        Nominal value.
    deviation : masked array, shape (n,)
        Standard deviation to first order: the root of the sum of squares of derivative times standard deviation.
    worst : masked array, shape (n,)
        Greatest deviation from the nominal value to first order: every error has the magnitude of its half width, and the worse
        sign.
    shares : masked array, shape (m, n)
        Share of each tolerance in the variance to first order; masked if the variance is only a rounding error.
    second_mean, second_deviation : masked array, shape (n,)
        Mean and standard deviation to second order, from exact first derivatives and finite differences of these derivatives
        over one standard deviation; masked if the mechanism cannot be assembled with errors of this size.
    second_shares : masked array, shape (m, n)
        As ``shares``, to second order; the joint effect of two errors is divided equally between them.

    If the slider's force is sought and the quantity depends on it, all arrays but ``nominal`` are masked at the angles at which
    errors within their half widths can lead to a dead centre: there the quantity has a pole, and so neither mean nor variance.
    """

    nominal: MaskedArray
    deviation: MaskedArray
    worst: MaskedArray
    shares: MaskedArray
    second_mean: MaskedArray
    second_deviation: MaskedArray
    second_shares: MaskedArray

    def __repr__(self) -> str:
        named = {"nominal": self.nominal, "standard deviation": self.deviation, "worst case": self.worst}
        ranges = ", ".join(f"{name} {format_range(x.compressed(), '')}" for name, x in named.items())
        return f"<Estimate at {len(self.nominal)} crank angles, SI: {ranges}>"


def tolerance_effects(
    turn: ForceTurn, tolerances: Sequence[Tolerance], quantities: Sequence[str] = ("slider.position",)
) -> dict[str, Estimate]:
    """Compute the effect of tolerances on each quantity over the turn, to first and second order.

    Raises
    ------
    InputError
        If ``turn`` is not a `ForceTurn`, or there is no tolerance, or two of the same name.
    ParameterError
        If there is no such quantity.

    Examples
    --------
    >>> from analysis import Tolerance, force_turn, tolerance_effects
    >>> turn = force_turn("rahman-a4-10-s1-3.5", angles=["30 deg", "90 deg"])
    >>> effect = tolerance_effects(turn, [Tolerance("rod.length", half_width="0.5 mm")])["slider.position"]
    >>> [f"{1e3 * value:.3f} mm" for value in effect.worst]
    ['0.549 mm', '0.512 mm']
    """
    require_turn(turn)
    names = check_tolerances(tolerances)
    first = sensitivities(turn, names, quantities)
    deviations = np.array([t.deviation for t in tolerances])
    extents = np.array([t.half_width for t in tolerances])
    kurtoses = np.array([_DISTRIBUTIONS[t.distribution][1] for t in tolerances])
    n, m = len(turn), len(names)
    near_pole = _near_pole(turn, names, extents)
    curvatures, reached = _curvatures(turn, tolerances, quantities)
    result = {}
    for name in quantities:
        nominal = first.values[name]
        pole = np.zeros(n, dtype=bool) if name in FREE_OF_LOAD else near_pole
        steps = np.ma.masked_where(np.broadcast_to(pole, (m, n)), first.derivatives[name]) * deviations[:, None]
        variance = (steps**2).sum(axis=0)
        h = 0.5 * (curvatures[name] + curvatures[name].swapaxes(0, 1))
        own = np.einsum("iin->in", h)
        # variance from the squares of the errors, and from the products of two errors
        pairs = (h**2).sum(axis=1) - own**2
        second = steps.filled(np.nan) ** 2 + 0.25 * (kurtoses - 1.0)[:, None] * own**2 + 0.5 * pairs
        whole = second.sum(axis=0)
        lost = np.ma.getmaskarray(nominal) | ~reached | pole
        # shares are masked if all derivatives are rounding errors
        rounding = (1e-15 * nominal.filled(0.0)) ** 2
        vanishing = variance.filled(0.0) <= np.fmax(1e-12 * whole, rounding)
        still = lost | ~(whole > rounding)
        result[name] = Estimate(
            nominal=nominal,
            deviation=np.ma.sqrt(variance),
            worst=np.ma.abs(steps * (extents / deviations)[:, None]).sum(axis=0),
            shares=_share(steps**2, variance, vanishing),
            second_mean=masked_array(nominal.filled(np.nan) + 0.5 * own.sum(axis=0), lost),
            second_deviation=masked_array(np.sqrt(whole), lost),
            second_shares=_share(np.ma.MaskedArray(second), np.ma.MaskedArray(whole), still),
        )
    return result


def require_turn(turn: ForceTurn) -> None:
    """Raise InputError unless ``turn`` is a slider-crank over a turn, the only mechanism with tolerances."""
    wanted = "what force_turn returns, such as force_turn('rahman-ideal'): only SliderCrankParameters have tolerances"
    require_kind(turn, ForceTurn, "turn", wanted)


def check_tolerances(tolerances: Sequence[Tolerance]) -> tuple[str, ...]:
    """Return the names of the tolerances; raise InputError if there is none, or two have the same name."""
    wanted = "a list of Tolerance, such as [Tolerance('rod.length', half_width='0.5 mm')]"
    require_kind(tolerances, Sequence, "tolerances", wanted)
    for number, one in enumerate(tolerances, start=1):
        require_kind(one, Tolerance, f"tolerance {number}", wanted)
    names = tuple(t.name for t in tolerances)
    if not names:
        raise InputError("there is no tolerance: give at least one")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"there are {names.count(name)} tolerances of {name}: give one")
    return names


def _curvatures(
    turn: ForceTurn, tolerances: Sequence[Tolerance], quantities: Sequence[str]
) -> tuple[dict[str, FloatArray], NDArray[np.bool_]]:
    """Return scaled second derivatives, and a mask (n,): whether all varied mechanisms can be assembled.

    The second derivatives are given for each quantity, by name, shape (m, m, n): each times the standard deviations of its
    two errors. They are half the difference between the first derivatives one standard deviation above and below.
    """
    n, m = len(turn), len(tolerances)
    names, deviations = [t.name for t in tolerances], np.array([t.deviation for t in tolerances])
    curvatures = {name: np.zeros((m, m, n)) for name in quantities}
    reached = np.ones(n, dtype=bool)
    for i, deviation in enumerate(deviations.tolist()):
        for sign in (1.0, -1.0):
            moved = perturb(turn, error_variables(names, n, i, sign * deviation))
            found, _ = moved.evaluate(quantities)
            reached &= np.asarray(dual(moved.assembly_square).real > 0.0)
            for name in quantities:
                slopes = np.broadcast_to(dual(found[name]).dual, (m, n))
                curvatures[name][i] += 0.5 * sign * slopes * deviations[:, None]
    return curvatures, reached


def _near_pole(turn: ForceTurn, names: tuple[str, ...], extents: FloatArray) -> NDArray[np.bool_]:
    """Return a mask (n,): whether the slider force is unknown and errors within their half widths can make its lever arm zero.

    The effect of the errors on the lever arm is taken to first order.
    """
    n = len(turn)
    if turn.sought != SLIDER_FORCE:
        return np.zeros(n, dtype=bool)
    lever = dual(perturb(turn, error_variables(names, n)).evaluate(("slider.load",))[1])
    change = (np.abs(np.broadcast_to(lever.dual, (len(names), n))) * extents[:, None]).sum(axis=0)
    return np.asarray(np.abs(np.broadcast_to(lever.real, (n,))) <= change)


def _share(parts: MaskedArray, whole: MaskedArray, none: NDArray[np.bool_]) -> MaskedArray:
    """Return ``parts`` (m, n) divided by their sum ``whole`` (n,), masked where ``none`` is true."""
    shares = np.ma.masked_where(np.broadcast_to(none, parts.shape), parts) / np.ma.masked_where(none, whole)
    shares.fill_value = np.nan
    return cast(MaskedArray, shares)
