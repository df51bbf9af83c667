"""Group solutions that are practically the same linkage: mirror images and near copies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...display import format_count
from ..linkage.linkage import LINKS, Linkage, SliderCrank
from ..linkage.pivot import SecondCrank, gear_turns
from ..task.task import RockerFunction
from .solution import Solution

#: Greatest differences of near copies: position of a pin, relative to the longest link; ratio of two lengths of one link.
SHARE, RATIO = 0.03, 1.25


def group_similar(solutions: Sequence[Solution]) -> tuple[Solution, ...]:
    """Group similar solutions; return the first solution of each group, with the rest of the group as its ``variants``.

    Solutions count as similar if their linkages differ only in position in the plane, sense of rotation or start of the crank;
    for a rocker function they may also differ in size. Linkages with a commanded pivot are never grouped.
    """
    groups: list[list[Solution]] = []
    for solution in solutions:
        group = next((g for g in groups if _compare_linkages(g[0], solution) is not None), None)
        if group is None:
            groups.append([solution])
        else:
            group.append(solution)
    return tuple(replace(g[0], variants=(*g[0].variants, *g[1:])) for g in groups)


def format_variants(solution: Solution) -> str:
    """Format the number of mirror images and near copies that a solution represents, as in "2 mirror images, 1 near copy"."""
    mirrored = sum(_compare_linkages(solution, other) == -1 for other in solution.variants)
    counts = (("mirror image", mirrored), ("near copy", len(solution.variants) - mirrored))
    return ", ".join(format_count(count, name) for name, count in counts if count)


def _compare_linkages(one: Solution, other: Solution) -> int | None:
    """Return 1 if two linkages are near copies, -1 if one is near the other's mirror image, otherwise None."""
    a, b = one.linkage, other.linkage
    if a.kind != b.kind or _gear_ratio(a) is None or _gear_ratio(a) != _gear_ratio(b):
        return None
    links = [np.array([abs(getattr(x, name)) for name in x.links]) for x in (a, b)]
    if isinstance(one.task, RockerFunction):
        links = [lengths / lengths.max() for lengths in links]
    if (np.abs(np.log(links[0] / links[1])) > np.log(RATIO)).any():
        return None
    own, *_ = _coupler_sides(a)
    for side in _coupler_sides(b):
        if np.abs(_shape(a, own) - _shape(b, side)).max() <= SHARE:
            return own * side
    return None


def _gear_ratio(linkage: Linkage) -> float | None:
    """Return the gear ratio of a second crank, 0 for a fixed rocker pivot, None for a commanded pivot."""
    pivot = linkage.pivot
    if pivot is None:
        return 0.0
    return pivot.ratio if isinstance(pivot, SecondCrank) and pivot.series.order == 0 else None


def _coupler_sides(linkage: Linkage) -> tuple[int, ...]:
    """Return the sides of B -> D on which C can lie: +1 left, -1 right.

    The assembly determines one side. A slider-crank with almost no offset has both sides, the side of its assembly first.
    """
    if not isinstance(linkage, SliderCrank):
        return (linkage.branch,)
    offset = linkage.ground_length
    side = linkage.branch if offset >= 0.0 else -linkage.branch
    return (side, -side) if abs(offset) <= SHARE * linkage.largest_link else (side,)


def _shape(linkage: Linkage, side: int) -> NDArray[np.float64]:
    """Return links, coupler point and second crank relative to the longest link, mirrored so that C lies to the left."""
    point = linkage.point_distance * np.exp(1j * side * linkage.point_angle)
    second, pivot = 0j, linkage.pivot
    if isinstance(pivot, SecondCrank):
        # its angle while the first crank lies along the ground link, times the turns k so that whole turns do not matter
        k, m = gear_turns(pivot.ratio)
        second = pivot.length * np.exp(1j * side * (k * pivot.phase - m * linkage.crank_phase))
    links = (abs(getattr(linkage, name)) for name in LINKS)
    return np.array([*links, point.real, point.imag, second.real, second.imag]) / linkage.largest_link
