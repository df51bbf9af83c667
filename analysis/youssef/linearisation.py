"""The slider's equation linearised about the four-bar u = 0 at constant crank speed (Youssef, eq 4.21).

With zeta = u/l4, ' = d/d(theta2), masses relative to m45 = m4 + m5 and forces to m45 l4 omega^2,

    (M zeta')' + lambda_c zeta' + (lambda_k^2 + K) zeta = F

where lambda_k^2 = k/(m45 omega^2), lambda_c = mu/(m45 omega), and M, K, F have the period of the crank. They are exact
derivatives of the plant's functions at u = u' = 0. The coupler may therefore have mass, the centres of mass may lie anywhere,
and there may be gravity, a load, a preloaded spring and an inclined guide. The term M' zeta' follows from the velocity terms.
The thesis's own coefficients, which lack it, are variants.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, partial
from math import isfinite, pi, sin, sqrt
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar.parameters import Constants, FiveBarParameters
from linkwork.limits import LIMIT_SINE

from ..mechanisms import FIVE_BAR
from ..numerics import symbolic
from ..numerics.fourier import FourierSeries
from ..run import constants, symbolic_equations, takes_published
from ..units import Amount, in_si
from . import printed_coefficients
from .hill import PeriodicEquation
from .premises import require_no_contact_friction
from .printed_coefficients import Form

#: Largest amplitude of a neglected harmonic of the exact coefficients, relative to the largest harmonic.
NEGLIGIBLE = 1e-13
#: Least and greatest number of samples per turn for the exact coefficients, doubled until the last harmonics are negligible.
FEWEST_SAMPLES, MOST_SAMPLES = 64, 8192


class Variant(StrEnum):
    """Source of the coefficients M, K and F.

    Attributes
    ----------
    EXACT
        Exact derivatives of the plant's functions, with all harmonics.
    FIRST_ORDER, SECOND_ORDER
        Taylor polynomials in the crank's length (sigma2 = l2/l4), harmonics up to 1 and up to 2.
    PRINTED
        Coefficients of (4.21) as the thesis prints them; see `analysis.youssef.printed_coefficients`.
    FORTRAN
        Coefficients of the listings in appendices 2 and 4, which halve the crank's terms in the inertia and have a different K.
    APPENDIX_3
        Coefficients of appendix 3: those of ``FORTRAN`` with a sine where a cosine belongs.
    """

    EXACT = "exact"
    FIRST_ORDER = "first order"
    SECOND_ORDER = "second order"
    PRINTED = "printed"
    FORTRAN = "FORTRAN"
    APPENDIX_3 = "appendix 3"


#: Highest power of the crank's length in a variant's Taylor polynomial.
_POWERS: Mapping[Variant, int] = MappingProxyType({Variant.FIRST_ORDER: 1, Variant.SECOND_ORDER: 2})
#: Functions that compute the thesis's own coefficients, by variant.
_THESIS: Mapping[Variant, Callable[[printed_coefficients.Ratios], printed_coefficients.Coefficients]] = (
    MappingProxyType(
        {
            Variant.PRINTED: printed_coefficients.printed,
            Variant.FORTRAN: printed_coefficients.listed,
            Variant.APPENDIX_3: partial(printed_coefficients.listed, function=sin),
        }
    )
)


class Load(NamedTuple):
    """Constant external forces at the coupler point P and on the slider (N)."""

    x: float = 0.0
    y: float = 0.0
    slider: float = 0.0


NO_LOAD = Load()


class Balance(NamedTuple):
    """Unbalanced force on the slider, and crank torque, for given slider motions; arrays of the same shape as the motions.

    Attributes
    ----------
    force : ndarray
        m22 u'' + b2 - Q2 - F2 (N): zero where the motion satisfies the slider's equation.
    by_acceleration, by_velocity, by_position : ndarray
        Derivatives of the force with respect to u'' (the effective mass m22, kg), u' (N.s/m) and u (N/m).
    torque : ndarray
        Crank torque that keeps the crank speed constant (N.m).
    """

    force: NDArray[np.float64]
    by_acceleration: NDArray[np.float64]
    by_velocity: NDArray[np.float64]
    by_position: NDArray[np.float64]
    torque: NDArray[np.float64]


@cache
def _compile_functions() -> dict[str, Callable[..., tuple[NDArray[np.float64], ...]]]:
    """Compile the functions ``balance`` and ``taylor`` of arrays of angles and motions; return them by name.

    ``balance`` gives the fields of `Balance`. ``taylor`` gives M m45, K m45 omega^2 and F m45 l4 omega^2 in SI at u = u' = 0,
    followed by their first and halved second derivatives with respect to the crank's length.
    """
    casadi = symbolic.library()
    f = symbolic_equations(FIVE_BAR)
    angle, u, v, a, w = (casadi.SX.sym(name) for name in ("angle", "u", "v", "a", "w"))
    columns, p = constants(FIVE_BAR)
    load = casadi.SX.sym("load", 3)
    g = f.position(angle, u, p)
    k = f.coefficients(g, p)
    w3, w4 = k.k32 * w + k.k3u * v, k.k42 * w + k.k4u * v
    m = f.inertia(g, k, p)
    g3, g4 = f.centripetal(g, w, w3, w4, p)
    b1, b2 = f.velocity_terms(g, k, w, w3, w4, g3, g4, p)
    q1, q2 = f.applied_forces(g, k, u, v, load[0], load[1], p)
    force = m.m22 * a + b2 - q2 - load[2]
    torque = m.m12 * a + b1 - q1
    by_position = casadi.jacobian(force, u)
    balance = [force, m.m22, casadi.jacobian(force, v), by_position, torque]
    arguments = [angle, u, v, a, w, columns, load]
    rest = casadi.substitute([m.m22, by_position, -force], [u, v, a], [casadi.SX(0)] * 3)
    first = [casadi.jacobian(value, p.l2) for value in rest]
    second = [0.5 * casadi.jacobian(value, p.l2) for value in first]
    outputs = {"balance": (arguments, balance), "taylor": ([angle, w, columns, load], rest + first + second)}
    return {
        name: partial(
            symbolic.evaluate_arrays, casadi.Function(name, ins, [casadi.densify(out) for out in outs], {"cse": True})
        )
        for name, (ins, outs) in outputs.items()
    }


def balance(
    angle: ArrayLike,
    position: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    speed: float,
    p: Constants,
    load: Load = NO_LOAD,
) -> Balance:
    """Evaluate the plant's equations and their exact derivatives at crank angles (rad) and motions u, u', u'' of the slider.

    The four arrays (rad, m, m/s, m/s2) broadcast to one shape. The crank turns at a constant ``speed`` (rad/s).

    Raises
    ------
    AssemblyError
        If at one of the angles and positions the links cannot be joined, or coupler and rocker are collinear.
    InputError
        If there is friction by contact forces.
    """
    require_no_contact_friction(p, "the balance of harmonics")
    arrays = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (angle, position, velocity, acceleration)))
    _require_assembly(arrays[0], arrays[1], p)
    values = _compile_functions()["balance"](*arrays, speed, p, load)
    return Balance(*(np.broadcast_to(value, arrays[0].shape) for value in values))


def _require_assembly(angle: NDArray[np.float64], position: NDArray[np.float64], p: Constants) -> None:
    """Raise AssemblyError if |sin(th4 - th3)| is not above `LIMIT_SINE` at one of the angles and positions."""
    angle, position = angle.ravel(), position.ravel()
    dx = p.l1 + position * p.ca - p.l2 * np.cos(angle)
    dy = position * p.sa - p.l2 * np.sin(angle)
    # the law of cosines in the triangle BCD
    cosine = (p.l3**2 + p.l4**2 - dx**2 - dy**2) / (2.0 * p.l3 * p.l4)
    worst = int(np.argmax(np.abs(cosine)))
    if not abs(cosine[worst]) < sqrt(1.0 - LIMIT_SINE**2):
        raise AssemblyError(
            f"the cosine of the angle between coupler and rocker would be {cosine[worst]:.6g} at crank angle "
            f"{angle[worst]:.6g} rad, slider position {position[worst]:.6g} m and crank length {p.l2:.6g} m: "
            "the links cannot be joined or are collinear"
        )


def require_speed(speed: float) -> None:
    """Raise `InputError` if a crank speed (rad/s) is not finite or not greater than zero."""
    if not (isfinite(speed) and speed > 0.0):
        raise InputError(f"crank speed {speed!r} rad/s: it must be finite and greater than zero")


_ONE = FourierSeries.constant(1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderEquation:
    """The dimensionless equation (M zeta')' + lambda_c zeta' + (lambda_k^2 + K) zeta = F: eq (4.21) with M' zeta' restored.

    Attributes
    ----------
    mass, stiffness, force : FourierSeries
        M, K (without lambda_k^2) and F.
    spring, damping : float
        lambda_k^2 and lambda_c.
    spring_factor, damping_factor : FourierSeries
        Factors of lambda_k^2 and of lambda_c: 1, except in the thesis's equation, where they are periodic.
    mass_rate : bool
        Whether M' zeta' is kept; the thesis's equation leaves it out.
    variant : Variant
        Source of the coefficients.

    Raises
    ------
    InputError
        If lambda_k^2 or lambda_c is not finite.
    """

    mass: FourierSeries
    stiffness: FourierSeries
    force: FourierSeries
    spring: float
    damping: float
    spring_factor: FourierSeries = field(default=_ONE)
    damping_factor: FourierSeries = field(default=_ONE)
    mass_rate: bool = True
    variant: Variant = Variant.EXACT

    def __post_init__(self) -> None:
        if not (isfinite(self.spring) and isfinite(self.damping)):
            raise InputError(f"lambda_k^2 = {self.spring} and lambda_c = {self.damping} must be finite")

    def homogeneous(self) -> PeriodicEquation:
        """Return the equation with F = 0 and lambda_k^2 = 0; `hill_regions` adds the stiffness again, as its lambda."""
        rate = self.mass.derivative() if self.mass_rate else FourierSeries.constant(0.0)
        b = rate + self.damping * self.damping_factor
        return PeriodicEquation(a=self.mass, b=b, c=self.stiffness, factor=self.spring_factor)

    def coefficients(self) -> tuple[FourierSeries, FourierSeries, FourierSeries]:
        """Return the coefficients a, b, c of a zeta'' + b zeta' + c zeta = F.

        They are M, M' + lambda_c and lambda_k^2 + K, with the factors of lambda_c and lambda_k^2.
        """
        whole = self.homogeneous().stiffened(self.spring)
        return whole.a, whole.b, whole.c


@takes_published()
@in_si(speed="rad/s")
def slider_equation(
    parameters: FiveBarParameters,
    speed: Amount,
    *,
    variant: Variant = Variant.EXACT,
    order: int | None = None,
    form: Form = Form.STABILITY,
    load: Load = NO_LOAD,
) -> SliderEquation:
    """Linearise the slider's equation about u = 0 at a crank speed.

    Parameters
    ----------
    parameters : FiveBarParameters
        Parameters without Coulomb friction, which has no linear form.
    speed : float
        Crank speed omega (rad/s), greater than zero.
    variant : Variant
    order : int, optional
        Highest harmonic of the exact coefficients; by default all that exceed rounding errors.
    form : Form
        Form of the thesis's own coefficients; ignored for the other variants.
    load : Load

    Raises
    ------
    InputError
        If the speed is not positive and finite; if friction is not viscous; if an order is given for a variant that fixes
        it; or if the mechanism comes so near its limit of assembly that the harmonics do not die away. The thesis's own
        coefficients also exclude loads and the parameters listed in `printed_coefficients.ratios`.
    AssemblyError
        If at u = 0 the links cannot be joined over the whole turn.
    """
    require_speed(speed)
    if parameters.slider_coulomb_friction:
        raise InputError("slider.coulomb_friction must be 0: a linear equation cannot contain it")
    require_no_contact_friction(parameters.constants(), "a linear equation")
    if variant is not Variant.EXACT and order is not None:
        raise InputError(f"an order cannot be chosen with the variant {variant.value!r}: it has its own")
    p = parameters.constants()
    spring, damping = p.k / (p.m45 * speed**2), p.mu / (p.m45 * speed)
    if variant in _THESIS:
        if load != NO_LOAD:
            raise InputError(f"{load}: the thesis's equation has no load")
        parts = printed_coefficients.convert(_THESIS[variant](printed_coefficients.ratios(parameters)), form)
        return SliderEquation(
            mass=parts.inertia,
            stiffness=parts.stiffness,
            force=parts.force,
            spring=spring,
            damping=damping,
            spring_factor=parts.spring,
            damping_factor=parts.damper,
            mass_rate=False,
            variant=variant,
        )
    if variant is Variant.EXACT:
        mass, stiffness, force = _exact_coefficients(p, speed, load, order)
    else:
        mass, stiffness, force = _taylor_coefficients(p, speed, load, _POWERS[variant])
    return SliderEquation(
        mass=mass * (1.0 / p.m45),
        stiffness=stiffness * (1.0 / (p.m45 * speed**2)),
        force=force * (1.0 / (p.m45 * speed**2 * p.l4)),
        spring=spring,
        damping=damping,
        variant=variant,
    )


def _without_spring(p: Constants, load: Load) -> tuple[Constants, Load]:
    """Remove spring, damper and friction from the constants, and add the spring's preload to the load."""
    return p._replace(k=0.0, u0=0.0, mu=0.0, fc=0.0), load._replace(slider=load.slider + p.k * p.u0)


def _exact_coefficients(
    p: Constants, speed: float, load: Load, order: int | None
) -> tuple[FourierSeries, FourierSeries, FourierSeries]:
    """Return m22 (kg), K m45 omega^2 (N/m) and F m45 l4 omega^2 (N) as series over the crank angle, from exact samples.

    The number of samples is doubled until the highest harmonics are negligible.
    """
    bare, loaded = _without_spring(p, load)
    samples = FEWEST_SAMPLES if order is None else max(FEWEST_SAMPLES, 4 * order)
    while True:
        angle = np.linspace(0.0, 2.0 * pi, samples, endpoint=False)
        at_rest = balance(angle, 0.0, 0.0, 0.0, speed, bare, loaded)
        series = [
            FourierSeries.from_samples(values)
            for values in (at_rest.by_acceleration, at_rest.by_position, -at_rest.force)
        ]
        tails = [_last_harmonic(one) for one in series]
        if max(tails) < samples // 4:
            mass, stiffness, force = (
                one.to_order(tail if order is None else order) for one, tail in zip(series, tails)
            )
            return mass, stiffness, force
        if samples >= MOST_SAMPLES:
            raise InputError(
                f"harmonics up to order {max(tails)} of {samples} samples matter: the mechanism comes too near its limit "
                "of assembly for a Fourier series"
            )
        samples *= 2


def _last_harmonic(series: FourierSeries) -> int:
    """Return the order of the last harmonic that exceeds rounding errors."""
    size = np.abs(series.amplitudes)
    return int(np.flatnonzero(size > NEGLIGIBLE * size.max())[-1]) if size.max() > 0.0 else 0


def _taylor_coefficients(
    p: Constants, speed: float, load: Load, order: int
) -> tuple[FourierSeries, FourierSeries, FourierSeries]:
    """Return the series of `_exact_coefficients` as Taylor polynomials in the crank's length; harmonics up to ``order``."""
    bare, loaded = _without_spring(p, load)
    # the expansion is about a crank of zero length
    bare = bare._replace(l2=0.0)
    angle = np.linspace(0.0, 2.0 * pi, 8, endpoint=False)
    _require_assembly(angle, np.zeros(8), bare)
    terms = np.array([np.broadcast_to(term, 8) for term in _compile_functions()["taylor"](angle, speed, bare, loaded)])
    values = np.tensordot(p.l2 ** np.arange(order + 1), terms.reshape(3, 3, 8)[: order + 1], axes=1)
    mass, stiffness, force = (FourierSeries.from_samples(value, order) for value in values)
    return mass, stiffness, force
