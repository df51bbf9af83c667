"""Define the fifty targets of `benchmarks.race`, ten of each of five kinds.

The published targets are Youssef's (chapter VI), the 18 points of Acharyya and Mandal, Mech. Mach. Theory 44 (2009), and the
six points of a vertical line from the same literature. Youssef's targets and the vertical line keep the bounds and constraints
with which they were published. All other targets have the defaults of `synthesize`: a least transmission angle of 40 degrees
over a full turn, and no link longer than five sizes of the target; for the example's drawing no link is longer than 0.3 m. The
drawn targets are this drawing and nine curves from the random seeds 1 to 9; the last two functions come from the seeds 1 and 2.
No target was removed or changed because of a result.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi, radians, tau
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.studies.youssef.problems import PACKAGING_POINTS_CM, PROBLEMS
from analysis.synthesis import FullTurn, LargestLink, RockerFunction, TargetPath, Task, TimedPath, UntimedPath, turn
from analysis.synthesis.task.constraint import USUAL, Constraint
from analysis.synthesis.task.target import closed_vertices, interpolate_polyline

FloatArray = NDArray[np.float64]
Points = Sequence[tuple[float, float]]

#: Number of points of a timed path and of an untimed path; noise of a hand-drawn path, in sizes of the path.
TIMED, CURVE, TREMOR = 36, 72, 0.01
HAND_DRAWN = Path(__file__).parents[1] / "examples" / "hand-drawn.svg"
#: Closed curve of Acharyya and Mandal, at crank angles 20 degrees apart.
EIGHTEEN: Points = (
    (0.5, 1.1), (0.4, 1.1), (0.3, 1.1), (0.2, 1.0), (0.1, 0.9), (0.05, 0.75), (0.02, 0.6), (0.0, 0.5), (0.0, 0.4),
    (0.03, 0.3), (0.1, 0.25), (0.15, 0.2), (0.2, 0.3), (0.3, 0.4), (0.4, 0.5), (0.5, 0.7), (0.6, 0.9), (0.6, 1.0),
)  # fmt: skip
POLYGONS: Mapping[str, Points] = {
    "square": ((0, 0), (1, 0), (1, 1), (0, 1)),
    "rectangle": ((0, 0), (2, 0), (2, 1), (0, 1)),
    "equilateral triangle": ((0, 0), (1, 0), (0.5, 0.75**0.5)),
    "right triangle": ((0, 0), (4, 0), (0, 3)),
    "trapezium": ((0, 0), (3, 0), (2, 1), (1, 1)),
    "kite": ((0, -2), (1, 0), (0, 1), (-1, 0)),
    "hexagon": tuple((np.cos(k * pi / 3), np.sin(k * pi / 3)) for k in range(6)),
    "L": ((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)),
    "star": tuple(
        ((1 - 0.5 * (k % 2)) * np.sin(k * pi / 5), (1 - 0.5 * (k % 2)) * np.cos(k * pi / 5)) for k in range(10)
    ),
    "packaging": PACKAGING_POINTS_CM,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Target:
    """A synthesis task with its bounds and constraints."""

    kind: str
    name: str
    task: Task
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    constraints: tuple[Constraint, ...] = USUAL


def curves(n: int) -> dict[str, FloatArray]:
    """Return closed curves by name, at n equal steps of their parameter, each of shape (n, 2)."""
    t = turn(n)
    c, s = np.cos(t), np.sin(t)
    bean = 1.0 + 0.5 * c**3 + 0.5 * s**3
    return {
        "bean": np.column_stack([bean * c, bean * s]),
        "teardrop": np.column_stack([c, 0.8 * s * np.sin(0.5 * t) ** 2]),
        "eight": np.column_stack([s, 0.5 * np.sin(2.0 * t)]),
        "circle": np.column_stack([c, s]),
        "egg": np.column_stack([c, (0.7 + 0.15 * c) * s]),
        "superellipse": np.column_stack([np.sign(c) * np.abs(c) ** 0.5, 0.6 * np.sign(s) * np.abs(s) ** 0.5]),
        "crescent": np.column_stack([c, 0.4 * s + 0.35 * c**2]),
    }


def polygon_points(corners: ArrayLike) -> FloatArray:
    """Return `CURVE` points at equal distances along a closed polygon, shape (n, 2)."""
    line = closed_vertices(np.asarray(corners, dtype=float), True)
    length = float(np.hypot(*np.diff(line, axis=0).T).sum())
    return interpolate_polyline(line, np.linspace(0.0, length, CURVE, endpoint=False))


def hand_drawn(seed: int) -> TargetPath:
    """Return a closed path as if drawn by hand: random harmonics with noise of size `TREMOR`, smoothed."""
    random = np.random.default_rng(seed)
    t, order = turn(120), np.array([-3, -2, -1, 2, 3])
    wave = random.normal(size=(5, 2)) @ [1.0, 1j] * 0.5 / np.abs(order) ** 1.5
    z = np.exp(1j * t) + wave @ np.exp(1j * np.outer(order, t)) + TREMOR * (random.normal(size=(120, 2)) @ [1.0, 1j])
    return TargetPath(points=np.column_stack([z.real, z.imag]), closed=True).smooth(CURVE)


def random_waves(seed: int) -> RockerFunction:
    """Return the task of a random periodic rocker angle of two harmonics, with a range of 40 degrees."""
    random = np.random.default_rng(seed)
    t = turn(TIMED)
    # the amplitude of the second harmonic is about a quarter of the first
    a, b = random.normal(size=(2, 2)) / np.array([1.0, 4.0])
    both = np.outer([1.0, 2.0], t)
    angle = a @ np.cos(both) + b @ np.sin(both)
    return RockerFunction(angle=radians(40.0) * angle / np.ptp(angle), mounting=True)


def function_target(function: Any, low: float, high: float) -> RockerFunction:
    """Return the task of generating y = f(x), with x as the crank angle over 90 degrees and y as the rocker angle.

    Both scales are linear, both zeros free; y varies over 60 degrees of the rocker.
    """
    x = np.linspace(low, high, 31)
    y = function(x)
    rotation = np.linspace(0.0, 0.5 * pi, 31)
    return RockerFunction(angle=radians(60.0) * (y - y[0]) / np.ptp(y), rotation=rotation, mounting=True)


def rise_and_dwell() -> RockerFunction:
    """Return a task for a rocker that rises by 40 degrees, dwells, returns to zero, and dwells again.

    Rise and return are cycloidal and take 120 degrees of the crank each, the dwells 60 degrees.
    """
    t = np.degrees(turn(72))
    up = np.clip(t / 120.0, 0.0, 1.0) - np.clip((t - 180.0) / 120.0, 0.0, 1.0)
    return RockerFunction(angle=radians(40.0) * (up - np.sin(tau * up) / tau), mounting=True)


def _all() -> list[Target]:
    def published_targets(kind: str, *names: str) -> list[Target]:
        chosen = ((name, PROBLEMS[name]) for name in names)
        return [
            Target(kind=kind, name=name, task=p.task, bounds=p.bounds, constraints=p.constraints) for name, p in chosen
        ]

    def usual_targets(kind: str, tasks: Mapping[str, Task]) -> list[Target]:
        return [Target(kind=kind, name=name, task=task) for name, task in tasks.items()]

    def untimed_path(points: ArrayLike) -> UntimedPath:
        return UntimedPath(path=TargetPath(points=np.asarray(points, dtype=float), closed=True))

    timed, smooth = curves(TIMED), curves(CURVE)
    third = np.linspace(0.0, radians(120.0), 21)
    vertical = TimedPath(points=[(20.0, 20.0 + 5.0 * k) for k in range(6)], rotation=pi / 6.0 * np.arange(1, 7))
    half = np.linspace(0.0, pi, 37)
    foot = np.column_stack([np.cos(half), 0.5 * np.sin(half)])
    return [
        *published_targets("timed", "ellipse-a", "ellipse-b", "ellipse-a-bounded"),
        Target(kind="timed", name="vertical line", task=vertical, constraints=(FullTurn(), LargestLink(length=60.0))),
        *usual_targets(
            "timed",
            {
                "18 points": TimedPath(points=EIGHTEEN, rotation=radians(20.0) * np.arange(18)),
                "line in a third of a turn": TimedPath(points=np.column_stack([third, 0.0 * third]), rotation=third),
                "line and return": TimedPath(points=np.column_stack([np.cos(turn(TIMED)), np.zeros(TIMED)])),
                **{name: TimedPath(points=timed[name]) for name in ("bean", "teardrop", "eight")},
            },
        ),
        *published_targets("untimed", "path-a", "path-b"),
        *usual_targets("untimed", {name: untimed_path(smooth[name]) for name in smooth}),
        Target(kind="untimed", name="foot", task=untimed_path(polygon_points(foot))),
        *usual_targets("polygonal", {name: untimed_path(points) for name, points in POLYGONS.items()}),
        Target(
            kind="drawn",
            name="example",
            task=UntimedPath(path=TargetPath.from_file(HAND_DRAWN).smooth(CURVE)),
            constraints=(LargestLink(length=0.3), *USUAL),
        ),
        *usual_targets("drawn", {f"seed {seed}": UntimedPath(path=hand_drawn(seed)) for seed in range(1, 10)}),
        *published_targets("function", "rocker", "rocker-weighted"),
        *usual_targets(
            "function",
            {
                "sine": function_target(np.sin, 0.0, 0.5 * pi),
                "square": function_target(np.square, 0.0, 1.0),
                "exponential": function_target(np.exp, 0.0, 1.0),
                "reciprocal": function_target(np.reciprocal, 1.0, 2.0),
                "logarithm": function_target(np.log, 1.0, 2.0),
                "rise and dwell": rise_and_dwell(),
                "waves 1": random_waves(1),
                "waves 2": random_waves(2),
            },
        ),
    ]


TARGETS: tuple[Target, ...] = tuple(_all())
