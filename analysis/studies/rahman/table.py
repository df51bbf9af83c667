"""Assignment of Rahman's figures 5 to 38: twelve quantities in two or three families of cases.

Section 3.2 assigns figures to the families: variable offset, variable axial shift, variable twist; the two torques have no
figure of variable twist. The surviving captions, each above its number, name the displacement, force or torque and the
constant dimensions. The component of each figure is our inference: in the order of section 3.2, the families leave exactly one
place for each component that this section does not find constant.

The symbols are the thesis's: nFni is the force in joint n along the axis i of frame n, nTni the moment. 1F1 and 1T1 act from
the ground on the crank, and 2F2 from the rod on the crank, since 2F2j = -T/a1. Then 3F3 acts from the rod on the slider by
eq 63, and 4F4 from the ground on the slider by eq 64.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

INFERRED = (
    "The thesis gives the family of each figure (section 3.2, L1111-1113) and, where a caption is left, whether it is of a "
    "displacement, a force or a torque. Which component each figure shows is our inference from the order of section 3.2."
)

#: Crank angles of the spikes in sections 3.2 and 3.3 (deg).
SPIKES_DEG = (100.0, 300.0)
#: Numbers of spikes that section 3.3 finds in a component (L1125), in words: two in all others.
SPIKES: Mapping[str, str] = MappingProxyType({"3F3j": "no", "3F3k": "one", "4F4k": "one"})
#: Twists (deg) between which the thesis's iteration converges (L1121).
TWISTS_REACHED_DEG = (232.0, 310.0)


class Case(NamedTuple):
    """Mechanism of section 3.1: its name in titles and legends, a4 and S1 (in), alpha4 (deg)."""

    name: str
    offset_in: float
    shift_in: float
    twist_deg: float


class Family(NamedTuple):
    """Cases that differ in one dimension, with the texts of their titles and legends."""

    title: str
    legend: str
    cases: tuple[Case, ...]


class Component(NamedTuple):
    """Component of a force or moment: symbol, meaning, printed unit, and source.

    ``source`` is the name of a vector of `analysis.slider_crank.ForceTurn`, of which this is the component along ``axis`` of
    ``frame``. Or it is one of the two axial forces, "axial_force" and "slider_force". ``sign`` converts the source's sense to
    that of the thesis.
    """

    symbol: str
    meaning: str
    unit: str
    source: str
    sign: float = 1.0

    @property
    def frame(self) -> int:
        return int(self.symbol[0])

    @property
    def axis(self) -> int:
        return "ijk".index(self.symbol[-1])


def _components() -> Iterator[Component]:
    for symbol, what, unit, source, sign in (
        ("1F1", "ground on crank", "lb", "bearing", 1.0),
        ("1T1", "ground on crank", "lb.in", "bearing_moment", 1.0),
        ("2F2", "rod on crank", "lb", "crank_pin", -1.0),
        ("3F3", "rod on slider", "lb", "slider_pin", -1.0),
        ("4F4", "ground on slider", "lb", "guide", 1.0),
        ("4T4", "ground on slider", "lb.in", "guide_moment", 1.0),
    ):
        for axis in "ijk":
            yield Component(symbol + axis, what, unit, source, sign)
    yield Component("1F1k", "ground on crank", "lb", "axial_force")
    # the unknown slider force acts along the guide; as a load it is positive in the direction opposite to k4
    yield Component("4F4k", "slider force sought", "lb", "slider_force", -1.0)


COMPONENTS: Mapping[str, Component] = MappingProxyType({component.symbol: component for component in _components()})


class Figure(NamedTuple):
    """Figure of the thesis: family of cases, components (none for the slider displacement), title, and place."""

    family: str
    symbols: tuple[str, ...]
    title: str
    place: str


#: The case that every figure shows beside the others.
IDEAL = Case("ideal", 0.0, 0.0, 270.0)

_OFFSETS = tuple(Case(f"a4 = {a4} in", float(a4), 3.5, 270.0) for a4 in (10, 20, 30))
_SHIFTS = tuple(Case(f"S1 = {s1} in", 30.0, float(s1), 270.0) for s1 in (3, 6, 9))
_TWISTS = tuple(Case(f"alpha4 = {twist} deg", 20.0, 0.0, float(twist)) for twist in (232, 270, 310))

FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "offset": Family("a4 = 10, 20, 30 in, S1 = 3.5 in", "S1 = 3.5 in, alpha4 = 270 deg", _OFFSETS),
        "shift": Family("S1 = 3, 6, 9 in, a4 = 30 in", "a4 = 30 in, alpha4 = 270 deg", _SHIFTS),
        "twist": Family("alpha4 = 232, 270, 310 deg, a4 = 20 in", "a4 = 20 in, S1 = 0", _TWISTS),
        "all": Family("all cases", "", _OFFSETS + _SHIFTS + _TWISTS),
    }
)
#: The quantities in the order of section 3.2; the torques are not shown for variable twist.
QUANTITIES = ("S4", "1F1i", "1F1j", "1T1i", "1T1j", "2F2i", *(f"{n}F{n}{axis}" for n in (3, 4) for axis in "ijk"))
#: Lines of the scanned text with the surviving captions.
CAPTIONS: Mapping[int, int] = MappingProxyType(
    {6: 1153, 9: 1164, 10: 1170, 13: 1181, 14: 1187, 16: 1196, 19: 1208, 20: 1214, 24: 1229, 25: 1235, 26: 1241}
    | {28: 1249, 29: 1254, 31: 1262, 32: 1268, 33: 1273, 34: 1279, 35: 1284, 37: 1292, 38: 1298}
)
#: The study of the components that the thesis finds constant and shows in no figure.
CONSTANT = "rahman-constant"


def _figures() -> Iterator[Figure]:
    number = 5
    for symbol in QUANTITIES:
        kind = "displacement" if symbol == "S4" else "torque" if "T" in symbol else "force"
        for family in ("offset", "shift", "twist")[: 2 if kind == "torque" else 3]:
            caption = f"; caption, L{CAPTIONS[number]}" if number in CAPTIONS else "; caption lost"
            what = "Slider displacement" if symbol == "S4" else f"Joint {kind}"
            shown = () if symbol == "S4" else (symbol,)
            title = f"{what} {symbol}; {FAMILIES[family].title}"
            judged = "L1125" + ("; L1119, L1127" if kind == "torque" else "")
            yield Figure(family, shown, title, f"section 3.2, L1111-1113{caption}; statements, {judged}")
            number += 1


#: The figures by their number in the registry of studies (R and the thesis's), and the study without a figure.
FIGURES: Mapping[str, Figure] = MappingProxyType(
    {f"R{number}": figure for number, figure in enumerate(_figures(), start=5)}
    | {
        CONSTANT: Figure(
            "all",
            ("1F1k", "2F2j", "2F2k"),
            "Joint forces and moments that Rahman finds constant over the turn",
            "sections 2.8, 3.2",
        )
    }
)
