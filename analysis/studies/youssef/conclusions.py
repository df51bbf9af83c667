"""Verdicts on the conclusions of the thesis: on each sentence of sections 8.0 and 9.1 that makes a claim.

Most of these sentences sum up statements that are judged in the chapters; here each sentence is judged again as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

from ...slider import slider_motion
from ...synthesis import Search, SliderUnknown, UntimedPath, path_from_formula
from ...units import CM_PER_METRE
from ..rules import ABOUT, ALIKE, SEEN_FALL, SMALL
from ..statements import Statement, at_least, at_most, statement, unjudged
from ..study import Study, StudyResult
from .chapter_6 import TABLE, ratios_to_least
from .conclusions_linear import judge_introduction, judge_linearised
from .conclusions_motion import judge_constant_speed, judge_equations, judge_launches
from .problems import AREA_N, AS_FOUND, PROBLEMS
from .rig_2 import LACKS, ORDERS, RANGE, linear_error
from .rigs import LOST, overtones, turn
from .series_2 import best_error_ratios, error_ratios, out_of_reach, path_motion, shares_of_stated
from .stated_errors import share_of_stated

#: Longer semi-axes of the ellipses that links move along (cm): those of paths (a) and (b), and one between.
ELLIPSES = {"path (a), 10 cm": 10.0, "12.5 cm": 12.5, "path (b), 15 cm": 15.0}


def ellipse_error(semi_axis: float) -> float:
    """Return the least area between an ellipse and the coupler curve of path (b)'s links, relative to the ellipse's area.

    ``semi_axis`` is in cm. The rocker pivot moves with five harmonics; one start of the search is the best motion for path (b).
    """
    p = PROBLEMS["path-b"]
    formula = f"0.20 + {semi_axis / CM_PER_METRE:g}*cos(t)"
    task = UntimedPath(path=path_from_formula(formula, "0.15 + 0.05*sin(t)", n=AREA_N))
    unknown = SliderUnknown(harmonics=5, stroke=0.25)
    found = slider_motion(task, p.linkage, unknown, guesses=[path_motion(5)], search=Search(starts=1))
    return p.convert(found.best.error) / (5.0 * pi * semi_axis)


def judge_second_input() -> Iterator[Statement]:
    """Judge the conclusions on the slider as a second input."""
    yield statement(
        "The releasing of some constraints in linkage mechanisms and treating them as inputs that may be controlled "
        "yield versatile and powerful mechanisms.",
        "9.1, L6993",
        why="there is no measure of *versatile* and *powerful*",
    )
    yield statement(
        "For example the introduction of a second input to a four bar linkage gives a variety of outputs thus making "
        "the linkage a multipurpose mechanism which may be adapted to generate a family of [output] motions.",
        "9.1, L6997",
        "area between an ellipse and the curve of the links printed for path (b), mended, relative to the area of the "
        "ellipse. The family has three ellipses with longer semi-axes of 10 to 15 cm; the slider has five harmonics and "
        "a stroke of at most 25 cm (all our choice)",
        f"{ALIKE:g}, the rule for *the same*",
        *(at_most(name, ALIKE, ellipse_error(axis_cm)) for name, axis_cm in ELLIPSES.items()),
    )
    yield statement(
        "[A] proper control of the slider enabled modifications and more accurate generation of outputs than could "
        "otherwise be obtained.",
        "9.1, L7012",
        "error with the best two harmonics of the slider, relative to that with the pivot fixed and the same links, as "
        "we read *otherwise*: for the printed links, mended, in eight problems, and for our best links in seven. Stroke "
        "and packaging machine are as at L5935",
        SEEN_FALL,
        at_most("printed links, the most of eight", 1.0 - ALIKE, max(error_ratios().values())),
        at_most("best links, the most of seven", 1.0 - ALIKE, max(best_error_ratios().values())),
    )
    yield statement(
        "However, the control of this second input produced changes that were limited by an envelope dictated by the "
        "linkage kinematics.",
        "9.1, L7016",
        "area of that part of path (b) which lies farther from the crank shaft than l2 + r, the reach of its printed "
        "links with any motion of the slider",
        "more than 0.01 cm2, which exceeds the error of the area",
        at_least("out of reach", 0.01, out_of_reach(), "cm2"),
    )
    yield statement(
        "Therefore it was logical firstly to find the linkage that would approximately generate the desired output and "
        "then secondly to introduce a second input and control it for more accurate generation.",
        "9.1, L7020",
        why="this is a choice; no other order is tried",
    )


def judge_synthesis() -> Iterator[Statement]:
    """Judge the conclusions on the synthesis of linkages."""
    ratios = ratios_to_least()
    shares = [*(share_of_stated(row.problem) for row in TABLE.values()), *shares_of_stated().values()]
    kept = sum(share <= 1.0 + ABOUT for share in shares)
    weighted = AS_FOUND["rocker-weighted"]
    assert weighted.error is not None
    of_minima = weighted.linkage_error(weighted.linkage) / weighted.error
    yield statement(
        "As a result an optimisation method was developed, the output of which gave a planar linkage that minimised the "
        "errors involved in function or path generation.",
        "9.1, L7026",
        f"error of the {len(ratios)} printed linkages whose error the thesis states, mended, relative to the least that "
        "we find within our limits (see the head of chapter VI); at Figs 6.7 and 6.8 in the reading chosen there, in which "
        "both linkages are minima",
        f"{1.0 + ALIKE:g}, the rule for *the same*",
        *(
            at_most(name, 1.0 + ALIKE, ratio, why="the other linkages do not have the least error")
            for name, ratio in ratios.items()
        ),
    )
    yield statement(
        "The method could be applied to any planar linkage and was implemented as a package of subroutines for general use.",
        "9.1, L7030",
        why="it is applied to four-bars and to one five-bar. That it is a package only tells what was done (appendix 5)",
    )
    yield statement(
        "The optimisation method was applied to a variety of examples and in most cases produced satisfactory results.",
        "9.1, L7037",
        "*satisfactory* is read as: the printed linkage has the error that the thesis states. Number of linkages whose "
        f"error is at most {1.0 + ABOUT:g} times the stated one, of {len(shares)}: {len(ratios)} of chapter VI, and two "
        "with the series of Figs 7.11 and 7.12. They are mended. Each rocker function is in the reading whose error comes "
        "nearest to the stated one, and the series are in the best of their readings",
        f"more than half, as *most* says; {ABOUT:g}, the rule for *about*",
        at_least("keep their error", 0.5 * len(shares), kept),
        unjudged(
            "the other examples",
            "no error is stated for the packaging machine, for series 1 of chapter VII and for the others of 7.3.2 (L5935)",
        ),
        why=f"in the reading of L7026 the weighted rocker function has {of_minima:.2f} times its stated error, so "
        f"that {kept - 1} of {len(shares)} keep theirs",
    )


def judge_experiment() -> Iterator[Statement]:
    """Judge the conclusions on the experiment."""
    yield statement(
        "It was found that good agreement existed between the two in both phase and amplitude [of the numerical solutions "
        "of chapter III and the experiments on rig 1].",
        "9.1, L7134",
        why=LOST,
    )
    yield statement(
        "The assumptions were found to be reasonable and good agreement between theory and experiment was found in the "
        "resonance behaviour.",
        "9.1, L7145",
        "two assumptions of chapter IV: relative error of the amplitude by its linear equation, as at L6974; greatest of "
        "the harmonics 3 to 6, which it ignores, relative to the greater of the first two. The greatest values for "
        "springs C and D, 300 to 1000 rpm (L6812) in steps of 10",
        f"{SMALL:g}, the rule for *negligible*",
        *(
            at_most(f"linear equation, {name} order", SMALL, max(linear_error(s, order) for s in "CD"), why=LACKS)
            for name, order in ORDERS.items()
        ),
        at_most("third and higher harmonics", SMALL, max(overtones(turn(s, w)) for s in "CD" for w in RANGE)),
        unjudged("agreement with the experiment", LOST),
    )


def compute() -> StudyResult:
    """Judge the sentences of sections 8.0 and 9.1 that make a claim."""
    return StudyResult(
        claim="What the introduction to the experiments says of the theory (8.0), and what the thesis concludes (9.1).",
        assignment="Sentences that only tell what was done claim nothing and have no verdict: L6045 to 6053, 6067 to 6094, "
        "7005, 7034, 7041, 7045, 7061, 7065, 7096, 7108, 7128, 7130, 7136, 7140.",
        statements=(
            *judge_introduction(),
            *judge_second_input(),
            *judge_synthesis(),
            *judge_equations(),
            *judge_constant_speed(),
            *judge_launches(),
            *judge_linearised(),
            *judge_experiment(),
        ),
    )


#: The study by its name.
STUDIES = {"conclusions": Study(compute)}
