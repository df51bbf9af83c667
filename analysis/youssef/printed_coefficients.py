"""The coefficients of eq (4.21) as the thesis prints them and as its programs compute them, with their errors.

    I zeta'' + lambda_c S zeta' + (lambda_k^2 S + K) zeta = F

I, S, K and F have a mean and a first harmonic, since the thesis linearises about one position of the mechanism, the datum. All
its results hold for a coupler without mass and a rocker whose centre of mass is on the slider. The printed equation lacks M'
zeta'. The programs lack this term too, halve the crank's terms in the inertia and in the factors of spring and damper, and have
a different K.
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
    """Angles of crank, coupler and rocker about which the thesis linearises (rad)."""

    crank: float
    coupler: float
    rocker: float


#: Datum of all programs, whatever the lengths: the middle of the rocker's swing at sigma2 = 0.05, in whole degrees.
DATUM = Datum(*map(radians, (149.0, 57.0, 120.0)))


class Form(StrEnum):
    """Form in which the thesis uses the coefficients of eq (4.21).

    Attributes
    ----------
    QUOTIENT
        The coefficients as in eq (4.21).
    SERIES
        The coefficients as in eq (4.29): divided by I and expanded by (4.23) to (4.28), which keep second-order harmonics but
        not second-order means.
    RESONANCE
        The coefficients as in appendix 2, which divides the harmonics of S by its mean k0 once too often; the damper's mean is
        1 as in (4.34).
    STABILITY
        The coefficients as in appendix 4, which differ from those of appendix 2 in the damper's mean: it is k0.
    """

    QUOTIENT = "(4.21)"
    SERIES = "(4.29)"
    RESONANCE = "appendix 2"
    STABILITY = "appendix 4"


class Coefficients(NamedTuple):
    """The coefficients of eq (4.21): inertia I, factors of lambda_c and of lambda_k^2, stiffness K and force F."""

    inertia: FourierSeries
    damper: FourierSeries
    spring: FourierSeries
    stiffness: FourierSeries
    force: FourierSeries


class Ratios(NamedTuple):
    """Dimensionless parameters that determine the coefficients.

    They are l2/l4, l3/l4, p45 = m4/(m4 + m5) and I4 = rocker inertia/(m4 l4^2).
    """

    sigma2: float
    sigma3: float
    p45: float
    inertia_ratio: float


def ratios(parameters: FiveBarParameters) -> Ratios:
    """Return the dimensionless parameters of a five-bar.

    Raises InputError if the coupler has mass, the rocker's centre of mass is off the slider, or gravity or a preload acts.
    """
    for name in ("coupler_mass", "coupler_inertia", "rocker_cog_distance", "gravity", "slider_spring_free_position"):
        if value := getattr(parameters, name):
            raise InputError(
                f"{name.replace('_', '.', 1)} is {value:g}: it must be 0, as the thesis's equation is legible only then"
            )
    p = parameters.constants()
    return Ratios(
        sigma2=p.l2 / p.l4,
        sigma3=p.l3 / p.l4,
        p45=parameters.rocker_mass / p.m45,
        inertia_ratio=parameters.rocker_inertia / (parameters.rocker_mass * p.l4**2),
    )


def printed(ratios: Ratios, datum: Datum = DATUM) -> Coefficients:
    """Return the coefficients that the thesis lists after (4.21).

    The sign of P1 is illegible and is taken from H1; the force is taken from the program listings.
    """
    s2, s3, p45, i4 = ratios
    alpha, a3, a4 = datum
    # all divided by their common factor sigma3^2
    twice = -2.0 * s2 * cos(a4 - a3)
    turn = p45 * i4 * (s2 / s3) / sin(a4 - a3)
    a1 = sin(a4 - a3) ** 2 + twice * (cos(alpha - a4) / s3 - cos(alpha - a3))
    b1, c1 = twice * (cos(a3) - cos(a4) / s3), twice * (sin(a3) - sin(a4) / s3)
    d1 = a1 + p45 * i4 * cos(a3) ** 2 - turn * sin(2.0 * a3) * cos(alpha - a4)
    e1, f1 = b1 + turn * sin(2.0 * a3) * cos(a4), c1 + turn * sin(2.0 * a3) * sin(a4)
    h1, p1 = -turn * cos(a4) * sin(2.0 * a3), turn * cos(a4) * cos(2.0 * a3)
    spring = _series(a1, b1, c1)
    return Coefficients(_series(d1, e1, f1), spring, spring, _series(0.0, h1, p1), _force(ratios, datum))


def listed(ratios: Ratios, datum: Datum = DATUM, function: Callable[[float], float] = cos) -> Coefficients:
    """Return the coefficients computed at label 17 of the listings in appendices 2 and 4.

    ``function=sin`` repeats the slip of appendix 3, a sine for the cosine of alpha - alpha4.
    """
    s2, s3, p45, i4 = ratios
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
    return Coefficients(_series(-p, -q, -r), spring, spring, stiffness, _force(ratios, datum))


def convert(parts: Coefficients, form: Form) -> Coefficients:
    """Convert coefficients of (4.21) into another form of the equation."""
    if form is Form.QUOTIENT:
        return parts
    inertia = parts.inertia
    damper, spring, stiffness, force = (_divide_by_inertia(part, inertia) for part in parts[1:])
    if form is not Form.SERIES:
        k0 = spring.mean
        lost = spring * (1.0 / k0)
        spring = lost + (k0 - 1.0)
        damper = lost if form is Form.RESONANCE else spring
    return Coefficients(FourierSeries.constant(1.0), damper, spring, stiffness, force)


def _series(mean: float, cosine: float, sine: float) -> FourierSeries:
    return FourierSeries(np.array([mean, cosine]), np.array([0.0, sine]))


def _force(ratios: Ratios, datum: Datum) -> FourierSeries:
    """Return the force with the first harmonic of the listings (L8449-8450), used in place of R1 and S1.

    Its cosine coefficient is -U, its sine coefficient -V.

    In the scan the lines of R1 and S1 (L2786-2794) are incomplete: the legible terms contain r4 and mr3, which are zero here,
    and none of these terms contains I4. At sigma3 = 1, U and V are the I4 term in the line of Q1 (L2781) times cos and sin of
    alpha3. The mean of the force is zero in the listings, and to first order also in the correct equation.
    """
    size = ratios.p45 * ratios.inertia_ratio * ratios.sigma2 * cos(datum.coupler)
    return _series(0.0, -size * cos(datum.coupler), -size * sin(datum.coupler))


def _divide_by_inertia(part: FourierSeries, inertia: FourierSeries) -> FourierSeries:
    """Divide a coefficient by the inertia as (4.23) to (4.28) do: harmonics to second order, the mean to first order only."""
    mean = part.mean / inertia.mean
    # first harmonics as cos - i sin: the product of two has half their product as its second harmonic
    first, by = ((one.cos[1] - 1j * one.sin[1]) / inertia.mean for one in (part, inertia))
    waves = np.array([mean, first - mean * by, 0.5 * (mean * by - first) * by])
    return FourierSeries(waves.real, -waves.imag)
