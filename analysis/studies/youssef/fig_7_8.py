"""Fig 7.8: the slider moved by three and by five harmonics for path (b), the printed links kept.

What more harmonics than the thesis's two bring: 2.98 cm2 with three, 2.28 with five. The better motions need a longer stroke on
an inclined guide. No motion at all can trace the whole ellipse with these links: P is never farther from the crank shaft than
l2 + r, and 0.93 cm2 of it, at the lower right, lie beyond. Fig 7.9 lets the links go.

Which motions the thesis's figure shows is lost: that these two stand under this number is our assignment, and the bounds of
the search, a right angle for the guide and 25 and 18 cm of stroke, are our choice.
"""

from __future__ import annotations

from ...figures import Figure, plot_curves
from ...synthesis import UntimedPath
from ...synthesis.published import PROBLEMS
from ..study import OURS, Study, StudyResult, at_least, at_most
from ._chapter_7 import ASSIGNED, PATH, PATH_SEARCHES, path_columns, path_motion, path_panels, shown, slider, sound

NUMBER = "7.8"
#: Harmonics in words and in number, and the area that is to be reached (cm2).
GOALS = {"three": (3, 3.05), "five": (5, 2.35)}
#: Sides of the polygon for a quarter of a circle.
QUARTER = 20000


def out_of_reach() -> float:
    """Area of the ellipse that is farther from the crank shaft than l2 + r (cm2)."""
    from shapely import Point, Polygon

    p = PROBLEMS[PATH]
    assert isinstance(p.task, UntimedPath)
    reach = Point(p.linkage.pivot_x, p.linkage.pivot_y).buffer(
        p.linkage.crank_length + p.linkage.point_distance, quad_segs=QUARTER
    )
    return p.convert(Polygon(p.task.path.points).difference(reach).area)


def compute() -> StudyResult:
    """The best motion with three harmonics, and with five."""
    found = {word: path_motion(n) for word, (n, _) in GOALS.items()}
    errors = {word: shown(PATH, solution) for word, solution in found.items()}
    verdicts = (
        *(at_most(f"area with {word} harmonics", OURS, goal, errors[word], "cm2") for word, (_, goal) in GOALS.items()),
        at_least("area with three harmonics, of that with five", OURS, 1.0, errors["three"] / errors["five"]),
        at_least("area with five harmonics, of what lies out of reach", OURS, 1.0, errors["five"] / out_of_reach()),
        at_most(
            "greatest stroke of the slider, of what it may use",
            OURS,
            1.0 + 1e-3,
            max(slider(path_motion(n).linkage).stroke / PATH_SEARCHES[n][1] for n, _ in GOALS.values()),
        ),
        sound("no circuit, branch or order defect with either", *found.values()),
    )
    return StudyResult(
        number=NUMBER,
        claim="With more harmonics of the slider the coupler curve comes nearer to its path.",
        assignment=ASSIGNED,
        columns=path_columns({"fixed": PROBLEMS[PATH].linkage} | {word: s.linkage for word, s in found.items()}),
        verdicts=verdicts,
    )


def draw(result: StudyResult) -> Figure:
    """Curves, distances, and the slider."""
    labels = {word: f"{n} harmonics: {shown(PATH, path_motion(n)):.3g} cm$^2$" for word, (n, _) in GOALS.items()}
    panels = path_panels(result, {"fixed": "pivot fixed: 12.6 cm$^2$"} | labels)
    return plot_curves(panels, title=result.heading, size=(7.6, 2.6))


STUDY = Study(NUMBER, compute, draw)
