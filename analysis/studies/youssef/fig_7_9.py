"""Fig 7.9: links and slider optimised together for path (b).

The thesis moves the slider of links that were found without it. Here both are free at once, under the conditions of our
four-bar of Fig 6.10: no link longer than the longest printed one and a transmission angle of at least 40 degrees, and a stroke
of at most 5 cm. One harmonic hardly helps the four-bar, which leaves 0.29 cm2 already; two bring the area down by an order of
magnitude, with a stroke of some 2 cm.

Whether the thesis shows this is lost: that it stands under this number is our assignment, and the bounds are our choice.
"""

from __future__ import annotations

from functools import cache
from math import degrees, pi

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import Figure, plot_curves
from ...motion import slider_motion
from ...synthesis import LINKS, Search, SliderUnknown, Solution
from ...synthesis.published import PROBLEMS
from ..study import OURS, Study, StudyResult, at_least, at_most
from ._chapter_6 import TRANSMISSION, best
from ._chapter_7 import ASSIGNED, PATH, path_columns, path_motion, path_panels, shown, slider, sound

NUMBER = "7.9"
#: Greatest stroke (m).
STROKE = 0.05
#: Area that our four-bar was to reach (cm2).
FOUR_BAR = 0.31
NAMES = {"four-bar": 0, "one": 1, "two": 2}


@cache
def together(harmonics: int) -> Solution:
    """The best linkage with its slider moved by so many harmonics, from the four-bar on; none is the four-bar itself."""
    p, four_bar = PROBLEMS[PATH], best(PATH)
    if harmonics == 0:
        return four_bar
    longest = p.linkage.largest_link
    bounds = {
        **dict.fromkeys(("pivot_x", "pivot_y"), (-2.0 * longest, 2.0 * longest)),
        **dict.fromkeys((*LINKS, "point_distance"), (1e-3, longest)),
        **dict.fromkeys(("ground_angle", "crank_phase", "point_angle"), (-2.0 * pi, 2.0 * pi)),
    }
    unknown = SliderUnknown(harmonics=harmonics, stroke=STROKE)
    motion = slider_motion(
        p.task, four_bar, unknown, bounds=bounds, constraints=p.constraints, guesses=[four_bar], search=Search(starts=0)
    )
    return motion.best


def compute() -> StudyResult:
    """The four-bar and the two mechanisms with a moved slider."""
    found = {name: together(n) for name, n in NAMES.items()}
    errors = {name: shown(PATH, solution) for name, solution in found.items()}
    moved = [s.linkage for name, s in found.items() if NAMES[name]]
    longest = max(max(k.largest_link, k.point_distance) for k in moved)
    verdicts = (
        at_most("area of the four-bar", OURS, FOUR_BAR, errors["four-bar"], "cm2"),
        at_least("area of the four-bar, of that with one harmonic", OURS, 1.0, errors["four-bar"] / errors["one"]),
        at_least("area of the four-bar, of that with two", OURS, 8.0, errors["four-bar"] / errors["two"]),
        at_least(
            "area of the printed links with two harmonics, of that with free ones",
            OURS,
            50.0,
            shown(PATH, path_motion(2)) / errors["two"],
        ),
        at_most(
            "greatest stroke",
            OURS,
            CM_PER_METRE * STROKE * (1.0 + 1e-6),
            CM_PER_METRE * max(slider(k).stroke for k in moved),
            "cm",
        ),
        at_least(
            "least transmission angle",
            OURS,
            TRANSMISSION - 1e-3,
            degrees(min(k.least_transmission for k in moved)),
            "deg",
        ),
        at_most(
            "longest link, the coupler point's distance with them",
            OURS,
            CM_PER_METRE * PROBLEMS[PATH].linkage.largest_link * (1.0 + 1e-6),
            CM_PER_METRE * longest,
            "cm",
        ),
        sound("no circuit, branch or order defect", *found.values()),
    )
    return StudyResult(
        number=NUMBER,
        claim="Links and slider optimised together do better than either alone.",
        assignment=f"{ASSIGNED} The bound of the stroke, 5 cm, is our choice.",
        columns=path_columns({name: s.linkage for name, s in found.items()}),
        verdicts=verdicts,
    )


def draw(result: StudyResult) -> Figure:
    """Curves, distances, and the slider."""
    words = {"four-bar": "four-bar", "one": "1 harmonic", "two": "2 harmonics"}
    labels = {name: f"{words[name]}: {shown(PATH, together(n)):.2g} cm$^2$" for name, n in NAMES.items()}
    return plot_curves(path_panels(result, labels), title=result.heading, size=(7.6, 2.6))


STUDY = Study(NUMBER, compute, draw)
