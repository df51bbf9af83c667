"""Verdicts on the conclusions of section 3.3 on the method."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..statements import FloatArray, Statement, at_least, near, statement
from ..study import Study, StudyResult
from ..variation import ignore_changes
from .figures import ALL, FROM_DEAD, NOTHING, ROUNDING, clear_mask, nothing, values
from .forces import PLANAR, planar_forces
from .iteration import endings
from .method import OUT, PLANE
from .table import COMPONENTS


def _design() -> Iterator[Statement]:
    """Judge what section 3.3 says of the method's use in design, by the errors of the printed equations in the plane."""
    right = {symbol: values(PLANE, COMPONENTS[symbol]) for symbol in PLANAR}
    static = planar_forces(erratum_5=True, erratum_6=True, share=0.0)
    inertial = {s: right[s] - static[s] for s in PLANAR}
    printed = planar_forces(erratum_5=False, erratum_6=False)

    def error(correct: dict[str, FloatArray]) -> float:
        """Return the greatest error of the printed equations over the components of ``correct``, relative to their maxima.

        Components that vanish in ``correct`` are left out.
        """
        sizes = {s: np.abs(x)[clear_mask(PLANE)].max() for s, x in correct.items()}
        return max(
            float(np.abs(printed[s] - right[s])[clear_mask(PLANE)].max() / size)
            for s, size in sizes.items()
            if size > NOTHING
        )

    varied = sum(len(set(values)) > 1 for values in list(zip(*ALL))[1:])
    kinds, place = "dimensions that are varied", "section 3.3, L1129"
    yield statement(
        "Since the present work investigates dynamic forces and torques at each joint of a slider crank with "
        "all kinds of manufacturing tolerances, the results provide information needed for the sizing and "
        "dynamic balancing of a high speed slider crank in the design stage.",
        place,
        "number of the dimensions a1, a2, a4, S1, alpha4 that section 3.1 varies; *all kinds* is read as of all five. Then the "
        f"greatest errors by the printed equations in the plane, a4 = 10 in, {FROM_DEAD}: of a joint force, relative to its "
        "greatest value; of the bearing force, relative to the greatest part of it that is due to inertia",
        f"none for a count; {ROUNDING}",
        near(kinds, 5.0, varied, 0.0),
        nothing("for sizing, joint forces", error(right)),
        nothing("for balancing, bearing", error({s: inertial[s] for s in ("1F1i", "1F1j")})),
        why="a1 and a2 are not varied. Errata 5 and 6: with both mended, the forces are right",
    )
    yield statement(
        "This analysis can be used to determine the effect and significance of the inertia forces acting on "
        "each link due to its own mass and mass moment of inertia.",
        place,
        f"greatest error of a joint force by the printed equations in the plane, a4 = 10 in, {FROM_DEAD}, relative to "
        "the greatest part of this force that is due to inertia",
        ROUNDING,
        nothing("as printed", error(inertial)),
        why="errata 5 and 6: with both mended, the forces are right",
    )
    yield statement(
        "It is expected that this investigation will enable designers to have better insight into the "
        "designing and testing of high speed spatial mechanisms and robot manipulators.",
        place,
        why="an expectation, for which the thesis gives no measure",
    )


def conclusions() -> StudyResult:
    """Judge the statements of section 3.3 on the method as a whole."""
    ended = endings(OUT)
    cases = (
        f"the {len(ended)} cases out of the plane in the figures for which the printed iteration closes the loop at every 30 "
        "deg, starting from the planar estimate"
    )
    all_closed = f"all of them; a loop counts as closed up to {NOTHING:g} rad, for rounding errors"
    closed = float(np.mean([found.rotation_residual.max() < NOTHING for found in ended]))
    numbers = float(np.mean([np.isfinite(found.unknowns).all() for found in ended]))
    place = "section 3.3, L1131"
    return StudyResult(
        claim="Rahman states: the method serves the design of spatial mechanisms, and is general, concise and economical. What "
        "section 3.3 says of displacements, forces and convergence is judged at Figs R5, R8, R14 and in rahman-closure.",
        statements=(
            statement(
                "This [agreement in the plane] verifies the feasibility of the method.",
                "section 3.2, L1111",
                f"share of {cases}",
                all_closed,
                at_least("cases closed", 1.0, closed),
                why="the planar case, in which eta2 = eta3 = 0, does not show erratum 1",
            ),
            *_design(),
            statement(
                "Since this method is well adapted for digital computation, any complex system can be analyzed using this "
                "analytical tool.",
                place,
                f"share of {cases}",
                all_closed,
                at_least("cases closed", 1.0, closed),
                why="the method cannot analyse its own mechanism out of the plane (erratum 1); the computation is judged in "
                "the next row",
            ),
            statement(
                "The main advantages of this method are its generality and that all calculations can be performed on "
                "digital computer.",
                place,
                f"generality: share of {cases}; calculations: share of them in which it ends with numbers at these angles",
                all_closed,
                at_least("generality", 1.0, closed),
                at_least("calculations", 1.0, numbers),
                why="it is not general (erratum 1)",
            ),
            statement(
                "Other advantages are that this method is concise, flexible, economical and its analytical approach "
                "is independent of visualization.",
                place,
                why="the thesis gives no measure of any of these",
            ),
        ),
    )


#: The study by its name.
STUDIES = {"rahman-conclusions": Study(ignore_changes(conclusions))}
