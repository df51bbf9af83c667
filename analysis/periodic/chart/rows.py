"""Collect the operating points of a row of a chart in arrays, for the kernels that solve the row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.parameters import field_name

from ...mechanisms import Parameters
from ...run.varied import VariedSequence, array_functions, check_sets, varied_constants
from ..motion.discretisation import OperatingPoint, collocation_serves, operating_point
from ..motion.flow import Flow
from ..motion.orbit import MOST_ITERATIONS, SEARCH_TOLERANCE
from ..motion.variables import NamedPlane, Plane, parameter_places
from .kernels import Points, Search

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PointRow:
    """The m operating points of a row of a chart, which share a flow.

    Attributes
    ----------
    first : OperatingPoint
        The first point.
    constants, vectors, scales : ndarray, shapes (m, constants), (m, drive) and (m, n)
        Constants of the equations, drive vectors (`Drive.vector`), and magnitudes of y, of each point.
    smooth : bool
        Whether collocation can be used at all points.
    """

    first: OperatingPoint
    constants: FloatArray
    vectors: FloatArray
    scales: FloatArray
    smooth: bool

    @property
    def flow(self) -> Flow:
        """The flow of the mechanism that all the points share."""
        return self.first.flow

    @property
    def switched(self) -> bool:
        """Whether the mechanism's switch (friction by joint forces) is on at any point: see `Mechanism.is_switched_on`."""
        place = self.first.mechanism.switch_index
        return place >= 0 and bool(self.constants[:, place].any())

    def points(self) -> Points:
        """Return the data of the points as arrays for the kernels."""
        numbers, vectors = self.constants, self.vectors
        return Points(
            np.hstack([numbers, np.zeros_like(numbers)]), np.hstack([vectors, np.zeros_like(vectors)]), self.scales
        )

    def search(self, turns: int = 1) -> Search:
        """Return the settings of the search for orbits whose period has ``turns`` common periods."""
        return Search(self.flow.period * turns, turns, MOST_ITERATIONS, SEARCH_TOLERANCE, self.smooth)


def point_row(points: Sequence[OperatingPoint], start: FloatArray) -> PointRow:
    """Collect operating points in a row; the magnitudes of y are computed from the guess ``start``.

    Raises InputError if the points do not all have the same kind of drive.
    """
    if any(point.flow is not points[0].flow for point in points):
        raise InputError(
            "the points of a row differ in the kind of drive (speed or torque), in modes or in ratios: these must be the same"
        )
    return PointRow(
        points[0],
        np.array([point.constants for point in points]),
        np.array([point.vector for point in points]),
        np.array([point.scale(start) for point in points]),
        collocation_serves([point.drive for point in points], [point.parameters for point in points]),
    )


def grid_rows(operation: Plane, xs: FloatArray, ys: FloatArray, start: FloatArray) -> list[PointRow]:
    """Return the rows of operating points of a grid; in a `NamedPlane` the data of a whole row are computed at once."""
    if isinstance(operation, NamedPlane):
        return [_named_row(operation, xs, y, start) for y in ys.tolist()]
    return [point_row([operating_point(*operation(x, y)) for x in xs.tolist()], start) for y in ys.tolist()]


def _named_row(operation: NamedPlane, xs: FloatArray, y: float, start: FloatArray) -> PointRow:
    """Return the row of a `NamedPlane` at one value ``y`` of the second parameter."""
    first = operating_point(*operation(float(xs[0]), y))
    flow, mechanism = first.flow, first.mechanism
    vectors = np.tile(first.vector, (len(xs), 1))
    sets: Sequence[Parameters] = [first.parameters]
    # checking the two ends is enough: if the drive rejects a value, or a friction is not zero, this happens at an end
    ends = [operating_point(*operation(x, y)) for x in (float(xs.min()), float(xs.max()))]
    factors = parameter_places(flow, first.drive, operation.x)
    if factors is None:
        sets = VariedSequence(first.parameters, {field_name(operation.x): xs}, replace)
        check_sets(mechanism, sets)
    else:
        for place, factor in factors.items():
            vectors[:, place] = factor * xs
    parameters, columns = varied_constants(mechanism, sets)
    states = flow.state(start, vectors.T)
    scale = array_functions(mechanism)[0].find(mechanism.error_scale)(parameters, states)
    constants, scales = np.empty((len(xs), len(columns))), np.empty((len(xs), flow.size))
    for n, column in enumerate(columns):
        constants[:, n] = column
    for n, place in enumerate(flow.places):
        scales[:, n] = scale[place]
    serves = collocation_serves([end.drive for end in ends], [end.parameters for end in ends])
    return PointRow(first, constants, vectors, scales, serves)
