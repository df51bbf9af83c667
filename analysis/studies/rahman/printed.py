"""Rahman's equations as printed, in pounds, inches and seconds: the iteration of section 2.6.1, and eqs 37 to 43, 46 to 69.

The equations are kept exactly, with their errors, to be compared with correct values. Where a second rate has one dot in our
scan, it is read as two dots, since each term of a second rate has one second rate or two first rates. A switch ``erratum_N``
mends the erratum N of docs/rahman.md. The suffix ``_t`` of an angle's name denotes its rate, ``_tt`` its second rate. nFni is
the force in joint n along axis i of frame n, and nTni the moment; 1F1 and 1T1 act from the ground on the crank.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.published import CRANK_SPEED, POUND_FORCE

from ...numerics.dual import Dual, about_i, about_j, about_k, stack
from ...slider_crank import close, settle
from ...slider_crank.closure import chain, equations, planar, residuals
from ...units import INCH
from ..statements import FloatArray

#: Step of the crank angle (deg) in the continuation, and greatest number of corrections at an angle: our choice.
STEP_DEG, MAX_STEPS = 5.0, 200
#: Largest change of an angle (rad) or of S4 (in) in a small step: our choice too.
STEP = 1e-6
#: Crank angles of the continuation (deg).
GRID_DEG = np.arange(0.0, 360.0, STEP_DEG)


class Turn(NamedTuple):
    """Result of the iteration at the m angles of `GRID_DEG` for n shifts.

    ``unknowns`` (m, n, 5) are theta2, eta2, theta3, eta3 (rad) and S4 (in). ``rotation_deg`` (m, n) is the rotation by which
    the loop is open, ``error_in`` (m, n) the error of S4. ``steps`` (m, n) are the numbers of corrections. ``settled`` (n,)
    tells whether the last correction was small at every angle. The results of a shift are NaN from the first
    angle at which the iteration does not converge.
    """

    unknowns: FloatArray
    rotation_deg: FloatArray
    error_in: FloatArray
    steps: FloatArray
    settled: NDArray[np.bool_]


def turn(p: SliderCrankParameters, shift_in: ArrayLike, *, small: float = STEP, off: ArrayLike = 0.0) -> Turn:
    """Run the iteration over a turn for given shifts (in), starting at theta1 = 0 from the planar estimate.

    ``off`` (n, 5), in rad and in, is added to this estimate. At each later angle the iteration starts from the solution at the
    previous angle. It ends when a correction is below ``small`` (rad, in).
    """
    shifts = np.atleast_1d(np.asarray(shift_in, dtype=float))
    shape = (GRID_DEG.size, shifts.size)
    blank = np.full(shape, np.nan)
    found = Turn(np.full((*shape, 5), np.nan), blank, blank.copy(), blank.copy(), np.ones(shifts.size, dtype=bool))
    going = np.arange(shifts.size)
    start = planar(p, np.zeros(going.size)) + np.asarray(off) * [1.0, 1.0, 1.0, 1.0, INCH]
    for k, angle in enumerate(np.radians(GRID_DEG)):
        angles, shift = np.full(going.size, angle), shifts[going] * INCH
        ended = settle(p, angles, shift, rows="printed", start=start, step_tolerance=small, max_steps=MAX_STEPS)
        found.settled[going[~ended.settled]] = False
        going = going[ended.settled]
        if not going.size:
            break
        at = (k, going)
        found.unknowns[at] = ended.unknowns[ended.settled] / [1.0, 1.0, 1.0, 1.0, INCH]
        found.rotation_deg[at] = np.degrees(ended.rotation_residual[ended.settled])
        found.error_in[at] = ended.position_error[ended.settled] / INCH
        found.steps[at] = ended.steps[ended.settled]
        start = ended.unknowns[ended.settled]
    return found


def close_loop_combined(p: SliderCrankParameters, shift_in: float) -> tuple[FloatArray, FloatArray, bool]:
    """Close the loop at every second angle of `GRID_DEG` by Newton-Raphson and Davidon-Fletcher-Powell steps.

    The rule that combines them is ours: the thesis prints the Newton-Raphson steps only (eqs 7 to 26), and its reference 12,
    on the combination, was not at hand. A step by eq 23a is taken if it halves the sum of squares of eq 25, with lengths in
    inches; otherwise a Davidon-Fletcher-Powell step reduces that sum. The start is the planar estimate, then the solution at
    the previous angle. Returns the rotation by which the loop is open (deg) and the error of S4 (in) at each angle, and
    whether the last step was small at every angle.
    """
    unit, angles = np.array([1.0, 1.0, 1.0, 1.0, INCH]), np.radians(GRID_DEG[::2])
    away = 1e-6 * np.concatenate([np.zeros((1, 5)), np.eye(5), -np.eye(5)])
    q, ended, settled = planar(p, angles[:1])[0] / unit, [], True
    for angle in angles:

        def linearise(q: FloatArray, angle: float = angle) -> tuple[FloatArray, FloatArray, float, FloatArray]:
            """Return A and V of eqs 24 and 25, the sum of squares of V, and its gradient."""
            th, s1 = np.full(len(away), angle), np.full(len(away), shift_in * INCH)
            matrix, right = equations(*chain(p, th, s1, (q + away) * unit), INCH, "printed")
            sums = np.sum(right**2, -1)
            return matrix[0], right[0], float(sums[0]), (sums[1:6] - sums[6:]) / 2e-6

        matrix, right, error, slope = linearise(q)
        metric: FloatArray = np.empty(0)
        for _ in range(MAX_STEPS):
            step = np.linalg.pinv(matrix) @ right
            new = linearise(q + step)
            if new[2] <= 0.5 * error:
                metric = np.empty(0)
            else:
                metric = metric if metric.size else np.asarray(np.linalg.pinv(matrix.T @ matrix))
                step = -metric @ slope
                while (new := linearise(q + step))[2] > error and np.abs(step).max() > STEP:
                    step *= 0.5
                change = new[3] - slope
                turned = metric @ change
                if step @ change > 0.0:
                    metric = (
                        metric + np.outer(step, step) / (step @ change) - np.outer(turned, turned) / (change @ turned)
                    )
            q, (matrix, right, error, slope) = q + step, new
            if np.abs(step).max() <= STEP:
                break
        else:
            settled = False
        ended.append(q)
    shifts, found = np.full(angles.size, shift_in * INCH), np.array(ended) * unit
    rotation, _ = residuals(chain(p, angles, shifts, found)[0])
    position = np.abs(found[:, 4] - close(p, angles, shifts).slider_position)
    return np.degrees(rotation), position / INCH, settled


class Crank(NamedTuple):
    """Crank and shift: lengths a1 and a2 (in), theta1' (rad/s), S1' (in/s), theta1'' (rad/s2) and S1'' (in/s2)."""

    a1: float
    a2: float
    speed: float
    shift_rate: float = 0.0
    acceleration: float = 0.0
    shift_acceleration: float = 0.0


class Joints(NamedTuple):
    """Values of theta2, eta2, theta3, eta3 (rad) and S4 (in), or their first or second rates."""

    th2: FloatArray
    eta2: FloatArray
    th3: FloatArray
    eta3: FloatArray
    s4: FloatArray


#: The crank of section 3.1 at its speed, and a configuration in general position.
CRANK_AT_SPEED = Crank(12.0, 50.0, CRANK_SPEED)
GENERAL = Joints(*(np.array(value) for value in (2.1, 0.35, -1.3, 0.2, 40.0)))


def state_later(c: Crank, q: Joints, r: Joints, a: Joints) -> tuple[Crank, Joints, Joints]:
    """Return the crank, the joint values and their rates an imaginary time of 1e-20j s later.

    The imaginary part of any function of the results, divided by 1e-20, is its time derivative without rounding error.
    """
    speeds = (c.speed + 1e-20j * c.acceleration, c.shift_rate + 1e-20j * c.shift_acceleration)
    moved = [Joints(*(x + 1e-20j * y for x, y in zip(*pair))) for pair in ((q, r), (r, a))]
    return Crank(c.a1, c.a2, *cast("tuple[float, float]", speeds)), moved[0], moved[1]


def joint_rates(c: Crank, q: Joints, *, erratum_4: bool = False) -> Joints:
    """Return the joint rates by eqs 39 to 43; ``erratum_4`` mends eq 39."""
    (s2, se, s3), (c2, ce, c3) = (f([q.th2, q.eta2, q.th3]) for f in (np.sin, np.cos))
    w, v = c.speed, c.shift_rate
    factor = ce**2 if erratum_4 else 1.0
    bracket = c.a1 * w * (c2 * s3 + s2 * c3 * ce) - v * se * c3
    lever = c.a2 * s2 * s3
    return Joints(
        th2=(v * c3 * se * ce - c.a1 * w * (factor * s2 * c3 + c2 * s3 * ce) - c.a2 * w * s3) / (c.a2 * s3),
        eta2=-se * bracket / lever,
        th3=bracket / (c.a2 * s3),
        eta3=c2 * se * bracket / lever,
        s4=(v * se - w * c.a1 * s2 * ce) / s3,
    )


def joint_accelerations(c: Crank, q: Joints, r: Joints) -> Joints:
    """Return the second rates of the joints by eqs 38a to 42a."""
    (s2, se, s3), (c2, ce, c3) = (f([q.th2, q.eta2, q.th3]) for f in (np.sin, np.cos))
    w, v, a1, a2 = c.speed, c.shift_rate, c.a1, c.a2
    wt, vt = c.acceleration, c.shift_acceleration
    bracket = a1 * w * (c2 * s3 + s2 * c3 * ce) - v * se * c3
    bracket_t = (
        a1
        * w
        * (-r.th2 * s2 * s3 + r.th3 * c2 * c3 + r.th2 * c2 * c3 * ce - r.th3 * s2 * s3 * ce - r.eta2 * s2 * c3 * se)
        - v * r.eta2 * ce * c3
        + v * r.th3 * se * s3
        + a1 * wt * (c2 * s3 + s2 * c3 * ce)
        - vt * se * c3
    )
    top = v * c3 * se * ce - a1 * w * (s2 * c3 + c2 * s3 * ce) - a2 * w * s3
    top_t = (
        -v * r.th3 * s3 * se * ce
        + v * r.eta2 * c3 * (ce**2 - se**2)
        - a1
        * w
        * (r.th2 * c2 * c3 - r.th3 * s2 * s3 - r.th2 * s2 * s3 * ce + r.th3 * c2 * c3 * ce - r.eta2 * c2 * s3 * se)
        - a2 * w * r.th3 * c3
        + vt * c3 * se * ce
        - a1 * wt * (s2 * c3 + c2 * s3 * ce)
        - a2 * wt * s3
    )
    lever, lever_t = a2 * s2 * s3, a2 * (r.th2 * c2 * s3 + r.th3 * s2 * c3)
    return Joints(
        th2=(s3 * top_t - r.th3 * c3 * top) / (a2 * s3**2),
        eta2=(lever * (-r.eta2 * ce * bracket - se * bracket_t) + se * bracket * lever_t) / lever**2,
        th3=(s3 * bracket_t - r.th3 * c3 * bracket) / (a2 * s3**2),
        eta3=(
            lever * ((-r.th2 * s2 * se + r.eta2 * c2 * ce) * bracket + c2 * se * bracket_t)
            - c2 * se * bracket * lever_t
        )
        / lever**2,
        s4=(
            s3 * (vt * se + v * r.eta2 * ce - a1 * (wt * s2 * ce + w * (r.th2 * c2 * ce - r.eta2 * s2 * se)))
            - (v * se - w * a1 * s2 * ce) * r.th3 * c3
        )
        / s3**2,
    )


def loop_rates(c: Crank, q: Joints, r: Joints) -> FloatArray:
    """Return the residuals of eqs 37a to 37f, shape (6, ...): a, c and e in rad/s, b, d and f in in/s."""
    (s2, se, s3), (c2, ce, c3) = (f([q.th2, q.eta2, q.th3]) for f in (np.sin, np.cos))
    w, v = c.speed, c.shift_rate
    return np.array(
        [
            -(w + r.th2) * se + r.eta2 * s2 * ce,
            w * c.a1 * s2 * ce - v * se + r.s4 * s3,
            r.eta2 * c2 + r.eta3,
            w * (c.a1 * c2 + c.a2 * ce) + r.th2 * c.a2 * ce + r.eta2 * c.a2 * s2 * se - r.s4 * c3,
            (w + r.th2) * ce + r.eta2 * s2 * se + r.th3,
            w * c.a1 * s2 * se - r.eta2 * c.a2 * c2 + v * ce,
        ]
    )


def separated_rates(c: Crank, q: Joints) -> FloatArray:
    """Return eq 38, shape (6, 6): five columns of coefficients of theta2', theta3', eta2', eta3', S4', and the right side."""
    (s2, se, s3), (c2, ce, c3) = (f([q.th2, q.eta2, q.th3]) for f in (np.sin, np.cos))
    w, v = c.speed, c.shift_rate
    return np.array(
        [
            [-se, 0.0, s2 * ce, 0.0, 0.0, w * se],
            [0.0, 0.0, 0.0, 0.0, s3, -w * c.a1 * s2 * ce + v * se],
            [0.0, 0.0, c2, 1.0, 0.0, 0.0],
            [c.a2 * ce, 0.0, c.a2 * s2 * se, 0.0, -c3, -w * (c.a1 * c2 + c.a2 * ce)],
            [ce, 1.0, s2 * se, 0.0, 0.0, -w * ce],
            # sin theta2 lacks sin eta2 (erratum 9)
            [0.0, 0.0, -c.a2 * c2, 0.0, 0.0, -w * c.a1 * s2 - v * ce],
        ]
    )


def mended_row(p: SliderCrankParameters, angle: FloatArray, shift: FloatArray, q: Joints, speed: float) -> FloatArray:
    """Return the residual of eq 37f (in/s) with erratum 2 mended, with joint rates that satisfy eqs 37a to 37e.

    ``angle`` (rad), ``shift`` (m) and ``speed`` (rad/s) are theta1, S1 and theta1'. With the erratum mended, the rate of eta
    acts about the axis j that the rotation by theta has turned.
    """
    _, screws = chain(p, angle, shift, np.stack([*q[:4], q.s4 * INCH], -1))
    zero = np.zeros_like(angle)
    pin = about_k(Dual(angle, shift)) @ about_i(Dual(zero, p.crank_length))
    front = pin @ about_k(q.th2) @ about_j(q.eta2) @ about_i(Dual(zero, p.rod_length))
    # the inverse of a dual rotation is its transpose
    to_rod = Dual(np.swapaxes(front.real, -1, -2), np.swapaxes(front.dual, -1, -2))
    local = to_rod @ screws
    matrix = np.concatenate([local.real, local.dual / INCH], -2)
    matrix[..., 4] *= INCH
    known = np.concatenate([to_rod.real[..., 2], to_rod.dual[..., 2] / INCH], -1) * speed
    solved = -np.linalg.solve(matrix[:, :5], known[:, :5, None])[..., 0]
    return np.asarray(np.einsum("ni,ni->n", matrix[:, 5], solved) + known[:, 5])


class Bodies(NamedTuple):
    """Masses (lb.s2/in), distances g1 and g2 of the centres of mass from the distal joints (in), squared radii of gyration.

    The squared radii (in2) are K1z2 of the crank, and the squared radii about x, y and z of rod and slider.
    """

    masses: tuple[float, ...]
    g1: float
    g2: float
    crank_square: float
    rod_squares: tuple[float, float, float]
    slider_squares: tuple[float, float, float]


def bodies(p: SliderCrankParameters, *, erratum_6: bool = False) -> Bodies:
    """Return the bodies of section 3.1 with g3 = 0; ``erratum_6`` mends the signs of g1 and g2."""
    side = -1.0 if erratum_6 else 1.0
    a1, a2 = p.crank_length / INCH, p.rod_length / INCH
    masses = [mass * INCH / POUND_FORCE for mass in (p.crank_mass, p.rod_mass, p.slider_mass)]
    crank, rod, slider = 1.5**2 / 4.0 + a1**2 / 3.0, 1.0 / 4.0 + a2**2 / 3.0, 3.0**2 / 6.0
    return Bodies(tuple(masses), side * a1 / 2.0, side * a2 / 2.0, crank, (0.5, rod, rod), (slider, slider, slider))


def _dual(real: list[ArrayLike], dual: list[ArrayLike]) -> Dual:
    """Build a dual vector (..., 3) from real and dual components, each a number or an array."""
    # arrays of single precision stay in single precision beside plain numbers
    joined = np.stack(np.broadcast_arrays(*real, *dual), -1, dtype=np.result_type(*real, *dual))
    return Dual(joined[..., :3], joined[..., 3:])


def velocities(c: Crank, q: Joints, r: Joints) -> tuple[Dual, Dual, Dual]:
    """Return the dual velocities of crank, rod and slider by eqs 33, 36 and 32a; this is the mixed path."""
    s3, c3 = np.sin(q.th3), np.cos(q.th3)
    return (
        _dual([0.0, 0.0, c.speed], [0.0, c.a1 * c.speed, c.shift_rate]),
        _dual([0.0, -r.eta3, -r.th3], [-r.s4 * s3, r.s4 * c3, 0.0]),
        _dual([0.0, 0.0, 0.0], [0.0, 0.0, -r.s4]),
    )


def forward_rod_velocity(c: Crank, q: Joints, r: Joints) -> Dual:
    """Return the dual velocity of the rod by eq 35; this is the forward path."""
    (s2, se), (c2, ce), turning = np.sin([q.th2, q.eta2]), np.cos([q.th2, q.eta2]), c.speed + r.th2
    return _dual(
        [r.eta2 * s2 * ce - turning * se, r.eta2 * c2, turning * ce + r.eta2 * s2 * se],
        [
            c.speed * c.a1 * s2 * ce - c.shift_rate * se,
            c.speed * c.a1 * c2 + r.eta2 * c.a2 * s2 * se + turning * c.a2 * ce,
            c.shift_rate * ce + c.a1 * c.speed * s2 * se - r.eta2 * c.a2 * c2,
        ],
    )


def _forward_rod_rate(c: Crank, q: Joints, r: Joints, a: Joints) -> Dual:
    """Return the rate of the rod's dual velocity by eq 35; eqs 55 and 56 share its terms."""
    (s2, se), (c2, ce), turning = np.sin([q.th2, q.eta2]), np.cos([q.th2, q.eta2]), c.speed + r.th2
    w, v, wt, vt = c.speed, c.shift_rate, c.acceleration, c.shift_acceleration
    about_j2 = a.eta2 * c2 - r.eta2 * r.th2 * s2
    about_k2 = (
        (wt + a.th2) * ce - turning * r.eta2 * se + a.eta2 * s2 * se + r.eta2 * r.th2 * c2 * se + r.eta2**2 * s2 * ce
    )
    return _dual(
        [
            a.eta2 * s2 * ce
            + r.eta2 * r.th2 * c2 * ce
            - r.eta2**2 * s2 * se
            - (wt + a.th2) * se
            - turning * r.eta2 * ce,
            about_j2,
            about_k2,
        ],
        [
            c.a1 * (wt * s2 * ce + w * r.th2 * c2 * ce - w * r.eta2 * s2 * se) - vt * se - v * r.eta2 * ce,
            c.a1 * (wt * c2 - w * r.th2 * s2) + c.a2 * about_k2,
            vt * ce
            - v * r.eta2 * se
            + c.a1 * (wt * s2 * se + w * r.th2 * c2 * se + w * r.eta2 * s2 * ce)
            - c.a2 * about_j2,
        ],
    )


def _slider_rotation(q: Joints) -> FloatArray:
    """Return the rotation matrix of eq 45 from frame 3 to frame 4, the transpose of the matrix of eq 3."""
    (s3, sh), (c3, ch) = np.sin([q.th3, q.eta3]), np.cos([q.th3, q.eta3])
    return np.array([[c3 * ch, s3 * ch, -sh], [c3 * sh, s3 * sh, ch], [s3, -c3, 0.0 * s3]])


def forward_slider_velocity(c: Crank, q: Joints, r: Joints) -> Dual:
    """Return the slider's dual velocity by eq 45."""
    rod, rotation = forward_rod_velocity(c, q, r), _slider_rotation(q)
    joint = np.stack([0.0 * r.th3, r.eta3, r.th3], -1)
    return Dual(*(np.einsum("ij...,...j->...i", rotation, x) for x in (rod.real + joint, rod.dual)))


def forward_slider_momentum(c: Crank, b: Bodies, q: Joints, r: Joints, g3: float, *, slip: bool = False) -> Dual:
    """Return the slider's dual momentum by eq 51a; ``slip`` keeps the printed cos theta3 instead of cos eta3 (erratum 9)."""
    (s2, se, s3, sh), (c2, ce, c3, ch) = (f([q.th2, q.eta2, q.th3, q.eta3]) for f in (np.sin, np.cos))
    w, v, turning, (k3x, k3y, k3z) = c.speed, c.shift_rate, c.speed + r.th2, b.slider_squares
    # the six brackets of eq 51a, which has each of them several times
    x, y, z = r.eta2 * s2 * ce - turning * se, r.eta2 * c2 + r.eta3, turning * ce + r.eta2 * s2 * se + r.th3
    xd, yd = c.a1 * w * s2 * ce - v * se, c.a1 * w * c2 + c.a2 * r.eta2 * s2 * se + turning * c.a2 * ce
    zd = v * ce + c.a1 * w * s2 * se - c.a2 * r.eta2 * c2
    found = _dual(
        [
            c3 * ch * xd + s3 * ch * yd - sh * zd,
            g3 * (s3 * x - c3 * y) + (c3 * sh * xd + s3 * sh * yd + (c3 if slip else ch) * zd),
            -g3 * (c3 * sh * x + s3 * sh * y + ch * z) + (s3 * xd - c3 * yd),
        ],
        [
            k3x * (c3 * ch * x + s3 * ch * y - sh * z),
            k3y * (c3 * sh * x + s3 * sh * y + ch * z) - g3 * (s3 * xd - c3 * yd),
            k3z * (s3 * x - c3 * y) + g3 * (c3 * sh * xd + s3 * sh * yd + ch * zd),
        ],
    )
    return cast(Dual, b.masses[2] * found)


def forward_momentum_rates(c: Crank, b: Bodies, q: Joints, r: Joints, a: Joints, g3: float) -> tuple[Dual, Dual]:
    """Return the rates of the dual momenta of rod and slider by eqs 55 and 56, with terms collected and cos eta3 in eq 56."""
    (_, m2, m3), rod = b.masses, _forward_rod_rate(c, q, r, a)
    (s3, sh), (c3, ch) = np.sin([q.th3, q.eta3]), np.cos([q.th3, q.eta3])
    turned = np.array(
        [
            [-r.th3 * s3 * ch - r.eta3 * c3 * sh, r.th3 * c3 * ch - r.eta3 * s3 * sh, -r.eta3 * ch],
            [r.eta3 * c3 * ch - r.th3 * s3 * sh, r.th3 * c3 * sh + r.eta3 * s3 * ch, -r.eta3 * sh],
            [r.th3 * c3, r.th3 * s3, 0.0 * s3],
        ]
    )
    now, rotation = forward_rod_velocity(c, q, r), _slider_rotation(q)
    real = rotation @ (rod.real + np.array([0.0, a.eta3, a.th3])) + turned @ (now.real + np.array([0.0, r.eta3, r.th3]))
    slider = Dual(real, rotation @ rod.dual + turned @ now.dual)
    return m2 * _collected(rod, b.g2, b.rod_squares), m3 * _collected(slider, g3, b.slider_squares)


def _collected(v: Dual, g: float, squares: tuple[float, float, float]) -> Dual:
    """Return the rate of a body's dual momentum divided by the body's mass.

    ``v`` is the rate of the body's dual velocity, ``g`` the x coordinate of its centre of mass, ``squares`` are its
    squared radii of gyration.
    """
    (x, y, z), (xd, yd, zd), (kx, ky, kz) = v.real, v.dual, squares
    return _dual([xd, yd + g * z, zd - g * y], [kx * x, ky * y - g * zd, kz * z + g * yd])


def crank_momentum(c: Crank, b: Bodies) -> Dual:
    """Return the crank's dual momentum by eq 49a, or its rate by eq 54 if ``c`` has accelerations in place of the speeds."""
    m1, w, v = b.masses[0], c.speed, c.shift_rate
    return _dual(
        [0.0, m1 * w * (c.a1 + b.g1), m1 * v], [0.0, -m1 * b.g1 * v, m1 * (b.crank_square * w + b.g1 * c.a1 * w)]
    )


def forward_rod_momentum(c: Crank, b: Bodies, q: Joints, r: Joints) -> Dual:
    """Return the rod's dual momentum by eq 50a, divided by its mass."""
    (s2, se), (c2, ce), turning = np.sin([q.th2, q.eta2]), np.cos([q.th2, q.eta2]), c.speed + r.th2
    w, v, g2, (k2x, k2y, k2z) = c.speed, c.shift_rate, b.g2, b.rod_squares
    return _dual(
        [
            c.a1 * w * s2 * ce - v * se,
            (g2 * ce + c.a2 * ce) * turning + (g2 + c.a2) * r.eta2 * s2 * se + w * c.a1 * c2,
            v * ce + c.a1 * w * s2 * se - (c.a2 + g2) * r.eta2 * c2,
        ],
        [
            k2x * r.eta2 * s2 * ce - k2x * turning * se,
            (k2y + g2 * c.a2) * r.eta2 * c2 - g2 * v * ce - g2 * c.a1 * w * s2 * se,
            (k2z * ce + g2 * c.a2 * ce) * turning + (k2z + g2 * c.a2) * r.eta2 * s2 * se + c.a1 * g2 * w * c2,
        ],
    )


def momenta(
    c: Crank, b: Bodies, q: Joints, r: Joints, *, g3: float = 0.0, slip: bool = False
) -> tuple[Dual, Dual, Dual]:
    """Return the dual momenta by eqs 49a, 52a and 53a; ``slip`` keeps the printed g3 for g2 in 52a (erratum 9)."""
    (_, m2, m3), (_, k2y, k2z), c3 = b.masses, b.rod_squares, np.cos(q.th3)
    return (
        crank_momentum(c, b),
        _dual(
            [-m2 * r.s4 * np.sin(q.th3), m2 * (r.s4 * c3 - b.g2 * r.th3), m2 * (g3 if slip else b.g2) * r.eta3],
            [0.0, -m2 * k2y * r.eta3, m2 * (b.g2 * r.s4 * c3 - k2z * r.th3)],
        ),
        _dual([0.0, 0.0, -m3 * r.s4], [0.0, m3 * g3 * r.s4, 0.0]),
    )


def momentum_rates(c: Crank, b: Bodies, q: Joints, r: Joints, a: Joints, *, g3: float = 0.0) -> tuple[Dual, Dual, Dual]:
    """Return the rates of the dual momenta by eqs 54, 57 and 58."""
    (_, m2, m3), (_, k2y, k2z), s3, c3 = b.masses, b.rod_squares, np.sin(q.th3), np.cos(q.th3)
    turned = a.s4 * c3 - r.s4 * s3 * r.th3
    return (
        crank_momentum(Crank(c.a1, c.a2, c.acceleration, c.shift_acceleration), b),
        _dual(
            [-m2 * (a.s4 * s3 + r.s4 * c3 * r.th3), m2 * (turned - b.g2 * a.th3), m2 * b.g2 * a.eta3],
            [0.0, -m2 * k2y * a.eta3, m2 * (b.g2 * turned - k2z * a.th3)],
        ),
        _dual([0.0, 0.0, -m3 * a.s4], [0.0, m3 * g3 * a.s4, 0.0]),
    )


def inertia_force(velocity: Dual, momentum: Dual, rate: Dual) -> Dual:
    """Return a dual inertia force by eqs 59 to 61, component by component as printed."""
    (vx, vy, vz), (hx, hy, hz) = (
        [Dual(x.real[..., n], x.dual[..., n]) for n in range(3)] for x in (velocity, momentum)
    )
    turned = (vy * hz - vz * hy, vz * hx - vx * hz, vx * hy - vy * hx)
    return cast(Dual, rate + stack(turned))


def inertia_forces(c: Crank, b: Bodies, q: Joints, r: Joints, a: Joints) -> list[Dual]:
    """Return the inertia forces f1, f2 and f3 by eqs 49a, 52a, 53a, 54 and 57 to 61."""
    return [
        inertia_force(*body) for body in zip(velocities(c, q, r), momenta(c, b, q, r), momentum_rates(c, b, q, r, a))
    ]


def joint_forces(
    c: Crank, b: Bodies, q: Joints, r: Joints, a: Joints, torque: float, *, erratum_5: bool = False
) -> dict[str, FloatArray]:
    """Return all joint forces (lb) and moments (lb.in) by eqs 49a, 52a, 53a, 54, 57 to 61 and 69a to 69q.

    The shift is constant. The equations are as printed, except that the slip in 52a (g3 for g2) is mended. ``erratum_5`` mends
    the signs of f1 and f3 in eqs 62 and 64. 1F1k is 0, as in the thesis.
    """
    (s2, se, s3, sh), (c2, ce, c3, ch) = (f([q.th2, q.eta2, q.th3, q.eta3]) for f in (np.sin, np.cos))
    f1, f2, f3 = inertia_forces(c, b, q, r, a)
    if erratum_5:
        f1, f3 = -f1, -f3
    (f1x, f1y, f1z), (f2x, f2y, f2z), (f3x, f3y, f3z) = (np.moveaxis(f.real, -1, 0) for f in (f1, f2, f3))
    (f1xd, f1yd, f1zd), (f2xd, f2yd, f2zd), slider_moments = (np.moveaxis(f.dual, -1, 0) for f in (f1, f2, f3))
    f = {"f1xd": f1xd, "f1yd": f1yd, "f2xd": f2xd} | {
        f"4T4{axis}": -moment for axis, moment in zip("ijk", slider_moments)
    }
    f["2F2k"] = -f1z + 0.0 * f2z
    f["3F3j"] = -(f2y + f2zd / c.a2)
    f["3F3k"] = f2yd / c.a2 - f2z
    f["2F2j"] = -f1y - (f1zd + torque) / c.a1
    f["2F2i"] = (f["2F2j"] * c.a2 * c2 - f2zd) / (c.a2 * s2)
    f["along crank"], f["across crank"] = -(f["2F2i"] + f1x), (torque + f1zd) / c.a1
    f["3F3i"] = -f["2F2i"] * c2 * ce - f["2F2j"] * s2 * ce + f["2F2k"] * se - f2x
    f["4F4k"] = f["3F3j"] * c3 - f["3F3i"] * s3 - f3z
    f["4F4j"] = -(f["3F3i"] * c3 * sh + f["3F3j"] * s3 * sh + f["3F3k"] * ch + f3y)
    f["4F4i"] = -(f["3F3i"] * c3 * ch + f["3F3j"] * s3 * ch - f["3F3k"] * sh + f3x)
    return f


def crank_bearing_forces(angle: FloatArray, f: dict[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the forces 1F1i and 1F1j (lb) by eqs 69i and 69j; ``f`` has the forces that these equations need."""
    s, c = np.sin(angle), np.cos(angle)
    return f["along crank"] * c - f["across crank"] * s, f["along crank"] * s + f["across crank"] * c


def bearing_moments(angle: FloatArray, shift_in: float, f: dict[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the moments 1T1i and 1T1j (lb.in) by eqs 69q and 69p.

    The equations take the axial force 1F1k as 0, as the thesis has it for a constant shift.
    """
    (i, j), s, c = crank_bearing_forces(angle, f), np.sin(angle), np.cos(angle)
    return -j * shift_in - f["f1xd"] * c + f["f1yd"] * s, i * shift_in - f["f1xd"] * s - f["f1yd"] * c
