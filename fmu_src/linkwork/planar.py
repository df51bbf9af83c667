"""Kinematics and forces of planar linkages built of dyads: the functions that the equations of described linkages call.

Every `Vector` and every `Turn` has one column for each degree of freedom. This column is the velocity coefficient: the
derivative with respect to the coordinate of the degree of freedom. One more column, the last, is the bias acceleration: the
acceleration if no coordinate accelerates. With coordinates q and rates v, the velocity is the sum of column times v; the
acceleration is the sum of column times q'' plus the bias.

A dyad is a pair of bodies that are joined to each other; each of them is also joined to a body whose motion is known. The two
unknowns of a dyad follow in closed form (dyads are the groups of the second class of Assur and Artobolevskii). The name of a
dyad has a letter for each joint, R for a pin and P for a slide; the middle letter is the joint between the two bodies. The
functions are arithmetic without branches.

In all functions n is the number of degrees of freedom, v are the rates of their coordinates, u x w is the scalar
u_x w_y - u_y w_x, and J rotates a vector by +90 degrees. An arm is the vector from the origin of a body to one of its points.
Outer axes are those of the ground or of the body that carries the dyad.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, cos, fabs, sin, sqrt
from typing import Any, NamedTuple

from .friction import solve_linear
from .limits import UnjoinedMessages


class Vector(NamedTuple):
    """A position, or an arm from one point to another: components (m), rates (m/s) and columns (x, y); the last is the bias."""

    x: float
    y: float
    vx: float
    vy: float
    columns: tuple[tuple[float, float], ...]


class Turn(NamedTuple):
    """A direction: cosine and sine of its angle, angular velocity, and the columns of the angle; the last is the bias."""

    c: float
    s: float
    w: float
    columns: tuple[float, ...]


class Frame(NamedTuple):
    """The pose of a body: position of its origin, and its direction."""

    origin: Vector
    turn: Turn


class Wrench(NamedTuple):
    """Forces on a body: their sum (N) and their moment about the ground's origin (N.m)."""

    x: float
    y: float
    moment: float


class Mass(NamedTuple):
    """A body that moves: mass (kg), moment of inertia about its centre of mass (kg.m2), position of this centre, and pose."""

    mass: float
    inertia: float
    centre: Vector
    frame: Frame


Rates = tuple[float, ...]
Matrix = tuple[tuple[float, ...], ...]


# Vectors and turns


def fixed_vector(x: float, y: float, n: int) -> Vector:
    """Return a constant vector as a `Vector` with n zero columns and no bias."""
    return Vector(x, y, 0.0, 0.0, ((0.0, 0.0),) * (n + 1))


def fixed_direction(c: float, s: float, n: int) -> Turn:
    """Return a constant direction of cosine c and sine s as a `Turn` whose columns are zero."""
    return Turn(c, s, 0.0, (0.0,) * (n + 1))


def ground(n: int) -> Frame:
    """Return the pose of the ground."""
    return Frame(fixed_vector(0.0, 0.0, n), fixed_direction(1.0, 0.0, n))


def linear_direction(angle: float, share: tuple[float, ...], v: Rates) -> Turn:
    """Return the direction at an angle that is linear in the coordinates; ``share`` are the derivatives of the angle."""
    return Turn(cos(angle), sin(angle), _dot(share, v), (*share, 0.0))


def linear_arm(distance: float, share: tuple[float, ...], v: Rates) -> Vector:
    """Return an arm along x whose length is linear in the coordinates; ``share`` are the derivatives of the length."""
    return Vector(distance, 0.0, _dot(share, v), 0.0, (*((d, 0.0) for d in share), (0.0, 0.0)))


def _dot(columns: tuple[float, ...], v: Rates) -> float:
    """Return the sum over the degrees of freedom of column times rate; a bias at the end of ``columns`` is left out."""
    return sum(g * w for g, w in zip(columns, v))


def add_vectors(a: Vector, b: Vector) -> Vector:
    """Add two vectors."""
    columns = tuple((g[0] + h[0], g[1] + h[1]) for g, h in zip(a.columns, b.columns))
    return Vector(a.x + b.x, a.y + b.y, a.vx + b.vx, a.vy + b.vy, columns)


def subtract_vectors(a: Vector, b: Vector) -> Vector:
    """Return the vector a - b."""
    columns = tuple((g[0] - h[0], g[1] - h[1]) for g, h in zip(a.columns, b.columns))
    return Vector(a.x - b.x, a.y - b.y, a.vx - b.vx, a.vy - b.vy, columns)


def arm(t: Turn, x: float, y: float) -> Vector:
    """Return an arm that is fixed in a body of direction ``t``; x and y are its components in the body's axes."""
    rx, ry, ww = t.c * x - t.s * y, t.s * x + t.c * y, t.w * t.w
    *share, bias = ((-ry * g, rx * g) for g in t.columns)
    return Vector(rx, ry, -ry * t.w, rx * t.w, (*share, (bias[0] - rx * ww, bias[1] - ry * ww)))


def rotate_arm(t: Turn, a: Vector) -> Vector:
    """Return, in outer axes, an arm that moves in a body of direction ``t``; ``a`` is the arm in the body's axes.

    The bias of the result includes the centripetal and the Coriolis acceleration.
    """
    rx, ry = t.c * a.x - t.s * a.y, t.s * a.x + t.c * a.y
    ux, uy = t.c * a.vx - t.s * a.vy, t.s * a.vx + t.c * a.vy
    *share, bias = (
        (t.c * h[0] - t.s * h[1] - ry * g, t.s * h[0] + t.c * h[1] + rx * g) for g, h in zip(t.columns, a.columns)
    )
    ww, w2 = t.w * t.w, 2.0 * t.w
    last = (bias[0] - rx * ww - w2 * uy, bias[1] - ry * ww + w2 * ux)
    return Vector(rx, ry, ux - ry * t.w, uy + rx * t.w, (*share, last))


def composed_turn(t: Turn, r: Turn) -> Turn:
    """Return the direction of a body that has the direction ``r`` relative to a body of direction ``t``."""
    columns = tuple(g + h for g, h in zip(t.columns, r.columns))
    return Turn(t.c * r.c - t.s * r.s, t.s * r.c + t.c * r.s, t.w + r.w, columns)


def incline_direction(t: Turn, c: float, s: float) -> Turn:
    """Return the direction at a fixed angle, of cosine c and sine s, from the direction ``t``."""
    return Turn(t.c * c - t.s * s, t.s * c + t.c * s, t.w, t.columns)


def point(f: Frame, x: float, y: float) -> Vector:
    """Return the position of the point of a body that has the coordinates x and y in the body's frame."""
    return add_vectors(f.origin, arm(f.turn, x, y))


def composed_frame(f: Frame, inner: Frame) -> Frame:
    """Return the pose of a body whose pose relative to the body ``f`` is ``inner``."""
    return Frame(add_vectors(f.origin, rotate_arm(f.turn, inner.origin)), composed_turn(f.turn, inner.turn))


def gear_direction(carrier: Turn, line: Turn, start: Vector, block: Vector, offset: float, radius: float) -> Turn:
    """Return the direction of a gear that is pinned to a body of direction ``carrier`` and driven by a rack.

    The rack slides on the carrier along a line of direction ``line``. The line belongs to one of the two bodies, which has the
    point ``start``; the block on it belongs to the other, which has its origin at ``block``. The travel d is the distance from
    ``start`` to ``block`` along the line. The angle of the gear relative to the carrier is (d - ``offset``)/``radius``.
    """
    arm = subtract_vectors(block, start)
    way = line.c * arm.x + line.s * arm.y
    angle = (way - offset) / radius
    *share, bias = ((line.c * g[0] + line.s * g[1]) / radius for g in arm.columns)
    rate = (line.c * arm.vx + line.s * arm.vy) / radius
    turn = Turn(cos(angle), sin(angle), rate, (*share, bias + way * line.w * line.w / radius))
    return composed_turn(carrier, turn)


def pose_at_pin(pin: Vector, t: Turn, own: Vector) -> Frame:
    """Return the pose of a body of direction ``t`` that is pinned at ``pin`` by its point ``own``, given in the body's axes."""
    return Frame(subtract_vectors(pin, rotate_arm(t, own)), t)


# Dyads


def _angle(x: float, y: float, a: Vector) -> tuple[float, float]:
    """Return cosine and sine of the direction of a body from one arm: ``a`` in the body's axes, (x, y) in outer axes."""
    square = a.x * a.x + a.y * a.y
    return (x * a.x + y * a.y) / square, (y * a.x - x * a.y) / square


def _rotation_bias(w: float, c: float, s: float, a: Vector, x: float, y: float) -> tuple[float, float]:
    """Return the bias of an arm in a body of angular velocity w, without the term of the body's angular bias.

    ``a`` is the arm in the body's axes, (x, y) the same arm in outer axes; c and s are the cosine and sine of the body's
    direction.
    """
    ux, uy = c * a.vx - s * a.vy, s * a.vx + c * a.vy
    bx, by = a.columns[-1]
    return c * bx - s * by - w * w * x - 2.0 * w * uy, s * bx + c * by - w * w * y + 2.0 * w * ux


def _shares(c: float, s: float, a: Vector) -> tuple[tuple[float, float], ...]:
    """Return the columns (see `Vector`) of an arm without its bias in outer axes, from the arm ``a`` in the body's axes.

    The direction of the body has the cosine c and the sine s.
    """
    return tuple((c * g[0] - s * g[1], s * g[0] + c * g[1]) for g in a.columns[:-1])


def pin_pin_pin(p: Vector, q: Vector, a: Vector, b: Vector, branch: float, v: Rates) -> tuple[Turn, Turn, float]:
    """Solve the dyad RRR: body 1 is pinned at p, body 2 at q, and the ends of their arms a and b are pinned together at C.

    ``branch`` is the sign of (C - p) x (C - q). Returns the directions of both bodies, and the sine of the transmission angle,
    positive in this branch.
    """
    dx, dy = q.x - p.x, q.y - p.y
    dd, aa, bb = dx * dx + dy * dy, a.x * a.x + a.y * a.y, b.x * b.x + b.y * b.y
    along = 0.5 * (dd + aa - bb)
    across = branch * sqrt(aa * dd - along * along)
    x1, y1 = (along * dx - across * dy) / dd, (along * dy + across * dx) / dd
    x2, y2 = x1 - dx, y1 - dy
    (c1, s1), (c2, s2) = _angle(x1, y1, a), _angle(x2, y2, b)
    # J r1 w1 - J r2 w2 = e in every column; the determinant is r1 x r2 = across
    start = zip(p.columns, q.columns, _shares(c1, s1, a), _shares(c2, s2, b))
    rows = [(h[0] + k[0] - g[0] - f[0], h[1] + k[1] - g[1] - f[1]) for g, h, f, k in start]
    g1 = [(ex * x2 + ey * y2) / across for ex, ey in rows]
    g2 = [(ex * x1 + ey * y1) / across for ex, ey in rows]
    w1, w2 = _dot(tuple(g1), v), _dot(tuple(g2), v)
    (ax, ay), (bx, by) = _rotation_bias(w1, c1, s1, a, x1, y1), _rotation_bias(w2, c2, s2, b, x2, y2)
    ex, ey = q.columns[-1][0] + bx - p.columns[-1][0] - ax, q.columns[-1][1] + by - p.columns[-1][1] - ay
    return (
        Turn(c1, s1, w1, (*g1, (ex * x2 + ey * y2) / across)),
        Turn(c2, s2, w2, (*g2, (ex * x1 + ey * y1) / across)),
        branch * across / sqrt(aa * bb),
    )


def _block_arm(o: Vector, t: Turn, b: Vector) -> tuple[float, float, list[tuple[float, float]], tuple[float, float]]:
    """Return the arm ``b`` of a block in outer axes; the block's origin is at ``o``, the origin of its line of direction t.

    The result is x and y of the arm, the columns of the arm's end without the bias, and the bias of the arm's end.
    """
    r = rotate_arm(t, b)
    *share, bias = ((g[0] + h[0], g[1] + h[1]) for g, h in zip(o.columns, r.columns))
    return r.x, r.y, share, bias


def pin_pin_slide(
    p: Vector, o: Vector, t: Turn, a: Vector, b: Vector, branch: float, v: Rates
) -> tuple[Turn, Vector, float]:
    """Solve the dyad RRP: body 1 is pinned at p, body 2, a block, slides on the line through o of direction t.

    ``a`` and ``b`` are the arms of bodies 1 and 2 to the pin C between them, ``b`` from the block's origin, which is on the
    line. ``branch`` is the sign of the component of C - p along the line. Returns the direction of body 1, the position of the
    block as an arm along the line, and the sine of the angle between the arm a and the normal of the line.
    """
    x0, y0, share, bias = _block_arm(o, t, b)
    fx, fy = o.x + x0 - p.x, o.y + y0 - p.y
    off = t.c * fy - t.s * fx
    root = branch * sqrt(a.x * a.x + a.y * a.y - off * off)
    z = root - (t.c * fx + t.s * fy)
    x1, y1 = fx + z * t.c, fy + z * t.s
    c1, s1 = _angle(x1, y1, a)
    # J r1 w1 - t z' = e in every column; J r1 . n = r1 . t = root
    start = zip(share, t.columns, p.columns, _shares(c1, s1, a))
    rows = [(h[0] - z * t.s * w - g[0] - f[0], h[1] + z * t.c * w - g[1] - f[1]) for h, w, g, f in start]
    g1 = [(t.c * ey - t.s * ex) / root for ex, ey in rows]
    gz = [-off * w - t.c * ex - t.s * ey for w, (ex, ey) in zip(g1, rows)]
    w1, vz = _dot(tuple(g1), v), _dot(tuple(gz), v)
    ax, ay = _rotation_bias(w1, c1, s1, a, x1, y1)
    beta, ww, w2 = t.columns[-1], t.w * t.w, 2.0 * t.w * vz
    ex = bias[0] - z * t.s * beta - z * t.c * ww - w2 * t.s - p.columns[-1][0] - ax
    ey = bias[1] + z * t.c * beta - z * t.s * ww + w2 * t.c - p.columns[-1][1] - ay
    b1 = (t.c * ey - t.s * ex) / root
    return (
        Turn(c1, s1, w1, (*g1, b1)),
        _sliding_arm(z, vz, gz, -off * b1 - t.c * ex - t.s * ey),
        branch * root / sqrt(a.x * a.x + a.y * a.y),
    )


def slide_pin_slide(
    o: Vector, t: Turn, a: Vector, p: Vector, r: Turn, b: Vector, v: Rates
) -> tuple[Vector, Vector, float]:
    """Solve the dyad PRP: block 1 slides on the line through o along t, block 2 on the line through p along r.

    The ends of their arms a and b are pinned together. Returns the positions of the blocks as arms along their lines, and the
    magnitude of the sine of the angle between the lines.
    """
    x1, y1, share1, bias1 = _block_arm(o, t, a)
    x2, y2, share2, bias2 = _block_arm(p, r, b)
    ex, ey = p.x + x2 - o.x - x1, p.y + y2 - o.y - y1
    sine = t.c * r.s - t.s * r.c
    z1, z2 = (ex * r.s - ey * r.c) / sine, (ex * t.s - ey * t.c) / sine
    columns1, columns2 = [], []
    for g, h, w1, w2 in zip(share1, share2, t.columns, r.columns):
        fx = h[0] - z2 * r.s * w2 - g[0] + z1 * t.s * w1
        fy = h[1] + z2 * r.c * w2 - g[1] - z1 * t.c * w1
        columns1.append((fx * r.s - fy * r.c) / sine)
        columns2.append((fx * t.s - fy * t.c) / sine)
    v1, v2 = _dot(tuple(columns1), v), _dot(tuple(columns2), v)
    lx, ly = _line_bias(t, z1, v1)
    mx, my = _line_bias(r, z2, v2)
    fx, fy = bias2[0] + mx - bias1[0] - lx, bias2[1] + my - bias1[1] - ly
    return (
        _sliding_arm(z1, v1, columns1, (fx * r.s - fy * r.c) / sine),
        _sliding_arm(z2, v2, columns2, (fx * t.s - fy * t.c) / sine),
        fabs(sine),
    )


def _line_bias(t: Turn, z: float, vz: float) -> tuple[float, float]:
    """Return the bias of an arm of length z, with rate vz, along a rotating line, without the bias of the length."""
    beta, ww, w2 = z * t.columns[-1], z * t.w * t.w, 2.0 * t.w * vz
    return -t.s * (beta + w2) - t.c * ww, t.c * (beta + w2) - t.s * ww


def _sliding_arm(z: float, rate: float, share: list[float], bias: float) -> Vector:
    """Return an arm of length z along x, from the rate, the derivatives and the bias acceleration of z.

    ``rate`` is dz/dt, ``share`` the derivatives of z with respect to the coordinates, ``bias`` the bias acceleration of z.
    """
    return Vector(z, 0.0, rate, 0.0, (*((g, 0.0) for g in share), (bias, 0.0)))


def pin_slide_pin(p: Vector, q: Vector, a: Vector, b: Vector, branch: float, v: Rates) -> tuple[Turn, Vector, float]:
    """Solve the dyad RPR: body 1, which has a line, is pinned at p; body 2, a block on this line, is pinned at q.

    ``a`` is the pin p from the line's origin, in the axes of the line; ``b`` is the pin q in the block's axes, which are
    parallel. ``branch`` is the sign of the component of q - p along the line. Returns the direction of the line, the position
    of the block as an arm along the line, and the sine of the angle between the line and the normal of q - p.
    """
    dx, dy = q.x - p.x, q.y - p.y
    lever = subtract_vectors(b, a)
    dd, h = dx * dx + dy * dy, lever.y
    root = branch * sqrt(dd - h * h)
    c, s = (dx * root + dy * h) / dd, (dy * root - dx * h) / dd
    # t z' + J d w = e in every column; J d . n = d . t = root
    start = zip(p.columns, q.columns, _shares(c, s, lever))
    rows = [(k[0] - g[0] - f[0], k[1] - g[1] - f[1]) for g, k, f in start]
    share = [(c * ey - s * ex) / root for ex, ey in rows]
    gz = [c * ex + s * ey + h * w for w, (ex, ey) in zip(share, rows)]
    w, vz = _dot(tuple(share), v), _dot(tuple(gz), v)
    # the arm from p to q in the axes of the line grows by z
    ux, uy = c * lever.vx - s * lever.vy, s * lever.vx + c * lever.vy
    bx, by = lever.columns[-1]
    ex = q.columns[-1][0] - p.columns[-1][0] - c * bx + s * by + 2.0 * w * uy + w * w * dx + 2.0 * w * vz * s
    ey = q.columns[-1][1] - p.columns[-1][1] - s * bx - c * by - 2.0 * w * ux + w * w * dy - 2.0 * w * vz * c
    beta = (c * ey - s * ex) / root
    return (
        Turn(c, s, w, (*share, beta)),
        _sliding_arm(root - lever.x, vz, gz, c * ex + s * ey + h * beta),
        branch * root / sqrt(dd),
    )


def pin_slide_slide(
    p: Vector, o: Vector, t: Turn, r: Turn, a: Vector, b: Vector, v: Rates
) -> tuple[Vector, Vector, float]:
    """Solve the dyad RPP: body 2 slides on the line through o along t; body 1 is pinned at p, and a slide joins it to body 2.

    ``r`` is the direction of this slide. ``a`` is the pin p from the slide's end on body 1, in the axes of r; ``b`` is the
    slide's end on body 2 from the origin of body 2, in the axes of t. Returns the position of body 2 as an arm along the line;
    the position of body 1 as an arm along the slide, from the slide's end on body 2; and the magnitude of the sine of the angle
    between line and slide.
    """
    x1, y1, share1, bias1 = _block_arm(o, t, b)
    pin = rotate_arm(r, a)
    ex, ey = p.x - pin.x - o.x - x1, p.y - pin.y - o.y - y1
    sine = t.c * r.s - t.s * r.c
    z, u = (ex * r.s - ey * r.c) / sine, (t.c * ey - t.s * ex) / sine
    gz, gu = [], []
    for g, h, k, w1, w2 in zip(p.columns, pin.columns, share1, t.columns, r.columns):
        fx = g[0] - h[0] - k[0] + z * t.s * w1 + u * r.s * w2
        fy = g[1] - h[1] - k[1] - z * t.c * w1 - u * r.c * w2
        gz.append((fx * r.s - fy * r.c) / sine)
        gu.append((t.c * fy - t.s * fx) / sine)
    vz, vu = _dot(tuple(gz), v), _dot(tuple(gu), v)
    lx, ly = _line_bias(t, z, vz)
    mx, my = _line_bias(r, u, vu)
    fx = p.columns[-1][0] - pin.columns[-1][0] - bias1[0] - lx - mx
    fy = p.columns[-1][1] - pin.columns[-1][1] - bias1[1] - ly - my
    return (
        _sliding_arm(z, vz, gz, (fx * r.s - fy * r.c) / sine),
        _sliding_arm(u, vu, gu, (t.c * fy - t.s * fx) / sine),
        fabs(sine),
    )


# Equations of motion


def mass_matrix(masses: tuple[Mass, ...], n: int) -> Matrix:
    """Compute the mass matrix of the equations of motion in the n degrees of freedom."""
    return tuple(
        tuple(
            sum(
                m.mass * (g[i][0] * g[j][0] + g[i][1] * g[j][1]) + m.inertia * h[i] * h[j]
                for m, g, h in ((m, m.centre.columns, m.frame.turn.columns) for m in masses)
            )
            for j in range(n)
        )
        for i in range(n)
    )


def generalised_forces(masses: tuple[Mass, ...], wrenches: tuple[Wrench, ...], n: int) -> tuple[float, ...]:
    """Compute the generalised forces of the ``wrenches`` on the bodies, and of the inertia forces of the bias accelerations."""
    total = [0.0] * n
    for m, f in zip(masses, wrenches):
        origin, h = m.frame.origin, m.frame.turn.columns
        bx, by = m.mass * m.centre.columns[n][0], m.mass * m.centre.columns[n][1]
        x, y = f.x - bx, f.y - by
        moment = f.moment - m.inertia * h[n] - m.centre.x * by + m.centre.y * bx
        # moment about the body's own origin
        moment = moment - origin.x * y + origin.y * x
        for i in range(n):
            total[i] = total[i] + x * origin.columns[i][0] + y * origin.columns[i][1] + moment * h[i]
    return tuple(total)


def accelerations(matrix: Matrix, forces: Rates, held: Rates, given: Rates) -> tuple[float, ...]:
    """Solve the equations of motion for the accelerations of the degrees of freedom.

    ``held`` has 1 for each degree of freedom whose acceleration is prescribed, 0 for all others; ``given`` has the prescribed
    accelerations.
    """
    n = range(len(forces))
    free = [1.0 - h for h in held]
    rows = tuple(tuple(free[i] * free[j] * matrix[i][j] + (held[i] if i == j else 0.0) for j in n) for i in n)
    right = tuple(
        free[i] * (forces[i] - sum(matrix[i][j] * held[j] * given[j] for j in n)) + held[i] * given[i] for i in n
    )
    return solve_linear(rows, right)


def multiply(matrix: Matrix, values: Rates) -> tuple[float, ...]:
    """Return the product of a matrix and a column vector."""
    return tuple(sum(a * b for a, b in zip(row, values)) for row in matrix)


class Rubbing(NamedTuple):
    """Friction in one joint for a joint force of 1 N: wrenches on all bodies, and power lost (W)."""

    wrenches: tuple[Wrench, ...]
    lost: float


def remove_bias(m: Mass) -> Mass:
    """Return a body with zero bias acceleration, for computing changes of the joint forces."""
    centre = m.centre._replace(columns=(*m.centre.columns[:-1], (0.0, 0.0)))
    turn = m.frame.turn._replace(columns=(*m.frame.turn.columns[:-1], 0.0))
    return m._replace(centre=centre, frame=m.frame._replace(turn=turn))


def add_friction(wrenches: tuple[Wrench, ...], units: tuple[Rubbing, ...], sizes: Rates) -> tuple[Wrench, ...]:
    """Return the wrenches on the bodies with joint friction added.

    ``units`` has the friction in each joint for a joint force of 1 N, ``sizes`` the magnitude of each joint force (N).
    """
    return tuple(
        add_wrenches(f, *(Wrench(size * g.x, size * g.y, size * g.moment) for size, g in zip(sizes, on)))
        for f, *on in zip(wrenches, *(unit.wrenches for unit in units))
    )


def kinetic_energy(masses: tuple[Mass, ...]) -> float:
    """Compute the kinetic energy (J)."""
    return 0.5 * sum(
        m.mass * (m.centre.vx * m.centre.vx + m.centre.vy * m.centre.vy) + m.inertia * m.frame.turn.w * m.frame.turn.w
        for m in masses
    )


# Forces on bodies


def force_wrench(x: float, y: float, at: Vector) -> Wrench:
    """Return the wrench of a force (x, y) at the point ``at``."""
    return Wrench(x, y, at.x * y - at.y * x)


def to_ground_axes(t: Turn, x: float, y: float) -> tuple[float, float]:
    """Return the components of a force in the ground's axes from those in the axes of a body of direction ``t``."""
    return t.c * x - t.s * y, t.s * x + t.c * y


def torque_wrench(moment: float) -> Wrench:
    """Return the wrench of a torque."""
    return Wrench(0.0, 0.0, moment)


def add_wrenches(*wrenches: Wrench) -> Wrench:
    """Add wrenches on one body."""
    return Wrench(sum(f.x for f in wrenches), sum(f.y for f in wrenches), sum(f.moment for f in wrenches))


def subtract_wrenches(f: Wrench, g: Wrench) -> Wrench:
    """Return the difference f - g of two wrenches on one body."""
    return Wrench(f.x - g.x, f.y - g.y, f.moment - g.moment)


def required_wrench(m: Mass, accelerations: Rates, applied: Wrench) -> Wrench:
    """Return the wrench that the joints of a body must exert on it: mass times acceleration minus the wrench ``applied``."""
    q = (*accelerations, 1.0)
    x = m.mass * sum(g[0] * a for g, a in zip(m.centre.columns, q))
    y = m.mass * sum(g[1] * a for g, a in zip(m.centre.columns, q))
    moment = m.inertia * sum(g * a for g, a in zip(m.frame.turn.columns, q))
    return subtract_wrenches(Wrench(x, y, moment + m.centre.x * y - m.centre.y * x), applied)


def wrench_moment(f: Wrench, at: Vector) -> float:
    """Return the moment of a wrench about the point ``at``."""
    return f.moment - at.x * f.y + at.y * f.x


def _wrench_from_moment(at: Vector, x: float, y: float, moment: float) -> Wrench:
    """Return the wrench of a force (x, y) whose moment about the point ``at`` is ``moment``."""
    return Wrench(x, y, moment + at.x * y - at.y * x)


def pin_between_pins(p: Vector, c: Vector, q: Vector, on1: Wrench, on2: Wrench) -> Wrench:
    """Return the force of body 2 on body 1 of a dyad RRR in the pin at c; body 1 is pinned at p, body 2 at q.

    ``on1`` and ``on2`` are, here and in the functions below, the wrenches that the joints must exert on bodies 1 and 2.
    """
    ux, uy, wx, wy = c.x - p.x, c.y - p.y, c.x - q.x, c.y - q.y
    # u x F = m1, w x F = -m2
    m1, m2, cross = wrench_moment(on1, p), wrench_moment(on2, q), ux * wy - uy * wx
    return force_wrench((m2 * ux + m1 * wx) / cross, (m2 * uy + m1 * wy) / cross, c)


def pin_to_block(p: Vector, c: Vector, t: Turn, on1: Wrench, on2: Wrench) -> Wrench:
    """Return the force of the block on body 1 of a dyad RRP in the pin at c.

    Body 1 is pinned at p; the block slides along t. For ``on1`` and ``on2`` see `pin_between_pins`.
    """
    ux, uy = c.x - p.x, c.y - p.y
    # u x F = m1; -F . t = along
    m1, along = wrench_moment(on1, p), on2.x * t.c + on2.y * t.s
    across = (m1 + along * (ux * t.s - uy * t.c)) / (ux * t.c + uy * t.s)
    return force_wrench(-along * t.c - across * t.s, -along * t.s + across * t.c, c)


def pin_of_blocks(c: Vector, t: Turn, r: Turn, on1: Wrench, on2: Wrench) -> Wrench:
    """Return the force of block 2 on block 1 of a dyad PRP in the pin at c; block 1 slides along t, block 2 along r."""
    # F . t = f1, F . r = -f2
    f1, f2, sine = on1.x * t.c + on1.y * t.s, on2.x * r.c + on2.y * r.s, t.c * r.s - t.s * r.c
    return force_wrench((f1 * r.s + f2 * t.s) / sine, -(f1 * r.c + f2 * t.c) / sine, c)


def slide_between_pins(p: Vector, q: Vector, t: Turn, on1: Wrench, on2: Wrench) -> Wrench:
    """Return the force of body 2 on body 1 of a dyad RPR in the slide along t; body 1 is pinned at p, body 2 at q."""
    m1, m2 = wrench_moment(on1, p), wrench_moment(on2, q)
    # the force normal to the slide: its moments about p and q differ by (q - p) . t times the force
    across = (m1 + m2) / ((q.x - p.x) * t.c + (q.y - p.y) * t.s)
    return _wrench_from_moment(p, -across * t.s, across * t.c, m1)


def slide_to_block(p: Vector, t: Turn, r: Turn, on1: Wrench, on2: Wrench) -> Wrench:
    """Return the force of body 2 on body 1 of a dyad RPP in the slide along r between them.

    Body 1 is pinned at p; body 2 slides along t.
    """
    m1, f2 = wrench_moment(on1, p), on2.x * t.c + on2.y * t.s
    across = -f2 / (t.s * r.c - t.c * r.s)
    return _wrench_from_moment(p, -across * r.s, across * r.c, m1)


def force_from_mate(pin: Vector, other: Vector, ratio: float, on: Wrench) -> Wrench:
    """Return the tooth force on a gear from its mate, along their common tangent.

    The gear is pinned at ``pin``, its mate at ``other``. ``ratio`` is the speed of the gear divided by that of the mate, both
    relative to the line of centres; ``on`` is the wrench that the gear needs from its pin and teeth.
    """
    moment = wrench_moment(on, pin)
    dx, dy = pin.x - other.x, pin.y - other.y
    share = (ratio - 1.0) * moment / (dx * dx + dy * dy)
    return _wrench_from_moment(pin, -share * dy, share * dx, moment)


def force_on_rack(pin: Vector, t: Turn, radius: float, on: Wrench) -> Wrench:
    """Return the force that a gear exerts on its rack at the pitch point, along the direction t of the rack.

    The gear is pinned at ``pin``; ``on`` is the wrench that the rack needs from its slide and teeth. The pitch point lies
    ``radius`` from the pin, to the right if one looks along t, to the left if ``radius`` is negative.
    """
    return _tooth_force(pin, t, radius, on.x * t.c + on.y * t.s)


def force_on_gear(pin: Vector, t: Turn, radius: float, on: Wrench) -> Wrench:
    """Return the force that a rack exerts on its gear at the pitch point, along the direction t of the rack.

    The arguments are those of `force_on_rack`, but ``on`` is the wrench that the gear needs from its pin and teeth.
    """
    return _tooth_force(pin, t, radius, wrench_moment(on, pin) / radius)


def _tooth_force(pin: Vector, t: Turn, radius: float, pull: float) -> Wrench:
    """Return the wrench of a force ``pull`` (N) along t at the pitch point."""
    x, y = pull * t.c, pull * t.s
    return Wrench(x, y, (pin.x + radius * t.s) * y - (pin.y - radius * t.c) * x)


# Measures


def turn_angle(t: Turn) -> float:
    """Return the angle of a direction, in (-pi, pi]."""
    return atan2(t.s, t.c)


def turn_difference(t: Turn, r: Turn, c: float, s: float) -> float:
    """Return the angle from t to r minus the angle with cosine c and sine s, in (-pi, pi]."""
    x, y = t.c * r.c + t.s * r.s, t.c * r.s - t.s * r.c
    return atan2(y * c - x * s, x * c + y * s)


def transmission(p: Vector, c: Vector, q: Vector) -> float:
    """Return the angle at c between the directions to p and q, in [0, pi]."""
    ux, uy, wx, wy = c.x - p.x, c.y - p.y, c.x - q.x, c.y - q.y
    return atan2(fabs(ux * wy - uy * wx), ux * wx + uy * wy)


def transmission_to_normal(p: Vector, q: Vector, t: Turn) -> float:
    """Return the angle between the direction from p to q and the normal of a line of direction t, in [0, pi]."""
    ux, uy = q.x - p.x, q.y - p.y
    return atan2(fabs(ux * t.c + uy * t.s), uy * t.c - ux * t.s)


def transmission_between_lines(t: Turn, r: Turn) -> float:
    """Return the angle between two lines of directions t and r, in [0, pi]."""
    return atan2(fabs(t.c * r.s - t.s * r.c), t.c * r.c + t.s * r.s)


def block_position(f: Frame, x: float, y: float, t: Turn, block: Frame) -> tuple[float, float]:
    """Return position and velocity of a block's origin along a line of direction t of body f, from the point (x, y) of f."""
    start = point(f, x, y)
    dx, dy = block.origin.x - start.x, block.origin.y - start.y
    vx, vy = block.origin.vx - start.vx, block.origin.vy - start.vy
    return t.c * dx + t.s * dy, t.c * (vx + t.w * dy) + t.s * (vy - t.w * dx)


def distance(a: Vector, b: Vector) -> tuple[float, float, float, float]:
    """Return the distance between two points, its rate, and the components x and y of the unit vector from a to b."""
    dx, dy = b.x - a.x, b.y - a.y
    length = sqrt(dx * dx + dy * dy)
    cx, cy = dx / length, dy / length
    return length, cx * (b.vx - a.vx) + cy * (b.vy - a.vy), cx, cy


UNJOINED = UnjoinedMessages(
    "the bodies cannot be joined", "they do not reach each other", "the bodies of a dyad are in line to {:.3f} deg"
)


def check_clearance(places: Callable[..., Any], x: Sequence[float], p: Any, where: Callable[[], str]) -> None:
    """Check that the bodies can be joined in state x; ``where()`` describes x in words.

    ``places(x, p)`` computes the poses of the bodies, and their ``clearance``.

    Raises
    ------
    AssemblyError
        If the bodies cannot be joined, or the clearance is less than `limits.LIMIT_SINE`.
    """
    try:
        clearance = places(tuple(x), p).clearance
    except (ValueError, ArithmeticError):
        clearance = -1.0
    UNJOINED.check(clearance, x, p, where)
