"""Where a four-bar stands still or cannot go on, and what its crank gains: dead centres, toggles, time ratio, advantage.

In a dead centre crank and coupler lie in one line, and the rocker rests at the end of its swing; in a toggle coupler and rocker
do, and the crank can go no farther. See R. L. Norton, Design of Machinery, 6th ed., 2020, chapters 2, 3 and 6.
"""

from __future__ import annotations

from math import acos, inf, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import ParameterError

from .linkage import Linkage

FloatArray = NDArray[np.float64]


def dead_centres(linkage: Linkage) -> tuple[float, ...]:
    """Crank rotations at which the rocker rests, within a turn from 0 (rad), increasing; none where the rocker never rests.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    l1, l2, l3, l4 = _lengths(linkage)
    found = []
    # C from A with coupler and crank in line, stretched and folded
    for reach in (l3 + l2, l3 - l2):
        if reach == 0.0:
            continue
        cosine = (l1 * l1 + reach * reach - l4 * l4) / (2.0 * l1 * abs(reach))
        if abs(cosine) > 1.0:
            continue
        # the coupler points to the side of the assembly
        th3 = linkage.branch * (acos(cosine) if reach > 0.0 else pi - acos(cosine))
        found.append(th3 if reach == l3 + l2 else th3 + pi)
    return tuple(sorted((th2 - linkage.crank_phase) % (2.0 * pi) for th2 in found))


def toggles(linkage: Linkage) -> tuple[float, ...]:
    """Crank rotations at which coupler and rocker lie in one line, within a turn from 0 (rad); none if the crank turns fully.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    l1, l2, l3, l4 = _lengths(linkage)
    found = []
    for reach in (l3 + l4, abs(l3 - l4)):
        cosine = (l1 * l1 + l2 * l2 - reach * reach) / (2.0 * l1 * l2)
        if abs(cosine) <= 1.0:
            found += [acos(cosine), -acos(cosine)]
    return tuple(sorted((th2 - linkage.crank_phase) % (2.0 * pi) for th2 in found))


def time_ratio(linkage: Linkage) -> float | None:
    """Time of the rocker's slow swing over that of its quick one, the crank turning evenly: 1 at least.

    None where the crank cannot turn fully, or the rocker turns with it.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    rests = dead_centres(linkage)
    if len(rests) != 2 or not linkage.turns_fully:
        return None
    way = rests[1] - rests[0]
    return max(way, 2.0 * pi - way) / min(way, 2.0 * pi - way)


def mechanical_advantage(linkage: Linkage, rotation: ArrayLike) -> FloatArray:
    """Torque on the rocker for a torque on the crank, without friction and masses: the crank's speed over the rocker's.

    Infinite in a dead centre, zero in a toggle; NaN where the links cannot be joined. Shape of the rotations.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    _lengths(linkage)
    phi = np.atleast_1d(np.asarray(rotation, dtype=float))
    c3, s3, c4, s4, _, _ = linkage.directions(phi)
    th2 = phi + linkage.crank_phase
    gained = linkage.rocker_length * (s3 * c4 - c3 * s4)
    given = linkage.crank_length * (s3 * np.cos(th2) - c3 * np.sin(th2))
    with np.errstate(divide="ignore"):
        ratio = np.where(given == 0.0, inf, gained / np.where(given == 0.0, 1.0, given))
    return np.where(np.isfinite(gained), ratio, np.nan).reshape(np.shape(rotation))


def _lengths(linkage: Linkage) -> tuple[float, float, float, float]:
    """l1 ... l4 of a four-bar.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    if linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: dead centres, toggles and time ratio are a four-bar's")
    return linkage.ground_length, linkage.crank_length, linkage.coupler_length, linkage.rocker_length
