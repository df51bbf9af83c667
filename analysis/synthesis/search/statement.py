"""State a synthesis as a nonlinear program in CasADi symbols; the module `program` evaluates and solves the program.

The equations of loop closure are converted to symbols by `analysis.numerics.symbolic`. Task and limits are in normal form
(`Normal`, `Limits`). Choices that depend on the start are parameters, so that one program serves all starts: the assembly, the
direction of crank rotation, the triangle of a pivot's region, and the shortest link.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from math import acos, cos, degrees, hypot, inf, isfinite, pi
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ...numerics import symbolic
from ..linkage.linkage import Linkage, gear_turns
from ..task.constraint import TURNING, UNKNOWNS, MinimisedFunction, Require, RotationRequirement
from ..task.limits import CrankUnknown, Limits, PivotUnknown, SliderUnknown
from ..task.task import Normal, turn

FloatArray = NDArray[np.float64]
Objective = Literal["squares", "worst", "transmission", "curve", "least", "least curve"]
#: Number of crank rotations at which assembly, speed and acceleration of a moving pivot are bounded.
GRID = 96
#: Margin of a Grashof type, relative to the sum of the links: at zero a four-bar is a change-point.
MARGIN = 1e-4
#: Number of parts into which a search divides the rotation between two stations, to bound the transmission angle at the ends of
#: each part; number of rotations over the whole task at which a linkage is judged, more than a search can afford.
PARTS, JUDGED = 4, 400
#: Least crank rotation between untimed stations, relative to equal steps.
ADVANCE = 1e-3
#: Least rotation over which an open path is traced (rad).
LEAST_WAY = 1e-3
#: Greatest crank rotation between untimed stations, relative to equal steps: a wider gap would leave the path uncontrolled.
GAP = 8.0
#: Objectives that replace an error.
SOUGHT = ("least", "least curve")
#: Name of the bound of the greatest error; fraction of this bound by which the absolute value is smoothed near zero error.
ERROR, SMOOTH = "bound of the greatest error", 1e-3
#: Number of further rotations at which a `RotationRequirement` is bounded: the rotations of its peaks in the previous solution.
FURTHER = 8


def convert_to_si(p: SimpleNamespace, unit: float, origin: complex) -> SimpleNamespace:
    """Convert dimensions from normal form to SI, the units of users' functions.

    ``unit`` is the size of the target and ``origin`` its centre (m); see `Normal`.
    """
    values = dict(vars(p))
    for name in UNKNOWNS[:7]:
        values[name] = unit * values[name]
    values["pivot_x"], values["pivot_y"] = values["pivot_x"] + origin.real, values["pivot_y"] + origin.imag
    return SimpleNamespace(**values)


def trace_requirement(require: Require, values: SimpleNamespace, *rotation: Any) -> Any:
    """Evaluate a required function with CasADi symbols.

    ``values`` has the dimensions; ``rotation`` are the crank rotations, given only for a `RotationRequirement`.

    Raises InputError if the function branches on its argument, or calls a function that does not take CasADi's symbols.
    """
    casadi = symbolic.library()
    try:
        with warnings.catch_warnings():
            # CasADi's symbols take NumPy's functions, and say so
            warnings.simplefilter("ignore", FutureWarning)
            value = casadi.SX(require.function(values, *rotation))
    except Exception as error:
        raise InputError(
            f"{require.name} cannot be traced ({type(error).__name__}: {error}): it must be arithmetic and functions of NumPy, "
            "without branches"
        ) from error
    if not rotation and (value.numel() != 1 or value.is_constant()):
        # a function that converts a symbol to a float loses the symbol, and its value is NaN
        raise InputError(
            f"{require.name} cannot be traced (its value is {value}): it must be one number from the dimensions"
        )
    return value


def pivot_size(pivot: PivotUnknown | None) -> int:
    """Return how many unknowns a moving pivot has."""
    return 0 if pivot is None else 2 + 2 * pivot.harmonics


def pivot_bounds(pivot: PivotUnknown | None, unit: float) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest values of the unknowns of a moving pivot; ``unit`` is the target's size (m)."""
    if pivot is None:
        return np.empty(0), np.empty(0)
    low, high = np.full(pivot_size(pivot), -inf), np.full(pivot_size(pivot), inf)
    if isinstance(pivot, SliderUnknown):
        low[0], high[0] = pivot.guide_angle
    else:
        low[0], high[0] = pivot.length[0] / unit, pivot.length[1] / unit
    return low, high


class Label(NamedTuple):
    """Name of a constraint, the unit in which its violation is written, and the factor that converts a violation to this unit.

    For the unit "transmission" the factor is instead the least transmission angle (rad).
    """

    name: str
    factor: float
    unit: str
    linkage: type[Linkage] = Linkage

    def format_violation(self, violation: float, q: FloatArray) -> str:
        """Format a violation with its unit.

        For a transmission angle the text says by how many degrees the angle falls below its limit. This depends on the
        unknowns q, the values of `UNKNOWNS`.
        """
        if self.unit == "transmission":
            least = self.factor
            cosine = cos(least) + violation / float(self.linkage.excess_slope(q[4], q[5], cos(least)))
            return f"{degrees(least - acos(min(1.0, cosine))):.3g} deg"
        return f"{self.factor * violation:.3g} {self.unit}".strip()


class Statement:
    """A synthesis stated as a nonlinear program: symbols for unknowns, objective and constraints.

    Parameters
    ----------
    normal : Normal
    limits : Limits
    pivot : PivotUnknown, optional
        Unknown motion of the pivot, with lengths in m like the task; None for a fixed pivot.
    objective : "squares", "worst", "transmission", "curve", "least" or "least curve"
        "squares": minimise the weighted squared errors. "worst": minimise the greatest weighted error, an unknown that bounds
        all errors. "transmission": meet the stations exactly and maximise the least transmission angle. "curve": only the
        constraints of a path, for `Refinement`, which compares curves without stations; the only unknown rotations are the
        ends of an open path and of its straight part. "least" and "least curve": minimise `Limits.least` instead of an
        error, with and without stations.
    exact : bool
        Whether bounds can be imposed at the extremes of the pivot's motion, see `Program.settle_extremes`; False makes a first
        search quicker.
    judged : bool
        Whether linkages are only judged. A search bounds the transmission angle at few rotations between two stations, with a
        margin that guarantees the bound between these rotations. A judgement bounds the angle at its extremes, without a
        margin; if the pivot moves, it bounds the angle at many rotations instead.
    """

    def __init__(
        self,
        normal: Normal,
        limits: Limits,
        pivot: PivotUnknown | None = None,
        objective: Objective = "squares",
        *,
        exact: bool = True,
        judged: bool = False,
    ) -> None:
        self.normal, self.limits, self.pivot, self.objective = normal, limits, pivot, objective
        self._judged, self._parts = judged, max(PARTS, -(-JUDGED // normal.n)) if judged else PARTS
        #: Turns of the crank, and of a second crank, per turn of the input shaft.
        self._turns = gear_turns(pivot.ratio) if isinstance(pivot, CrankUnknown) else (1, 0)
        casadi = self._casadi = symbolic.library()
        SX = casadi.SX
        self._unknowns: list[tuple[Any, FloatArray, FloatArray]] = []
        self._initial: list[Any] = []
        #: For each bounded motion of the pivot, or derivative of it: the order of the derivative, and parameters for the
        #: rotations of its extremes and for the curvature there; number of extremes; the first two derivatives at the extremes.
        self._peaks: list[tuple[int, Any, Any]] = []
        self._peak_count = 2 * pivot.harmonics if pivot is not None and exact else 0
        self._peak_derivatives: list[Any] = []
        #: Functions bounded along the crank's rotation, and parameters for the further rotations at which they are bounded.
        self._along_functions: list[tuple[RotationRequirement, Any]] = []
        self._constraints: list[tuple[Any, float, float, Label]] = []
        self.knots: list[int] = list(range(normal.n))
        self._solvers: dict[tuple[int, str], Any] = {}
        self._share = SX.sym("share")
        # parameters: branch, direction, magnitude of the errors, rows of Grashof's type, half-planes of the regions
        branch, direction, size = (SX.sym(name) for name in ("branch", "direction", "size"))
        grashof = SX.sym("grashof", 6, 4)
        planes = [SX.sym(f"plane{k}", 3, 3) for k in range(len(limits.regions))]
        # unknowns: dimensions, motion of the pivot, crank rotations
        q = self._unknown("q", limits.low, limits.high)
        v = self._unknown("v", *pivot_bounds(pivot, normal.unit))
        phi: Any = casadi.DM(normal.rotation) if normal.timed else None
        knots: Any = None
        self._by_curve = objective in ("curve", "least curve")
        if not normal.timed and not self._by_curve:
            phi = self._unknown("phi", np.full(normal.n, -inf), np.full(normal.n, inf))
            self._order_stations(phi, direction)
        elif not normal.timed:
            phi, knots = self._path_rotations(direction)
        p = SimpleNamespace(**{name: q[k] for k, name in enumerate(UNKNOWNS)}, branch=branch)
        self._phi = phi
        self._point: Callable[[Any], Any] = lambda at: self._close_loop(p, v, at, branch)[1]
        self._ends = (0.0, 2.0 * pi) if normal.closed or knots is None else (knots[0], knots[-1])
        quality = self._quality(p, v, phi, branch, size)
        tilt: Any = None
        if objective == "transmission":
            # the largest |cos mu| of all, which is minimised
            tilt = self._auxiliary("tilt", 0.0, 0.0, cos(TURNING))
            quality = tilt + 1e-3 * casadi.sumsqr(q[2:6])
        self._constrain_transmission(p, v, phi, tilt)
        self._constrain_shape(p, grashof, planes)
        for require in limits.requires:
            value = self._trace(require, p) / require.scale
            self._constrain(value, 0.0 if require.equal else -inf, 0.0, require.name, require.unit, require.scale)
        if isinstance(pivot, SliderUnknown):
            self._constrain_slider(pivot, p.ground_length, v)
        self._assemble(quality, [branch, direction, size, self._share], [grashof, *planes])

    def _assemble(self, quality: Any, numbers: Sequence[Any], tables: Sequence[Any]) -> None:
        """Assemble the program, its bounds and the names of its constraints."""
        casadi = self._casadi
        peaks = [symbol for _, *both in self._peaks for symbol in both]
        peaks += [casadi.vec(further) for _, further in self._along_functions]
        parameters = casadi.vertcat(*numbers, *peaks, *map(casadi.vec, tables))
        z, lows, highs = zip(*self._unknowns)
        self.low, self.high = np.concatenate(lows), np.concatenate(highs)
        rows = [row[1:] for row in self._constraints for _ in range(row[0].numel())]
        self.g_low, self.g_high = (np.array([row[end] for row in rows], dtype=float) for end in (0, 1))
        self.labels = [label for _, _, label in rows]
        g = casadi.vertcat(casadi.SX(0, 1), *(casadi.vec(e) for e, _, _, _ in self._constraints))
        self._nlp = {"x": casadi.vertcat(*z), "f": quality, "g": g, "p": parameters}

    def _unknown(self, name: str, low: FloatArray, high: FloatArray) -> Any:
        """Add a vector of unknowns with their bounds to the program, and return its symbols."""
        symbol = self._casadi.SX.sym(name, len(low))
        self._unknowns.append((symbol, low, high))
        return symbol

    def _auxiliary(self, name: str, initial: Any, low: float = -inf, high: float = inf) -> Any:
        """Add an auxiliary unknown, such as a greatest value or the middle of a range, and return its symbol.

        ``initial`` is the starting value, an expression of the other unknowns.
        """
        self._initial.append(initial)
        return self._unknown(name, np.array([low]), np.array([high]))

    @property
    def least(self) -> MinimisedFunction:
        """Return the function that is minimised instead of an error."""
        assert self.limits.least is not None
        return self.limits.least

    def _trace(self, require: Require, p: Any) -> Any:
        """Return the values of a required function, in CasADi symbols, for the dimensions p.

        A `RotationRequirement` is evaluated at its own rotations and at further rotations, which are parameters of the program.
        """
        casadi, values = self._casadi, convert_to_si(p, self.normal.unit, self.normal.origin)
        if not isinstance(require, RotationRequirement):
            return trace_requirement(require, values)
        held = trace_requirement(require, values, casadi.DM(require.rotation))
        if require.ends is None:
            return casadi.vec(held)
        places = casadi.SX.sym(f"places{len(self._along_functions)}", FURTHER)
        further = trace_requirement(require, values, places)
        bends = casadi.SX.sym(f"bends{len(self._along_functions)}", *further.shape)
        self._along_functions.append((require, casadi.horzcat(places, bends)))
        # height of the peak near each place to second order, which follows the peak as it moves
        ones = casadi.DM.ones(FURTHER)
        slope = casadi.horzcat(*(casadi.jtimes(column, places, ones) for column in casadi.horzsplit(further)))
        return casadi.vertcat(casadi.vec(held), casadi.vec(further + bends * slope**2))

    # Objective

    def _close_loop(self, p: Any, v: Any, phi: Any, branch: Any) -> tuple[Any, Any]:
        """Return the directions of the links and the coupler point (x, y) at crank rotations ``phi``, by loop closure.

        ``p`` has the dimensions, ``v`` the unknowns of a moving pivot.
        """
        casadi = self._casadi
        th2 = self._turns[0] * phi + p.crank_phase
        c2, s2 = casadi.cos(th2), casadi.sin(th2)
        dx, dy = self._displacement(v, phi)
        bx, by = p.ground_length + dx - p.crank_length * c2, dy - p.crank_length * s2
        g = self.limits.linkage.closure()(c2, s2, bx, by, p.coupler_length, p.rocker_length, branch)
        ca, sa = casadi.cos(p.ground_angle), casadi.sin(p.ground_angle)
        px = p.point_distance * casadi.cos(p.ground_angle + p.point_angle)
        py = p.point_distance * casadi.sin(p.ground_angle + p.point_angle)
        x = p.pivot_x + p.crank_length * (ca * c2 - sa * s2) + px * g.c3 - py * g.s3
        y = p.pivot_y + p.crank_length * (sa * c2 + ca * s2) + py * g.c3 + px * g.s3
        return g, (x, y)

    def _displacement(self, v: Any, phi: Any) -> tuple[Any, Any]:
        casadi = self._casadi
        if self.pivot is None:
            return 0.0, 0.0
        if isinstance(self.pivot, SliderUnknown):
            u = _series(casadi, v[1:], phi)
            return u * casadi.cos(v[0]), u * casadi.sin(v[0])
        psi = self._turns[1] * phi + v[1] + _series(casadi, v[2:], phi, mean=False)
        return v[0] * casadi.cos(psi), v[0] * casadi.sin(psi)

    def _quality(self, p: Any, v: Any, phi: Any, branch: Any, size: Any) -> Any:
        """Return the objective, and add the constraints that belong to it.

        ``p`` has the dimensions, ``v`` the unknowns of a moving pivot, ``phi`` the crank rotations of the stations; ``size`` is
        the magnitude of the greatest error or value.
        """
        casadi, normal = self._casadi, self.normal
        g, point = self._close_loop(p, v, phi, branch)
        ex: Any = None
        ey: Any = None
        if normal.points is not None:
            ex, ey = point[0] - casadi.DM(normal.points.real), point[1] - casadi.DM(normal.points.imag)
        turned: Any = None
        if normal.angle is not None:
            c, s = (g.c4, g.s4) if normal.of_rocker else (g.c3, g.s3)
            wanted = casadi.DM(normal.angle) - p.output_angle - (0.0 if normal.of_rocker else p.ground_angle)
            ct, st = casadi.cos(wanted), casadi.sin(wanted)
            # the difference of the angles, without a jump at half a turn
            turned = casadi.atan2(s * ct - c * st, c * ct + s * st)
        quality: Any = 0.0
        if self.objective == "transmission":
            for value, unit in ((ex, "mm"), (ey, "mm"), (turned, "deg")):
                if value is not None:
                    self._constrain(value, 0.0, 0.0, "the stations", unit)
            return quality
        if not self._by_curve:
            squares: Any = 0.0 if ex is None else ex**2 + ey**2
            if turned is not None:
                squares = squares + (normal.leverage * turned) ** 2
            squares = casadi.DM(normal.weights) * squares
            quality = casadi.sum1(squares)
        if self.objective == "worst":
            greatest = self._auxiliary("greatest", casadi.sqrt(casadi.mmax(squares)) / size, 0.0)
            self._constrain_nonpositive(squares / size**2 - greatest**2, "greatest error", "")
            return greatest
        if self.objective in SOUGHT:
            if not self._by_curve:
                most = self.least.error
                smooth = casadi.sqrt(squares + (SMOOTH * most) ** 2) - most * hypot(1.0, SMOOTH)
                unit = "deg" if normal.of_rocker else "mm"
                self._constrain_nonpositive(smooth / most, ERROR, unit, self._display_factor(most))
            values = self._trace(self.least.along, p)
            greatest = self._auxiliary("greatest", casadi.mmax(values) / size, 0.0)
            self._constrain_nonpositive(values / size - greatest, self.least.along.name, "")
            if self._by_curve:
                self._constrain_straight_part(p, v, phi, branch, ex, ey)
            return greatest
        self._constrain_straight_part(p, v, phi, branch, ex, ey)
        return quality

    def _constrain_straight_part(self, p: Any, v: Any, phi: Any, branch: Any, ex: Any, ey: Any) -> None:
        """Constrain the straight part of a path, if there is one; ``ex`` and ``ey`` are the errors at the stations."""
        casadi, straight, points = self._casadi, self.normal.straight, self.normal.points
        if straight is None or points is None:
            return
        line = points[straight.end] - points[straight.start]
        line /= abs(line)
        spent = phi[straight.end] - phi[straight.start]
        self._constrain(spent, -straight.rotation, straight.rotation, "crank rotation of the straight part", "deg")
        if self._by_curve:
            # the ends may be off the target's only across the line
            for k in (straight.start, straight.end):
                self._constrain(ex[k] * line.real + ey[k] * line.imag, 0.0, 0.0, "ends of the straight part")
        if straight.flatness is None:
            return
        # along the straight line through the part's ends, at the stations and in between
        part = slice(straight.start, straight.end + 1)
        x, y = self._close_loop(p, v, self._dense_rotations(phi[part])[0], branch)[1]
        begin = points[straight.start]
        away = (y - begin.imag) * line.real - (x - begin.real) * line.imag
        level = self._auxiliary("level", 0.5 * (casadi.mmin(away) + casadi.mmax(away)))
        half = 0.5 * straight.flatness
        self._constrain(away - level, -half, half, "flatness of the straight part")

    # Constraints

    def _display_factor(self, share: float) -> float:
        """Return the factor that converts an error in multiples of ``share`` units to mm, for a rocker function to degrees."""
        return share * (degrees(1.0) if self.normal.of_rocker else 1e3 * self.normal.unit)

    def excess(self, violation: float) -> dict[str, Any]:
        """Return the fields of an `Answer` whose greatest error exceeds its bound by ``violation`` (units)."""
        label = Label(ERROR, self._display_factor(1.0), "deg" if self.normal.of_rocker else "mm")
        return {"violation": violation, "worst": ERROR, "excess": label.format_violation(violation, np.empty(0))}

    def _constrain(
        self, value: Any, low: float, high: float, name: str, unit: str = "mm", factor: float | None = None
    ) -> None:
        """Add the constraint that a value lies between two bounds.

        ``factor`` converts a violation to ``unit``. By default a length is in multiples of the target's size (unit mm), an
        angle in rad (unit deg), and any other value already in ``unit``.
        """
        usual = {"mm": 1e3 * self.normal.unit, "deg": degrees(1.0)}
        label = Label(name, usual.get(unit, 1.0) if factor is None else factor, unit, self.limits.linkage)
        self._constraints.append((value, low, high, label))

    def _constrain_nonpositive(self, value: Any, name: str, unit: str = "mm", factor: float | None = None) -> None:
        self._constrain(value, -inf, 0.0, name, unit, factor)

    def _order_stations(self, phi: Any, direction: Any) -> None:
        """Constrain the crank rotations of the stations to be in order, in ``direction`` (+1 or -1), and within a turn."""
        n = self.normal.n
        least = ADVANCE * 2.0 * pi / n
        steps = direction * (phi[1:] - phi[:-1])
        most = GAP * 2.0 * pi / n
        self._constrain(steps, least, most, "order of the stations", "deg")
        total = direction * (phi[n - 1] - phi[0])
        closing = (2.0 * pi - most, 2.0 * pi - least) if self.normal.closed else (-inf, 2.0 * pi)
        self._constrain(total, *closing, "stations within a turn", "deg")

    def _path_rotations(self, direction: Any) -> tuple[Any, Any]:
        """Return the crank rotations of a path's stations, and the unknown rotations between which they are evenly spaced.

        Unknown are the rotations at the ends of an open path and of its straight part; None if there are no such ends.
        """
        casadi, normal = self._casadi, self.normal
        ends = set() if normal.closed else {0, normal.n - 1}
        part = () if normal.straight is None else (normal.straight.start, normal.straight.end)
        fixed = self.knots = sorted(ends.union(part))
        if not fixed:
            return casadi.DM(turn(normal.n)), None
        knots = self._unknown("knots", np.full(len(fixed), -inf), np.full(len(fixed), inf))
        steps = direction * (knots[1:] - knots[:-1])
        self._constrain(steps, LEAST_WAY, 2.0 * pi, "order of the stations", "deg")
        most = 2.0 * pi - (LEAST_WAY if normal.closed else 0.0)
        self._constrain(direction * (knots[-1] - knots[0]), LEAST_WAY, most, "stations within a turn", "deg")
        # hat functions interpolate between the knots; in a closed path the first knot follows the last, a turn later
        at = [*fixed, fixed[0] + normal.n] if normal.closed else fixed
        where = np.arange(fixed[0], fixed[0] + normal.n)
        hats = np.array([np.interp(where, at, row) for row in np.eye(len(at))])
        hats = np.roll(hats, fixed[0], axis=1)
        lap = np.roll(where // normal.n, fixed[0])
        phi = casadi.mtimes(casadi.DM(hats[: len(fixed)].T), knots)
        if normal.closed:
            again = casadi.DM(hats[-1])
            phi = phi + again * (knots[0] + 2.0 * pi * direction) - 2.0 * pi * direction * casadi.DM(lap)
        return phi, knots

    def _constrain_shape(self, p: Any, grashof: Any, planes: Sequence[Any]) -> None:
        """Constrain the links to the Grashof type, and the fixed pivots to their regions.

        ``grashof`` has the coefficients of `program._grashof_rows`, ``planes`` the rows of `half_planes` for each region.
        """
        casadi, limits = self._casadi, self.limits
        if limits.grashof:
            links = casadi.vertcat(p.ground_length, p.crank_length, p.coupler_length, p.rocker_length)
            margin = MARGIN * casadi.sum1(links) * casadi.sum2(casadi.fabs(grashof)) / 4.0
            self._constrain_nonpositive(casadi.mtimes(grashof, links) + margin, f"Grashof type {limits.grashof}")
        for (name, _), plane in zip(limits.regions, planes):
            x, y = p.pivot_x, p.pivot_y
            if name == "D":
                x = x + p.ground_length * casadi.cos(p.ground_angle)
                y = y + p.ground_length * casadi.sin(p.ground_angle)
            self._constrain_nonpositive(casadi.mtimes(plane, casadi.vertcat(x, y, 1.0)), f"region of pivot {name}")

    def _constrain_transmission(self, p: Any, v: Any, phi: Any, tilt: Any) -> None:
        """Constrain the transmission angle over a turn, over the task, or both; see `_bound_transmission` for ``tilt``."""
        casadi, limits = self._casadi, self.limits
        l1, l2 = p.ground_length, p.crank_length
        if limits.turn is not None and self.pivot is None:
            # with a fixed pivot its extremes are where the crank lies along the ground link
            self._bound_transmission(p, (l1 - l2) ** 2, (l1 + l2) ** 2, limits.turn, tilt)
        elif limits.turn is not None:
            # closer rotations for gears whose cranks turn several times
            turned = max(map(abs, self._turns))
            count = JUDGED * turned if self._judged else GRID * max(1, turned // 2)
            self._bound_reach(p, v, casadi.DM(turn(count)), 2.0 * pi / count, limits.turn, tilt)
        if limits.way is not None or (tilt is not None and limits.turn is None):
            x, step = self._dense_rotations(phi)
            least = limits.way or 0.0
            if not self._judged:
                # the step before a station may be longer than that after it
                n = self.normal.n
                step[1:n] = casadi.fmax(casadi.fabs(step[: n - 1]), casadi.fabs(step[1:n]))
            if self.pivot is not None:
                self._bound_reach(p, v, x, step, least, tilt)
                return
            slack = limits.linkage.slack(l1, l2, casadi.cos(0.5 * step))
            if self._judged:
                # in each step also the rotation nearest to the crank along the ground link; none beyond the end
                step[self.normal.n - 1] = 0.0
                turned = casadi.sign(step) * (x + p.crank_phase) / pi
                nearest = casadi.fmin(pi * (casadi.floor(turned) + 1.0 - turned), casadi.fabs(step))
                x, slack = casadi.vertcat(x, x + casadi.sign(step) * nearest), 0.0
            d2 = self._squared_reach(p, v, x)
            # an extreme between two of these rotations differs from the values there by no more than the slack
            self._bound_transmission(p, d2 - slack, d2 + slack, least, tilt)

    def _bound_reach(self, p: Any, v: Any, x: Any, step: Any, least: float, tilt: Any) -> None:
        """Bound the transmission angle of a linkage with a moving pivot at rotations x, which are ``step`` apart.

        Unless linkages are only judged, the angle is bounded between these rotations, too: at each rotation the tangent of the
        squared distance BD is drawn half a step to either side, and its ends are bounded. An extreme between two rotations does
        not lie beyond the tangents.
        """
        if self._judged:
            d2 = self._squared_reach(p, v, x)
            self._bound_transmission(p, d2, d2, least, tilt)
            return
        casadi = self._casadi
        at = casadi.SX.sym("at", x.numel())
        d2 = self._squared_reach(p, v, at)
        ahead = 0.5 * step * casadi.jtimes(d2, at, casadi.DM.ones(x.numel()))
        (ends,) = casadi.substitute([casadi.vertcat(d2 - ahead, d2 + ahead)], [at], [casadi.SX(x)])
        self._bound_transmission(p, ends, ends, least, tilt)

    def _bound_transmission(self, p: Any, nearest: Any, farthest: Any, least: float, tilt: Any) -> None:
        """Constrain |cos mu| to at most cos(least) and at most ``tilt``, if given, where mu is the transmission angle.

        ``nearest`` and ``farthest`` are the squares of the least and the greatest distance BD. ``tilt`` is the unknown greatest
        |cos mu| that is minimised.
        """
        least = least if self._judged else max(least, TURNING)
        for cosine in (cos(least), *([] if tilt is None else [tilt])):
            links = p.coupler_length, p.rocker_length
            angle = acos(cosine) if isinstance(cosine, float) else 0.0
            for excess in self.limits.linkage.transmission_excess(*links, nearest, farthest, cosine):
                self._constrain_nonpositive(excess, "transmission angle", "transmission", angle)

    def _squared_reach(self, p: Any, v: Any, x: Any) -> Any:
        """Return the square of the distance from crank pin to rocker pivot, or to the guide, at crank rotations x."""
        casadi = self._casadi
        dx, dy = self._displacement(v, x)
        th2 = self._turns[0] * x + p.crank_phase
        bx = p.ground_length + dx - p.crank_length * casadi.cos(th2)
        by = dy - p.crank_length * casadi.sin(th2)
        return self.limits.linkage.square(bx, by)

    def _dense_rotations(self, phi: Any) -> tuple[Any, Any]:
        """Return the stations' crank rotations, followed by rotations between them, and the step after each rotation."""
        steps = (phi[1:] - phi[:-1]) / self._parts
        between = [phi[:-1] + k * steps for k in range(1, self._parts)]
        casadi = self._casadi
        return casadi.vertcat(phi, *between), casadi.vertcat(steps, steps[-1], *[steps] * len(between))

    def _constrain_slider(self, pivot: SliderUnknown, ground: Any, v: Any) -> None:
        """Add the constraints on the slider's motion; ``ground`` is the ground link, ``v`` has the unknowns of the motion."""
        casadi, unit = self._casadi, self.normal.unit

        def position(x: Any) -> Any:
            return _series(casadi, v[1:], x)

        if pivot.position is None:
            u = position(casadi.DM(turn(max(GRID, 16 * pivot.harmonics))))
            self._constrain_nonpositive(u - ground, "slider position")
            self._constrain_nonpositive(-u - ground, "slider position")
        else:
            low, high = (end / unit for end in pivot.position)
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            factor = 1e3 * unit * half
            self._bound_motion(lambda x: (position(x) - middle) / half, 0, "slider position", "mm", factor, half)
        if isfinite(pivot.stroke):
            centre = self._auxiliary("middle", 0.0)
            reach = 0.5 * pivot.stroke / unit
            # the bound is violated at both ends: the stroke is too long by twice as much
            self._bound_motion(lambda x: (position(x) - centre) / reach, 0, "stroke", "mm", 1e3 * pivot.stroke, reach)
            u = position(casadi.vertcat(casadi.DM(turn(max(GRID, 16 * pivot.harmonics))), self._peaks[-1][1]))
            self._initial[-1] = 0.5 * (casadi.mmin(u) + casadi.mmax(u))
        self._bound_derivative(v, 1, pivot.speed, "slider speed", "mm/rad")
        self._bound_derivative(v, 2, pivot.acceleration, "slider acceleration", "mm/rad2")

    def _bound_derivative(self, v: Any, order: int, bound: float, name: str, unit: str) -> None:
        """Bound the magnitude of the slider's speed (order 1, m/rad) or acceleration (order 2, m/rad2) by ``bound``."""
        if isfinite(bound):
            scale = self.normal.unit / bound

            def derivative(x: Any) -> Any:
                return scale * _series(self._casadi, v[1:], x, order=order)

            self._bound_motion(derivative, order, name, unit, 1e3 * bound, 1.0 / scale)

    def _bound_motion(
        self, value: Callable[[Any], Any], order: int, name: str, unit: str = "", factor: float = 1.0, size: float = 1.0
    ) -> None:
        """Constrain ``value``, a trigonometric polynomial of the crank rotation, to [-1, 1].

        The polynomial is the pivot's motion or its derivative of this order; IPOPT receives it multiplied by ``size``. It is
        bounded at grid points over the turn and at rotations given by parameters, with a margin. In a first solution the
        margin guarantees the bound between the grid points: there a trigonometric polynomial is at most its greatest value at
        the points divided by a cosine (Ehlich and Zeller 1964). Later solutions use almost no margin, since the parameters
        are the rotations at which the previous solution is extreme (`Program.settle_extremes`).
        """
        casadi, harmonics = self._casadi, self.pivot.harmonics if self.pivot else 0
        number = len(self._peaks)
        places, bends = (casadi.SX.sym(f"{what}{number}", self._peak_count) for what in ("places", "bends"))
        self._peaks.append((order, places, bends))
        grid = value(casadi.DM(turn(max(GRID, 16 * harmonics))))
        if not self._peak_count:
            self._constrain(size * grid / self._share, -size, size, name, unit, factor / size)
            return
        held, ones = value(places), casadi.DM.ones(self._peak_count)
        slope = casadi.jtimes(held, places, ones)
        self._peak_derivatives.append(casadi.horzcat(slope, casadi.jtimes(slope, places, ones)))
        # height of the peak near each place to second order, which follows the peak as it moves
        every = casadi.vertcat(grid, held + bends * slope**2)
        self._constrain(size * every / self._share, -size, size, name, unit, factor / size)


def _series(casadi: Any, coefficients: Any, x: Any, *, mean: bool = True, order: int = 0) -> Any:
    """Evaluate a Fourier series, or its derivative of the given order, at rotations x.

    The coefficients are the mean (unless ``mean`` is False), then the cosine and sine coefficient of each harmonic.
    """
    value = (coefficients[0] if order == 0 else 0.0) + 0.0 * x if mean else 0.0 * x
    first = 1 if mean else 0
    for k in range((coefficients.numel() - first) // 2):
        harmonic = k + 1
        a, b = coefficients[first + 2 * k], coefficients[first + 2 * k + 1]
        for _ in range(order):
            a, b = harmonic * b, -harmonic * a
        value = value + a * casadi.cos(harmonic * x) + b * casadi.sin(harmonic * x)
    return value
