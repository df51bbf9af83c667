"""What a picture or a drawing of a solution shows: the linkage in its positions, its curve, its target."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError

from .linkage import Linkage, SecondCrank, SliderMotion
from .solution import CURVE, Solution, angle_at_c, target_points, whole_turn
from .tasks import UntimedPath

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinkageScene:
    """A solution as it is drawn, in m and rad, with the title of the picture."""

    solution: Solution
    title: str = ""

    @property
    def linkage(self) -> Linkage:
        """The linkage that was found."""
        return self.solution.linkage

    def pins(self, rotation: float) -> Mapping[str, tuple[float, float]] | None:
        """Places of A, B, C, D, E and, where the task has target points, P; None where the links cannot be joined."""
        try:
            pins = self.linkage.pins(rotation)
        except AssemblyError:
            return None
        if self.target is None:
            del pins["P"]
        return pins

    @property
    def _closed(self) -> bool:
        return isinstance(self.solution.task, UntimedPath) and self.solution.task.path.closed

    @cached_property
    def turn(self) -> FloatArray:
        """Crank rotations over a whole turn, from the least at which the task is done, shape (n,)."""
        begin = 0.0 if self._closed else float(self.solution.rotation.min())
        return begin + np.linspace(0.0, 2.0 * pi, 2 * CURVE + 1)

    @cached_property
    def way(self) -> FloatArray:
        """Crank rotations over which the task is done, close to one another, shape (n,)."""
        at = self.solution.rotation
        if self._closed or whole_turn(at):
            return self.turn
        return np.linspace(at.min(), at.min() + np.ptp(at), 2 * CURVE + 1)

    @property
    def rotation(self) -> FloatArray:
        """Crank rotations over which the task is done, in their order: its stations, or a turn."""
        return self.turn if self.way is self.turn else self.solution.rotation

    @cached_property
    def target(self) -> FloatArray | None:
        """Points that are asked for, shape (n, 2); None of a rocker function."""
        return target_points(self.solution.task)

    @property
    def target_closed(self) -> bool | None:
        """Whether the target is a closed line (True), an open one (False), or only points (None)."""
        task = self.solution.task
        return task.path.closed if isinstance(task, UntimedPath) else None

    @property
    def timed(self) -> bool:
        """Whether the task gives the crank rotations of its targets."""
        task = self.solution.task
        return not isinstance(task, UntimedPath) and task.rotation is not None

    @cached_property
    def stations(self) -> dict[str, FloatArray]:
        """Columns by name with unit, such as ``error [m]``; see `Solution.columns`."""
        return self.solution.columns()

    @cached_property
    def curves(self) -> tuple[FloatArray, ...]:
        """The coupler curve over all that the crank can turn, in pieces of shape (n, 2); none without target points."""
        if self.target is None:
            return ()
        points = self.linkage.path(self.turn)
        there = np.isfinite(points).all(axis=1)
        pieces = np.split(points, np.flatnonzero(np.diff(there.astype(int))) + 1)
        return tuple(p for p in pieces if np.isfinite(p).all() and len(p) > 1)

    @cached_property
    def traced(self) -> FloatArray | None:
        """The part of the coupler curve that does the task, shape (n, 2); None of a rocker function."""
        return None if self.target is None else self.linkage.path(self.way)

    @cached_property
    def function(self) -> FloatArray | None:
        """Of a rocker function, crank rotation and angle of the rocker over the task, shape (2, n)."""
        return np.vstack([self.way, self.linkage.rocker_angle(self.way)]) if self.target is None else None

    @cached_property
    def guide(self) -> FloatArray | None:
        """Ends of the travel of the slider that carries D, or C of a slider-crank, shape (2, 2); None without a slider."""
        linkage, pivot = self.linkage, self.linkage.pivot
        if linkage.slides:
            u, direction = linkage.slider_position(self.turn), 1j
        elif isinstance(pivot, SliderMotion):
            u, direction = pivot.series(self.turn), np.exp(1j * pivot.guide_angle)
        else:
            return None
        ends = complex(linkage.pivot_x, linkage.pivot_y) + np.exp(1j * linkage.ground_angle) * (
            linkage.ground_length + np.array([np.nanmin(u), np.nanmax(u)]) * direction
        )
        return np.column_stack([ends.real, ends.imag])

    @property
    def second_crank(self) -> bool:
        """Whether D is on a second crank about E."""
        return isinstance(self.linkage.pivot, SecondCrank)

    @property
    def lettered(self) -> str:
        """Pins that are drawn with their letters: E only of a second crank, D and P not where they are C."""
        own = ("" if self.linkage.slides else "D") + ("E" if self.second_crank else "")
        return "ABC" + own + ("" if self.linkage.slider_is_point else "P")

    @cached_property
    def transmission(self) -> FloatArray:
        """Crank rotation over a turn and the angle between coupler and rocker, NaN where they are not joined, (2, n)."""
        return np.vstack([self.turn, angle_at_c(self.linkage, self.turn)])

    @property
    def motion(self) -> tuple[str, FloatArray] | None:
        """How the rocker pivot moves over a turn: ``slider position [m]`` or ``second crank [rad]``; None if it is fixed.

        Of a slider-crank the slider's position.
        """
        pivot = self.linkage.pivot
        if self.linkage.slides:
            return "slider position [m]", self.linkage.slider_position(self.turn)
        if isinstance(pivot, SliderMotion):
            return "slider position [m]", pivot.series(self.turn)
        return None if pivot is None else ("second crank [rad]", pivot.angle(self.turn))
