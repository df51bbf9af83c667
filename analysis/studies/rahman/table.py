"""Which of Rahman's figures shows what: figures 5 to 38 as three families of cases by eleven quantities, and one more.

Our source tells which quantities and which cases the figures show, but not which stands under which number: the numbering
is our assignment. Figures 5 to 15 are family A, the offset; 16 to 26 family B, the shift; 27 to 37 family C, the twist; each
family has the same eleven quantities in the same order, and 38 has the moments on the slider in all cases.

The symbols are the thesis's: nFni is the force in joint n along i of frame n, nTni the moment. By the signs of its
statements 1F1 and 1T1 are those of the ground on the crank, and 2F2 is the force of the rod on the crank, since
2F2j = -T/a1. Nothing is stated about the signs of 3F3 and 4F4: they are taken in the same sense from the next link, as the
force of the slider on the rod and of the ground on the slider.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

ASSIGNED = (
    "Our source tells which quantities and cases figures 5 to 38 show, but not which stands under which number: the "
    "numbering is our assignment, 5 to 15 for the offset, 16 to 26 for the shift, 27 to 37 for the twist, 38 for the moments "
    "on the slider, such that every component of every joint force and moment appears."
)


class Spot(NamedTuple):
    """Values at theta1 = 30 deg, 50 rpm, branch +; the last two: slider force along -k4 at a torque of 100 lb.in, and the
    torque that no slider force takes."""

    offset_in: float
    shift_in: float
    twist_deg: float
    position_in: float
    velocity_in_s: float
    acceleration_in_s2: float
    slider_force_lb: float
    torque_lb_in: float


# The thesis's figures are not legible in the copy there is. Reference numbers are from an independent derivation of the closed
# form, to the digits shown; nothing here is the output of this program.

#: Where section 3.2 sees spikes (deg).
SPIKES_DEG = (100.0, 300.0)
#: Shifts (in) up to which, and twists (deg) between which the thesis's iteration converges.
SHIFTS_REACHED_IN, TWISTS_REACHED_DEG = (1.5, 3.5, 9.0), (232.0, 310.0)

SPOTS = (
    Spot(10.0, 3.5, 270.0, 51.518171, 68.488429, -62.88695, -15.328251, -100.49853),
    Spot(20.0, 0.0, 310.0, 44.111244, 62.432803, 36.61340, -8.206263, 2.15027),
)
#: Dead centres at S1 = 0 and 270 deg, by the offset in inches.
DEAD_CENTRES_DEG: Mapping[float, tuple[float, float]] = MappingProxyType(
    {10.0: (99.28, 285.26), 20.0: (108.82, 301.76), 30.0: (118.94, 322.14)}
)
#: Strokes likewise.
STROKES_IN: Mapping[float, float] = MappingProxyType({0.0: 24.000, 10.0: 24.528, 20.0: 26.375, 30.0: 30.935})
#: Strokes at a4 = 20 in and S1 = 0, by the twist in degrees.
STROKES_BY_TWIST_IN: Mapping[float, float] = MappingProxyType({232.0: 21.85, 310.0: 21.39})
#: Greatest shifts at which the crank turns fully at 270 deg, by the offset: sqrt(a2^2 - (a1 + |a4|)^2).
GREATEST_SHIFTS_IN: Mapping[float, float] = MappingProxyType({0.0: 48.539, 10.0: 44.900, 20.0: 38.419, 30.0: 27.129})
#: Greatest magnitude of 2F2k and half a unit of its last figure (lb), by a4, S1 (in) and alpha4 (deg). That it is meant
#: more than 10 deg from a dead centre is our reading: nearer to it there is no bound.
AXIAL_LB: Mapping[tuple[float, float, float], tuple[float, float]] = MappingProxyType(
    {(10.0, 3.5, 270.0): (4.1, 0.05), (20.0, 0.0, 310.0): (27.0, 0.5)}
)


class Case(NamedTuple):
    """A mechanism of section 3.1: its name in titles and legends, a4 and S1 (in), alpha4 (deg)."""

    name: str
    offset_in: float
    shift_in: float
    twist_deg: float


class Family(NamedTuple):
    """Cases that differ in one dimension: what stands in the titles, what heads the legends, the cases."""

    title: str
    legend: str
    cases: tuple[Case, ...]


class Component(NamedTuple):
    """A component of a force or moment: its symbol, what it is, its unit as printed, and where it comes from.

    ``source`` is a joint's vector of `analysis.slider_crank.ForceTurn`, of which it is the component along ``axis`` of
    ``frame``, or one of the two forces that are along an axis, "axial_force" and "slider_force". ``sign`` turns the sense of
    that one into the thesis's.
    """

    symbol: str
    meaning: str
    unit: str
    source: str
    frame: int
    axis: int
    sign: float = 1.0


class Quantity(NamedTuple):
    """What a figure shows, a panel for each component; none for the slider's position."""

    title: str
    components: tuple[Component, ...] = ()


class Figure(NamedTuple):
    """A figure: the family of its cases and its quantity."""

    family: str
    quantity: Quantity

    @property
    def title(self) -> str:
        """Title in the list of studies."""
        return f"{self.quantity.title}; {FAMILIES[self.family].title}"


#: The case that stands beside the others in every figure.
IDEAL = Case("ideal", 0.0, 0.0, 270.0)

_OFFSETS = tuple(Case(f"a4 = {a4} in", float(a4), 3.5, 270.0) for a4 in (10, 20, 30))
_SHIFTS = tuple(Case(f"S1 = {s1} in", 30.0, float(s1), 270.0) for s1 in (3, 6, 9))
_TWISTS = tuple(Case(f"alpha4 = {twist} deg", 20.0, 0.0, float(twist)) for twist in (232, 270, 310))

FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "A": Family("a4 = 10, 20, 30 in, S1 = 3.5 in", "S1 = 3.5 in, alpha4 = 270 deg", _OFFSETS),
        "B": Family("S1 = 3, 6, 9 in, a4 = 30 in", "a4 = 30 in, alpha4 = 270 deg", _SHIFTS),
        "C": Family("alpha4 = 232, 270, 310 deg, a4 = 20 in", "a4 = 20 in, S1 = 0", _TWISTS),
        "all": Family("all cases", "", _OFFSETS + _SHIFTS + _TWISTS),
    }
)


def _force(n: int, axis: str, meaning: str, source: str, sign: float = 1.0) -> Component:
    return Component(f"{n}F{n}{axis}", meaning, "lb", source, n, "ijk".index(axis), sign)


def _moment(n: int, axis: str, meaning: str, source: str) -> Component:
    return Component(f"{n}T{n}{axis}", meaning, "lb.in", source, n, "ijk".index(axis))


_ON_CRANK, _BY_ROD, _BY_SLIDER, _BY_GUIDE = "ground on crank", "rod on crank", "slider on rod", "ground on slider"

#: What each family shows, in the order of its figures.
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("Slider position S4"),
    Quantity("Force 1F1i on the crank", (_force(1, "i", _ON_CRANK, "bearing"),)),
    Quantity("Force 1F1j on the crank", (_force(1, "j", _ON_CRANK, "bearing"),)),
    Quantity("Axial force 1F1k on the crank", (_force(1, "k", _ON_CRANK, "axial_force"),)),
    Quantity("Moment 1T1i on the crank", (_moment(1, "i", _ON_CRANK, "bearing_moment"),)),
    Quantity(
        "Moments 1T1j, 1T1k on the crank",
        tuple(_moment(1, axis, _ON_CRANK, "bearing_moment") for axis in "jk"),
    ),
    Quantity("Force 2F2i in the crank pin", (_force(2, "i", _BY_ROD, "crank_pin", -1.0),)),
    Quantity("Force 2F2j in the crank pin", (_force(2, "j", _BY_ROD, "crank_pin", -1.0),)),
    Quantity("Force 2F2k in the crank pin", (_force(2, "k", _BY_ROD, "crank_pin", -1.0),)),
    Quantity("Force 3F3 in the slider pin", tuple(_force(3, axis, _BY_SLIDER, "slider_pin") for axis in "ijk")),
    Quantity(
        "Force 4F4 on the slider",
        (
            *(_force(4, axis, _BY_GUIDE, "guide") for axis in "ij"),
            # along the guide it is the slider force that is sought, counted against k4 where it is a load
            _force(4, "k", "slider force sought", "slider_force", -1.0),
        ),
    ),
)
#: What figure 38 shows.
SLIDER_MOMENTS = Quantity(
    "Moments 4T4 on the slider", tuple(_moment(4, axis, _BY_GUIDE, "guide_moment") for axis in "ijk")
)

#: The figures by their number in the registry of studies: R and the thesis's.
FIGURES: Mapping[str, Figure] = MappingProxyType(
    {
        f"R{number}": Figure(family, quantity)
        for number, (family, quantity) in enumerate(
            [(family, quantity) for family in "ABC" for quantity in QUANTITIES] + [("all", SLIDER_MOMENTS)], start=5
        )
    }
)
