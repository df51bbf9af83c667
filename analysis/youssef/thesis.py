"""The slider's equation as the thesis has it, errors included: eq (4.21) as printed, and as its programs compute it.

    I zeta'' + lambda_c S zeta' + (lambda_k^2 S + K) zeta = F

I, S, K and F each have a mean and a first harmonic: all is linearised about one position of the mechanism, the datum. The
coefficients are those of a coupler without mass and of a rocker whose centre of mass is on the slider, the case of all its
results. Beside M' zeta', which is missing, the programs halve every term in the crank's length, and differ in K.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from math import cos, radians, sin
from typing import NamedTuple

import numpy as np

from linkwork.errors import InputError
from linkwork.five_bar.parameters import FiveBarParameters

from ..numerics.fourier import FourierSeries


class Datum(NamedTuple):
    """Angles about which the thesis linearises (rad): crank, coupler and rocker."""

    crank: float
    coupler: float
    rocker: float


#: Of all its programs, whatever the lengths: the rocker amid its swing, in whole degrees, at sigma2 = 0.05.
DATUM = Datum(*map(radians, (149.0, 57.0, 120.0)))


class Form(StrEnum):
    """What becomes of the coefficients.

    Attributes
    ----------
    QUOTIENT
        Eq (4.21).
    SERIES
        Eq (4.29): divided by I and expanded, (4.23) to (4.28). Harmonics of second order are kept, means are not.
    RESONANCE
        As appendix 2 solves it: it divides the harmonics of S by its mean k0 once too often, and the damper's mean is 1, as
        in (4.34).
    STABILITY
        As appendix 4 solves it: the same, but the damper's mean is k0.
    """

    QUOTIENT = "(4.21)"
    SERIES = "(4.29)"
    RESONANCE = "appendix 2"
    STABILITY = "appendix 4"


class Parts(NamedTuple):
    """I, what multiplies lambda_c and lambda_k^2, K, and F."""

    inertia: FourierSeries
    damper: FourierSeries
    spring: FourierSeries
    stiffness: FourierSeries
    force: FourierSeries


class Linkage(NamedTuple):
    """What the coefficients depend on: l2/l4, l3/l4, p45 = m4/(m4 + m5), I4."""

    sigma2: float
    sigma3: float
    p45: float
    inertia_ratio: float


def linkage(parameters: FiveBarParameters) -> Linkage:
    """The ratios of a mechanism.

    Raises InputError if the coupler has mass, the rocker's centre of mass is off the slider, or gravity or a preload acts.
    """
    for name in ("coupler_mass", "coupler_inertia", "rocker_cog_distance", "gravity", "slider_spring_free_position"):
        if value := getattr(parameters, name):
            raise InputError(
                f"{name.replace('_', '.', 1)} is {value:g}: the thesis's equation can be read where this is 0 only"
            )
    p = parameters.constants()
    return Linkage(
        sigma2=p.l2 / p.l4,
        sigma3=p.l3 / p.l4,
        p45=parameters.rocker_mass / p.m45,
        inertia_ratio=parameters.rocker_inertia / (parameters.rocker_mass * p.l4**2),
    )


def printed(of: Linkage, datum: Datum = DATUM) -> Parts:
    """The coefficients that follow (4.21). The sign of P1 cannot be read in the scan: it is that of H1."""
    s2, s3, p45, i4 = of
    alpha, a3, a4 = datum
    # divided by sigma3^2, which all have
    twice = -2.0 * s2 * cos(a4 - a3)
    turn = p45 * i4 * (s2 / s3) / sin(a4 - a3)
    a1 = sin(a4 - a3) ** 2 + twice * (cos(alpha - a4) / s3 - cos(alpha - a3))
    b1, c1 = twice * (cos(a3) - cos(a4) / s3), twice * (sin(a3) - sin(a4) / s3)
    d1 = a1 + p45 * i4 * cos(a3) ** 2 - turn * sin(2.0 * a3) * cos(alpha - a4)
    e1, f1 = b1 + turn * sin(2.0 * a3) * cos(a4), c1 + turn * sin(2.0 * a3) * sin(a4)
    h1, p1 = -turn * cos(a4) * sin(2.0 * a3), turn * cos(a4) * cos(2.0 * a3)
    spring = _series(a1, b1, c1)
    return Parts(_series(d1, e1, f1), spring, spring, _series(0.0, h1, p1), _force(of, datum))


def listed(of: Linkage, datum: Datum = DATUM, function: Callable[[float], float] = cos) -> Parts:
    """Those at label 17 of appendices 2 and 4; with ``function=sin``, by a slip, of appendix 3."""
    s2, s3, p45, i4 = of
    alpha, a3, a4 = datum
    cf04 = function(alpha - a4)
    g1, g2 = i4 * (s2 / s3) * sin(a3) * cos(a3) / sin(a4 - a3), s2 * cos(a4 - a3)
    h2 = i4 * (s2 / s3) * sin(a3) * cos(a4) / sin(a4 - a3)
    c = -(sin(a4 - a3) ** 2) + g2 * (-cos(alpha - a3) + cf04 / s3)
    bb, cc = g2 * (cos(a3) - cos(a4) / s3), g2 * (sin(a3) - sin(a4) / s3)
    p = c + p45 * (-i4 * cos(a3) ** 2 + g1 * cf04)
    q, r = bb - p45 * g1 * cos(a4), cc - p45 * g1 * sin(a4)
    spring = _series(-c, -bb, -cc)
    stiffness = _series(0.0, -p45 * h2 * cos(a3), -p45 * h2 * sin(a3))
    return Parts(_series(-p, -q, -r), spring, spring, stiffness, _force(of, datum))


def formed(parts: Parts, form: Form) -> Parts:
    """The coefficients in a form; see `Form`."""
    if form is Form.QUOTIENT:
        return parts
    inertia = parts.inertia
    damper, spring, stiffness, force = (_divided(part, inertia) for part in parts[1:])
    if form is not Form.SERIES:
        k0 = spring.mean
        lost = spring * (1.0 / k0)
        spring = lost + (k0 - 1.0)
        damper = lost if form is Form.RESONANCE else spring
    return Parts(FourierSeries.constant(1.0), damper, spring, stiffness, force)


def _series(mean: float, cosine: float, sine: float) -> FourierSeries:
    return FourierSeries(np.array([mean, cosine]), np.array([0.0, sine]))


def _force(of: Linkage, datum: Datum) -> FourierSeries:
    """-U and -V of the listings; what can be read of R1 and S1 is the same."""
    size = of.p45 * of.inertia_ratio * of.sigma2 * cos(datum.coupler)
    return _series(0.0, -size * cos(datum.coupler), -size * sin(datum.coupler))


def _divided(part: FourierSeries, inertia: FourierSeries) -> FourierSeries:
    """(4.23) to (4.28): the quotient to second order, without what it adds to the mean."""
    mean = part.mean / inertia.mean
    # first harmonics as cos - i sin: the product of two has half their product as its second harmonic
    first, by = ((one.cos[1] - 1j * one.sin[1]) / inertia.mean for one in (part, inertia))
    waves = np.array([mean, first - mean * by, 0.5 * (mean * by - first) * by])
    return FourierSeries(waves.real, -waves.imag)
