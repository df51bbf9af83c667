"""Cases, iteration over a turn, and plot that the studies of Rahman's method share.

`printed` has the equations exactly as printed. The studies compare them with other formulations: dual matrices, difference
quotients, and the model by Newton's and Euler's equations. The errata are numbered as in docs/rahman.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from linkwork.slider_crank.published import parameters

from ...figures import Curve, Figure, Panel, plot_curves
from ...numerics.dual import Dual, about_i, about_j, about_k
from ..rules import ABOUT_DEG
from ..statements import Case as Judged
from ..statements import FloatArray, unjudged
from ..study import StudyResult
from ..variation import cache
from .figures import ALL, ANGLE, clear_mask, printed, printed_symbol
from .printed import CRANK_AT_SPEED, GENERAL, STEP, Joints, Turn, turn
from .table import IDEAL, Case

#: Length of the rod (in).
ROD = CRANK_AT_SPEED.a2
#: The planar mechanism, and the cases out of the plane.
PLANE = Case("in the plane, a4 = 10 in", 10.0, 0.0, 270.0)
OUT = tuple(case for case in ALL if case.shift_in or case.twist_deg != IDEAL.twist_deg)
#: Cases out of the plane whose loops the iteration follows over a turn.
OPEN = (
    Case("a4 = 10 in at S1 = 3.5 in", 10.0, 3.5, 270.0),
    Case("alpha4 = 232 deg", 20.0, 0.0, 232.0),
    Case("alpha4 = 310 deg", 20.0, 0.0, 310.0),
)
#: Cases for row 37f, which is judged where |sin theta2| is above `CLEAR_SINE`, since eq 41 divides by sin theta2.
ROW_F = (Case("a4 = 30 in at S1 = 9 in", 30.0, 9.0, 270.0), OPEN[2])
CLEAR_SINE = float(np.sin(np.radians(ABOUT_DEG)))
#: Motion in which second rates are judged: the crank accelerates (rad/s2), the shift has a rate (in/s) and accelerates (in/s2).
MOVING = CRANK_AT_SPEED._replace(shift_rate=1.3, acceleration=3.0, shift_acceleration=0.7)
AT_RATES = "with S1' = 1.3 in/s, theta1'' = 3 rad/s2 and S1'' = 0.7 in/s2"
DOTS = "second derivatives that have one dot in our scan are read with two"
#: Step of difference quotients, and their largest relative error.
H, ROUGH = 1e-6, 1e-7


def case_turn(case: Case, small: float = STEP) -> Turn:
    """Run the iteration over a turn for the mechanism of a case; see `turn`."""
    return _followed(*case[1:], small)


@cache
def _followed(offset_in: float, shift_in: float, twist_deg: float, small: float) -> Turn:
    return turn(parameters(offset_in, twist_deg), shift_in, small=small)


def joints(unknowns: FloatArray) -> Joints:
    """Return the unknowns (..., 5) of the loop as `Joints`, each by its name."""
    return Joints(*np.moveaxis(unknowns, -1, 0))


#: Crank angle (rad) and shift (in) of the general position.
AT, SHIFT = 0.9, 3.5


def links() -> tuple[Dual, Dual, Dual]:
    """Return the matrices of eqs 1 to 3 in a general position, as products of rotations, with lengths in inches."""
    th2, eta2, th3, eta3, _ = (float(value) for value in GENERAL)
    return (
        about_k(Dual(AT, SHIFT)) @ about_i(Dual(0.0, CRANK_AT_SPEED.a1)),
        about_k(th2) @ about_j(eta2) @ about_i(Dual(0.0, ROD)),
        about_k(th3) @ about_j(eta3) @ about_i(0.5 * np.pi),
    )


def difference(a: Dual, b: Dual) -> float:
    """Return the greatest difference between the entries of two dual vectors or matrices."""
    return float(max(np.abs(a.real - b.real).max(), np.abs(a.dual - b.dual).max()))


def unsure(label: str, slip: str, size: ArrayLike, unit: str) -> Judged:
    """Return a case that cannot be judged, because our scan alone may have a wrong symbol in an equation.

    ``slip`` names the wrong and the right symbol, ``size`` is the difference between their results.
    """
    most = float(np.max(np.abs(size)))
    why = f"our scan has {slip}, a difference of {most:.4g} {unit}; the printed thesis may be right (erratum 9)"
    return unjudged(label, why)


#: Labels of the axes by the unit of their columns.
_SHOWN = {"[deg]": "rotation left", "[in]": "error of S4", "[in/s]": "opening of the loop", "[lb]": "4F4k"}
#: Words in the names of the columns that are drawn dashed, over the others.
_DASHED = ("loop mended", "both mended", "Davidon")


def draw(result: StudyResult) -> Figure:
    """Draw one panel for each unit of the columns; results of the mended equations are dashed."""
    panels: list[Panel] = []
    for unit, label in _SHOWN.items():
        shown = {name: column for name, column in result.columns.items() if name.endswith(unit) and name != ANGLE}
        # the forces are infinite at the dead centres
        inside = clear_mask(PLANE) if unit == "[lb]" else slice(None)
        limit = 1.05 * max((float(np.nanmax(np.abs(column[inside]))) for column in shown.values()), default=0.0)
        labels = {name: printed(name.removesuffix(f" {unit}").removeprefix(f"{label} ")) for name in shown}
        said = {curve.label for panel in panels for curve in panel.curves}
        curves = [
            Curve(
                x=result.columns[ANGLE],
                y=np.where(np.abs(column) < 2.0 * limit, column, np.nan),
                # one legend serves all panels
                label="" if labels[name] in said else labels[name],
                line="--" if any(words in name for words in _DASHED) else "-",
            )
            for name, column in shown.items()
        ]
        if curves:
            panels.append(
                Panel(
                    x_label="crank angle $\\theta_1$ [deg]",
                    y_label=f"{printed_symbol(label)} {unit}",
                    curves=curves,
                    legend_at="outside",
                    x_range=(0.0, 360.0),
                    y_range=(-limit if unit in ("[lb]", "[in/s]") else 0.0, limit),
                    x_ticks=np.arange(0.0, 361.0, 60.0).tolist(),
                )
            )
    return plot_curves(panels, title=result.heading, size=(8.0, 3.2))
