"""Find the slider position of least error at every crank angle in closed form, by the variational method of the thesis.

The links are given, and the crank is at phi. In the frame of the guide, with its zero at the end E of the ground link, let
b = (B - E) exp(-i alpha), s = th3 - alpha, t = th4 - alpha. Loop closure is then (Youssef, section 7.3)

    l4 sin t = l3 sin s + Im b,        u = Re b + l3 cos s - l4 cos t,

and one degree of freedom is left, the slider position u. A change of u turns the links by

    ds/du = cos t / (l3 sin(t - s)),   dt/du = cos s / (l4 sin(t - s)).

For a path, P turns with the coupler about B, and the squared distance |P - p*|^2 from the target point p* grows with the angle
between BP and the direction from B to p*. For a function the rocker has to be at the target angle th4*. The target link is
therefore the coupler for a path, the rocker for a function; the target angle of the coupler is the angle at which BP points at
p*. The error as a function of u has its minima where

    the target link is at its target angle, with the other link on either side of the perpendicular to the guide;
    the other link is perpendicular to the guide, in either direction, with the target link on either side of the
    perpendicular: cos t = 0 for a path, cos s = 0 for a function;
    u is at an end of its range: a limit of assembly (sin(t - s) = 0, BD = l3 + l4 or |l3 - l4|) or an end of the stroke.

The first two kinds of minima are the thesis's (7.6)-(7.15). The third kind is not in the thesis: without it the optimum may lie
in the other assembly, past a dead centre. A linkage that stays in its assembly must stop at the dead centre, or earlier if a
least transmission angle is required.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, isfinite, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, ParameterError

from ..numerics.fourier import FourierSeries
from ..synthesis import Linkage, SecondCrank
from ..units import Amount, in_si

FloatArray = NDArray[np.float64]

#: Reasons why a slider position is a minimum of the error, see `VariationalMotion.kind`.
KINDS = ("target", "perpendicular", "limit", "stroke")
#: Rounding errors of sines and their products.
ROUNDING = 1e-12
#: A continuous path of minima across a step is searched by bisection: greatest number of bisections, and the gap of u, relative
#: to l3 + l4, below which the path is found. Near the perpendicular u changes as a square root: 44 bisections reduce the gap to
#: 2.4e-7.
HALVINGS = 44
GAP = 1e-5
#: Costs of the squared travel, relative to l3 + l4, which decides between equal errors, and of a jump, which exceeds the sum
#: of all squared errors: these are scaled so that their sum is at most 1.
TRAVEL = 1e-12
JUMP = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VariationalMotion:
    """Slider positions of least error, one for each crank rotation.

    Attributes
    ----------
    rotation : ndarray, shape (n,)
        Crank rotation phi (rad).
    u : ndarray, shape (n,)
        Slider position (m).
    coupler_angle, rocker_angle : ndarray, shape (n,)
        th3 and th4 from the ground link (rad), in (-pi, pi].
    branch : ndarray of int, shape (n,)
        Assembly, the sign of sin(th4 - th3).
    kind : ndarray of str, shape (n,)
        Why the error is least: "target" (the target link is at its target angle), "perpendicular" (the other link is
        perpendicular to the guide), "limit" (limit of assembly or least transmission angle), "stroke" (end of the stroke).
    error : ndarray, shape (n,)
        Distance from the target point (m), or from the target angle (rad).
    weights : ndarray, shape (n,)
        Weights of the squared errors.
    jumps : ndarray of int
        Each k for which the slider has to jump between rotations k and k + 1, because no continuous path of minima of one
        assembly connects the two positions.
    guide_angle : float
        Angle alpha from the ground link (rad).
    """

    rotation: FloatArray
    u: FloatArray
    coupler_angle: FloatArray
    rocker_angle: FloatArray
    branch: NDArray[np.int64]
    kind: NDArray[np.str_]
    error: FloatArray
    weights: FloatArray
    jumps: NDArray[np.int64]
    guide_angle: float

    @property
    def squared_error(self) -> float:
        """Return the sum of the weighted squared errors (m2 or rad2)."""
        return float(self.weights @ self.error**2)

    @property
    def stroke(self) -> float:
        """Return the distance between the ends of the slider's travel (m)."""
        return float(np.ptp(self.u))

    def to_series(self, order: int) -> FourierSeries:
        """Fit a Fourier series in the crank rotation to u by weighted least squares, as a start for a direct search.

        Raises
        ------
        InputError
            If there are too few rotations for the order.
        """
        if order < 0 or 2 * order + 1 > len(self.u):
            raise InputError(
                f"order {order} from {len(self.u)} rotations: it must be from 0 to {(len(self.u) - 1) // 2}"
            )
        phase = np.multiply.outer(self.rotation, np.arange(order + 1))
        root = np.sqrt(self.weights)[:, None]
        columns = root * np.column_stack([np.cos(phase), np.sin(phase[:, 1:])])
        c = np.linalg.lstsq(columns, root[:, 0] * self.u)[0]
        return FourierSeries(c[: order + 1], np.append(0.0, c[order + 1 :]))


class _Minima(NamedTuple):
    """Candidates for minima of the error: slider position (m), angles of coupler and rocker (rad), error, and validity.

    Each field has the shape (m, n): a row for each kind of minimum and assembly, a column for each crank rotation. The field
    ``valid`` says whether the candidate is a minimum.
    """

    u: FloatArray
    coupler: FloatArray
    rocker: FloatArray
    error: FloatArray
    valid: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """Linkage, guide and bounds of the search for minima; a target is a complex number (point) or a real number (angle)."""

    linkage: Linkage
    guide_angle: float
    stroke: tuple[float, float]
    least_transmission: float
    assemblies: tuple[int, ...]

    def __post_init__(self) -> None:
        if isinstance(self.linkage.pivot, SecondCrank):
            raise ParameterError("pivot", self.linkage.pivot, "be fixed or a slider")
        if not isfinite(self.guide_angle):
            raise ParameterError("guide_angle", self.guide_angle, "be a finite number of rad")
        if not self.stroke[0] <= self.stroke[1]:
            raise ParameterError("stroke", self.stroke, "be a least and a greatest slider position in m")
        if not 0.0 <= self.least_transmission < 0.5 * pi:
            raise ParameterError("least_transmission", self.least_transmission, "be from 0 to less than pi/2 rad")
        if not self.assemblies or not set(self.assemblies) <= {1, -1}:
            raise ParameterError("assemblies", self.assemblies, "be of +1 and -1")

    @property
    def labels(self) -> tuple[NDArray[np.str_], NDArray[np.int64]]:
        """Return the kind and the assembly of each row of `minima`, two arrays of shape (m,)."""
        kinds = ["target"] * 2 + ["perpendicular"] * 4
        kinds += ["limit"] * 2 * len(self._limits()) + ["stroke"] * sum(map(isfinite, self.stroke))
        return np.array(kinds * len(self.assemblies)), np.repeat(self.assemblies, len(kinds))

    def _limits(self) -> list[tuple[float, float, float]]:
        """Return the limits of the distance BD, each as (angle at C (rad), BD (m), 1 for an upper or -1 for a lower limit)."""
        l3, l4 = self.linkage.coupler_length, self.linkage.rocker_length
        low = self.least_transmission
        least = sqrt((l3 - l4) ** 2 + 4.0 * l3 * l4 * sin(0.5 * low) ** 2)
        most = sqrt((l3 + l4) ** 2 - 4.0 * l3 * l4 * sin(0.5 * low) ** 2)
        # with B on D the directions of coupler and rocker are undetermined: perpendicular ones are candidates
        return [(pi - low, most, 1.0)] + ([(low, least, -1.0)] if least > 0.0 else [])

    def pin(self, rotation: FloatArray) -> NDArray[np.complex128]:
        """Return b, the position of the crank pin B relative to the guide's zero, in the frame of the guide."""
        k = self.linkage
        from_e = k.crank_length * np.exp(1j * (rotation + k.crank_phase)) - k.ground_length
        return from_e * np.exp(-1j * self.guide_angle)

    def minima(self, rotation: FloatArray, target: NDArray[np.complex128] | FloatArray) -> _Minima:
        """Return the candidates for minima of the error over the slider position, with targets of shape (n,)."""
        k = self.linkage
        l3, l4 = k.coupler_length, k.rocker_length
        path = np.iscomplexobj(target)
        b = self.pin(rotation)
        low, high = self.stroke
        if path:
            a = complex(k.pivot_x, k.pivot_y)
            turn = np.exp(1j * (k.ground_angle + self.guide_angle))
            aim = (target - a) / turn - b - k.ground_length * np.exp(-1j * self.guide_angle)
            arm = k.point_distance * np.exp(1j * k.point_angle)
            wanted = np.angle(aim) - k.point_angle
            own, other, offset = l3, l4, b.imag
        else:
            wanted = target.real - k.output_angle - self.guide_angle
            own, other, offset = l4, l3, -b.imag

        # x, y: angles of the target link and of the other link, from the guide, at which the error is stationary
        sine = (own * np.sin(wanted) + offset) / other
        side = np.arcsin(np.clip(sine, -1.0, 1.0))
        x, y = [wanted, wanted], [side, pi - side]
        minimal = [np.abs(sine) <= 1.0] * 2
        for way in (1.0, -1.0):
            sine = (way * other - offset) / own
            side = np.arcsin(np.clip(sine, -1.0, 1.0))
            for angle in (side, pi - side):
                x.append(angle)
                y.append(np.full_like(angle, way * 0.5 * pi))
                # a minimum if only turning the target link further, which the other link prevents, would reduce the error
                turning_on = way * np.cos(angle) * np.sin(angle - wanted)
                minimal.append((np.abs(sine) <= 1.0) & (turning_on <= ROUNDING))
        coupler, rocker = np.array((x, y) if path else (y, x))
        u = b.real + l3 * np.cos(coupler) - l4 * np.cos(rocker)
        inside = np.array(minimal) & (low <= u) & (u <= high)

        end, at_c, inward, there = self._ends(b)
        to_d = np.angle(end - b)
        at_b = np.arctan2(l4 * np.sin(at_c), l3 - l4 * np.cos(at_c))
        at_d = np.arctan2(l3 * np.sin(at_c), l4 - l3 * np.cos(at_c))

        rows = []
        least = sin(self.least_transmission) - ROUNDING
        for branch in self.assemblies:
            rows.append((u, coupler, rocker, inside & (branch * np.sin(rocker - coupler) >= least)))
            ends = to_d + branch * at_b, to_d + pi - branch * at_d
            own_end, other_end = ends if path else ends[::-1]
            slope = branch * inward * np.sin(own_end - wanted) * np.cos(other_end)
            rows.append((end, *ends, there & (slope >= -ROUNDING)))
        u, coupler, rocker, valid = (np.concatenate(parts) for parts in zip(*rows))
        error = np.abs(arm * np.exp(1j * coupler) - aim) if path else np.abs(_wrap_angles(rocker - wanted))
        return _Minima(u, coupler + self.guide_angle, rocker + self.guide_angle, error, valid)

    def _ends(self, b: NDArray[np.complex128]) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
        """Return the ends of the range of u for crank pins b: four arrays with a row for each end, a column for each crank pin.

        The arrays are position (m), angle at C (rad), direction into the range (1 or -1), and whether the end exists.
        """
        l3, l4 = self.linkage.coupler_length, self.linkage.rocker_length
        low, high = self.stroke
        ends = []
        for angle, distance, far in self._limits():
            half = np.sqrt(np.maximum(distance**2 - b.imag**2, 0.0))
            for way in (1.0, -1.0):
                u = b.real + way * half
                there = (np.abs(b.imag) <= distance) & (low <= u) & (u <= high)
                ends.append((u, np.full_like(u, angle), np.full_like(u, -far * way), there))
        for stop, inward in ((low, 1.0), (high, -1.0)):
            if isfinite(stop):
                cosine = (l3 * l3 + l4 * l4 - np.abs(stop - b) ** 2) / (2.0 * l3 * l4)
                at_c = np.arccos(np.clip(cosine, -1.0, 1.0))
                there = np.abs(cosine) <= cos(self.least_transmission)
                ends.append((np.full_like(at_c, stop), at_c, np.full_like(at_c, inward), there))
        position, at_c, direction, there = (np.array(parts) for parts in zip(*ends))
        return position, at_c, direction, there


@in_si(guide_angle="rad", stroke="m", least_transmission="rad")
def variational_motion(
    linkage: Linkage,
    rotation: ArrayLike,
    target: ArrayLike,
    *,
    guide_angle: Amount = 0.0,
    stroke: tuple[Amount, Amount] = (-inf, inf),
    least_transmission: Amount = 0.0,
    assemblies: tuple[int, ...] | None = None,
    weights: ArrayLike | None = None,
    continuous: bool = False,
    closed: bool = True,
) -> VariationalMotion:
    """Find the slider position of least error at each crank rotation, or the best continuous motion through minima.

    Parameters
    ----------
    linkage : Linkage
        Linkage whose ``pivot`` is replaced: the guide starts at the end of the ground link.
    rotation : array_like, shape (n,)
        Crank rotation phi (rad), increasing.
    target : array_like, shape (n, 2) or (n,)
        Wanted position of the coupler point (m), or wanted angle of the rocker from the ground link (rad), with the linkage's
        ``output_angle`` as mounting angle; whole turns of a target angle do not matter.
    guide_angle : float
        Direction alpha of the guide from the ground link (rad).
    stroke : (float, float)
        Least and greatest slider position (m).
    least_transmission : float
        Least distance of the angle at C between coupler and rocker from 0 and from pi (rad). With zero the optimum may be at
        the limit of assembly, where the plant cannot follow.
    assemblies : tuple of int, optional
        Assemblies to choose from, +1 and -1; the linkage's own by default.
    weights : array_like, shape (n,), optional
        Weights of the squared errors; 1 by default. They affect the slider positions only if ``continuous`` is True.
    continuous : bool
        False: choose the least error at each rotation and, among equal errors, the fewest jumps, then the least travel. True:
        choose the motion with the fewest jumps (none, if possible) and, among these motions, the least sum of squared errors.
    closed : bool
        Whether the motion is periodic: one turn later, the first rotation follows the last.

    Raises
    ------
    InputError
        If rotations, targets or weights have wrong shapes or are not finite, if the rotations do not increase or, with
        ``closed``, span more than a turn, or if a weight is negative.
    ParameterError
        If guide angle, stroke, least transmission angle or assemblies are invalid, or the coupler point of a path is on the
        crank pin, where the slider does not move it.
    AssemblyError
        If there is a rotation at which the links cannot be joined at any slider position that the bounds allow.
    """
    phi = np.array(rotation, dtype=float)
    aim = np.array(target, dtype=float)
    if phi.ndim != 1 or len(phi) == 0 or not np.isfinite(phi).all() or np.any(np.diff(phi) <= 0.0):
        raise InputError(f"rotations of shape {phi.shape}: they must be (n,), finite and increasing")
    n = len(phi)
    if closed and phi[-1] - phi[0] > 2.0 * pi * (1.0 + ROUNDING):
        raise InputError(
            f"rotations from {phi[0]:.6g} to {phi[-1]:.6g} rad: a closed motion must not be more than a turn"
        )
    if aim.shape not in ((n, 2), (n,)) or not np.isfinite(aim).all():
        raise InputError(f"targets of shape {aim.shape} at {n} rotations: they must be ({n}, 2) or ({n},), and finite")
    w = np.ones(n) if weights is None else np.array(weights, dtype=float)
    if w.shape != (n,) or not np.isfinite(w).all() or w.min() < 0.0:
        raise InputError(f"weights of shape {w.shape} at {n} rotations: they must be ({n},), finite and not negative")
    if aim.ndim == 2 and linkage.point_distance == 0.0:
        raise ParameterError("point_distance", 0.0, "not be zero: the slider does not move the crank pin")
    problem = _Problem(
        linkage=linkage,
        guide_angle=float(guide_angle),
        stroke=stroke,
        least_transmission=float(least_transmission),
        assemblies=(linkage.branch,) if assemblies is None else assemblies,
    )
    goal = aim[:, 0] + 1j * aim[:, 1] if aim.ndim == 2 else aim
    minima = problem.minima(phi, goal)
    joined = minima.valid.any(axis=0)
    if not joined.all():
        raise AssemblyError(_describe_unreachable(problem, phi[~joined], n))

    error = np.where(minima.valid, minima.error, inf)
    # the two sides of the other link have exactly equal errors
    chosen_from = minima.valid if continuous else error == error.min(axis=0)
    bridged = _find_connections(problem, phi, goal, minima, chosen_from)
    travel = minima.u / (linkage.coupler_length + linkage.rocker_length)
    choice = _choose_minima(w * minima.error**2, travel, chosen_from, bridged, closed)
    at = (choice, np.arange(n))
    kinds, branches = problem.labels
    steps = np.arange(n if closed else n - 1)
    return VariationalMotion(
        rotation=phi,
        u=minima.u[at],
        coupler_angle=_wrap_angles(minima.coupler[at]),
        rocker_angle=_wrap_angles(minima.rocker[at]),
        branch=branches[choice],
        kind=kinds[choice],
        error=minima.error[at],
        weights=w,
        jumps=steps[~bridged[steps, choice[steps], choice[(steps + 1) % n]]],
        guide_angle=problem.guide_angle,
    )


def _wrap_angles(angle: FloatArray) -> FloatArray:
    """Return angles (rad) shifted by whole turns into (-pi, pi]."""
    return pi - np.mod(pi - angle, 2.0 * pi)


def _describe_unreachable(problem: _Problem, phi: FloatArray, n: int) -> str:
    """Return a sentence that says at which rotation ``phi`` the links are farthest from being joined, and by how much.

    ``phi`` are the rotations at which the links cannot be joined, ``n`` is the number of all rotations.
    """
    b = problem.pin(phi)
    limits = problem._limits()
    most = limits[0][1]
    short = np.abs(b.imag) - most
    where = f"the links cannot be joined at {len(phi)} of {n} rotations"
    worst = int(short.argmax())
    if short[worst] > 0.0:
        return (
            f"{where}: at {phi[worst]:.6g} rad the guide passes the crank pin at {abs(b.imag[worst]):.6g} m, and coupler "
            f"and rocker span {most:.6g} m, too little by {short[worst]:.3g} m"
        )
    low, high = problem.stroke
    half = np.sqrt(most**2 - b.imag**2)
    inner = np.sqrt(np.maximum(limits[-1][1] ** 2 - b.imag**2, 0.0)) if len(limits) > 1 else np.zeros_like(half)
    spans = [(b.real - half, b.real - inner), (b.real + inner, b.real + half)]
    gap = np.min([np.maximum(np.maximum(start - high, low - end), 0.0) for start, end in spans], axis=0)
    worst = int(gap.argmax())
    reach = " or ".join(f"from {start[worst]:.6g} to {end[worst]:.6g} m" for start, end in spans)
    return (
        f"{where}: at {phi[worst]:.6g} rad the slider has to be {reach}, and the stroke, from {low:.6g} to {high:.6g} m, "
        f"ends {gap[worst]:.3g} m away from there"
    )


def _find_connections(
    problem: _Problem,
    phi: FloatArray,
    goal: NDArray[np.complex128] | FloatArray,
    minima: _Minima,
    chosen_from: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Find the minima that continuous paths connect.

    The result, shape (n, m, m), says at [k, i, j] whether a path leads from minimum i at rotation k to minimum j at rotation
    k + 1. The last rotation is followed by the first, a turn later.

    Between two rotations the target moves along a straight line. The step is bisected: in the middle, the minimum whose u is
    nearest to the values at both ends is taken. Then the half with the wider gap of u is bisected, and so on. For a path the
    gap vanishes; for a jump it remains.
    """
    m, n = minima.u.shape
    following = (np.arange(n) + 1) % n
    bridged = np.zeros((n, m, m), dtype=bool)
    branches = problem.labels[1]
    pairs = chosen_from.T[:, :, None] & chosen_from[:, following].T[:, None, :] & (branches[:, None] == branches)
    k, i, j = np.nonzero(pairs)
    start, step = phi[k], np.append(np.diff(phi), 2.0 * pi - (phi[-1] - phi[0]))[k]
    aim, change = goal[k], goal[following[k]] - goal[k]
    if not np.iscomplexobj(goal):
        change = _wrap_angles(change)
    left, right = np.zeros(len(k)), np.ones(len(k))
    u_left, u_right = minima.u[i, k], minima.u[j, following[k]]
    tolerance = GAP * (problem.linkage.coupler_length + problem.linkage.rocker_length)
    for _ in range(HALVINGS):
        done = np.abs(u_right - u_left) <= tolerance
        bridged[k[done], i[done], j[done]] = True
        go = ~done
        k, i, j, start, step, aim, change, left, right, u_left, u_right = (
            values[go] for values in (k, i, j, start, step, aim, change, left, right, u_left, u_right)
        )
        if len(k) == 0:
            break
        middle = 0.5 * (left + right)
        between = problem.minima(start + middle * step, aim + middle * change)
        gap = np.maximum(np.abs(between.u - u_left), np.abs(between.u - u_right))
        gap = np.where(between.valid & (branches[:, None] == branches[i]), gap, inf)
        best = gap.argmin(axis=0), np.arange(len(k))
        u = between.u[best]
        wide_left = np.abs(u - u_left) > np.abs(u - u_right)
        left, u_left = np.where(wide_left, left, middle), np.where(wide_left, u_left, u)
        right, u_right = np.where(wide_left, middle, right), np.where(wide_left, u, u_right)
    return bridged


def _choose_minima(
    squares: FloatArray, travel: FloatArray, chosen_from: NDArray[np.bool_], bridged: NDArray[np.bool_], closed: bool
) -> NDArray[np.int64]:
    """Return the index of the chosen minimum (row) at each rotation (column), by dynamic programming.

    The choice has the fewest jumps, then the least sum of squares, then the least travel.
    """
    m, n = squares.shape
    whole = float(np.where(chosen_from, squares, 0.0).max(axis=0).sum())
    cost = np.where(chosen_from, squares / (whole or 1.0), inf)
    step = np.empty((n, m, m))
    for k in range(n):
        step[k] = TRAVEL * (travel[:, k, None] - travel[:, (k + 1) % n]) ** 2 + JUMP * ~bridged[k]
    # least cost so far, by the row in the first column and the row in the present one
    total = np.where(np.eye(m, dtype=bool), cost[:, 0], inf)
    before = np.empty((n, m, m), dtype=int)
    for k in range(1, n):
        ways = total[:, :, None] + step[k - 1]
        before[k] = ways.argmin(axis=1)
        total = ways.min(axis=1) + cost[:, k]
    if not closed:
        # no cost for the step back to the first rotation
        step[-1] = 0.0
    first, row = np.unravel_index(int((total + step[-1].T).argmin()), (m, m))
    choice = np.empty(n, dtype=int)
    for k in range(n - 1, -1, -1):
        choice[k] = row
        if k:
            row = before[k, first, row]
    return choice
