"""Compute coupler curves and their exact derivatives for many crank angles or many linkages: compiled kernels.

The loop of links is closed by `kinematics.close_loop` of the five-bar model. The derivatives with respect to every dimension
follow from loop closure, projected on the rocker and on the coupler as in `kinematics.coefficients`. The kernels loop over
arrays without conditional branches, so that the compiler can vectorise over crank angles. If the links cannot be joined, a
square root is NaN, which the callers check.

A linkage is the vector ``q`` of `PLACES`: the ten parameters in the thesis's order. The arguments ``c, s`` are cosines and
sines of the crank's rotations, which a timed task computes only once. A slider or a second crank may displace the rocker pivot
D by (dx, dy), in the frame of the ground link. A rocker of length zero means a slider-crank: C runs on a guide through the end
of the ground link, perpendicular to this link, and the rocker pivot lies at infinity.
"""

from __future__ import annotations

from math import atan2, cos, sin

import numpy as np
from numba import complex128, float64, int64, void

from linkwork.five_bar import kinematics

from ...numerics.codegen import CUBE, MATRIX, VECTOR, inner, kernel


def close_slider_crank(c2, s2, dx, dy, l3, l4, branch):
    """Close the loop of a slider-crank and return its `kinematics.Position`.

    C is on a guide perpendicular to the ground link, at the distance dx from B. The arguments are those of `close_loop`, and
    may be CasADi symbols. For branch +1, C lies to the left of the perpendicular from B to the guide.
    """
    c3 = dx / l3
    s3 = branch * (1.0 - c3 * c3) ** 0.5
    return kinematics.Position(c2, s2, c3, s3, -1.0, 0.0, -c3, s3)


#: Loop closure of the five-bar model and of a slider-crank, for use in the kernels.
close_loop, _close_slider_crank = inner(kinematics.close_loop), inner(close_slider_crank)


@inner
def close_linkage(c2, s2, dx, dy, l3, l4, branch):
    """Close the loop of a four-bar, or of a slider-crank if the rocker has length zero; return the `kinematics.Position`."""
    if l4 > 0.0:
        return close_loop(c2, s2, dx, dy, l3, l4, branch)
    return _close_slider_crank(c2, s2, dx, dy, l3, l4, branch)


#: Components of the vector q: fields of `analysis.synthesis.Linkage`.
PLACES = (
    "pivot_x",
    "pivot_y",
    "ground_length",
    "crank_length",
    "coupler_length",
    "rocker_length",
    "point_distance",
    "ground_angle",
    "crank_phase",
    "point_angle",
)
#: Order of derivatives: first with respect to q, then with respect to the displacement of D.
COLUMNS = (*PLACES, "dx", "dy")


@kernel(void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, float64, MATRIX), purpose="the curves of linkages")
def coupler_path(c, s, dx, dy, q, branch, out):
    """Compute the coupler point in the plane: out[0] = x, out[1] = y, shape (2, n)."""
    l1, l2, l3, l4 = q[2], q[3], q[4], q[5]
    ct, st = cos(q[8]), sin(q[8])
    ca, sa = cos(q[7]), sin(q[7])
    # l2 and r turned by the ground link's angle
    ax, ay = l2 * ca, l2 * sa
    px, py = q[6] * cos(q[7] + q[9]), q[6] * sin(q[7] + q[9])
    x0, y0 = q[0], q[1]
    x, y = out[0], out[1]
    for j in range(c.shape[0]):
        c2 = ct * c[j] - st * s[j]
        s2 = st * c[j] + ct * s[j]
        g = close_linkage(c2, s2, l1 + dx[j] - l2 * c2, dy[j] - l2 * s2, l3, l4, branch)
        x[j] = x0 + ax * c2 - ay * s2 + px * g.c3 - py * g.s3
        y[j] = y0 + ay * c2 + ax * s2 + py * g.c3 + px * g.s3


@kernel(void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, float64, MATRIX, CUBE), purpose="the curves of linkages")
def coupler_path_jacobian(c, s, dx, dy, q, branch, out, jac):
    """Compute the coupler point as `coupler_path`, and its derivatives with respect to `COLUMNS`.

    jac[k, 0] = dx/d(k), jac[k, 1] = dy/d(k) for k in `COLUMNS`, shape (12, 2, n).
    """
    l1, l2, l3, l4 = q[2], q[3], q[4], q[5]
    ct, st = cos(q[8]), sin(q[8])
    ca, sa = cos(q[7]), sin(q[7])
    ux, uy = cos(q[7] + q[9]), sin(q[7] + q[9])
    r = q[6]
    x0, y0 = q[0], q[1]
    for j in range(c.shape[0]):
        c2 = ct * c[j] - st * s[j]
        s2 = st * c[j] + ct * s[j]
        g = close_linkage(c2, s2, l1 + dx[j] - l2 * c2, dy[j] - l2 * s2, l3, l4, branch)
        # directions of crank and BP in the plane
        ex, ey = ca * c2 - sa * s2, sa * c2 + ca * s2
        fx, fy = ux * g.c3 - uy * g.s3, uy * g.c3 + ux * g.s3
        vx, vy = l2 * ex + r * fx, l2 * ey + r * fy
        # motion of P if the loop must close by 1 m more along the rocker: this turns the coupler by 1/(l3 s43)
        w = 1.0 / (l3 * g.s43)
        tx, ty = -r * fy * w, r * fx * w
        out[0, j] = x0 + vx
        out[1, j] = y0 + vy
        jac[0, 0, j] = 1.0
        jac[0, 1, j] = 0.0
        jac[1, 0, j] = 0.0
        jac[1, 1, j] = 1.0
        jac[2, 0, j] = g.c4 * tx
        jac[2, 1, j] = g.c4 * ty
        along = c2 * g.c4 + s2 * g.s4
        jac[3, 0, j] = ex - along * tx
        jac[3, 1, j] = ey - along * ty
        jac[4, 0, j] = -g.c43 * tx
        jac[4, 1, j] = -g.c43 * ty
        jac[5, 0, j] = tx
        jac[5, 1, j] = ty
        jac[6, 0, j] = fx
        jac[6, 1, j] = fy
        jac[7, 0, j] = -vy
        jac[7, 1, j] = vx
        across = l2 * (s2 * g.c4 - c2 * g.s4)
        jac[8, 0, j] = -l2 * ey + across * tx
        jac[8, 1, j] = l2 * ex + across * ty
        jac[9, 0, j] = -r * fy
        jac[9, 1, j] = r * fx
        jac[10, 0, j] = g.c4 * tx
        jac[10, 1, j] = g.c4 * ty
        jac[11, 0, j] = g.s4 * tx
        jac[11, 1, j] = g.s4 * ty


@kernel(void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, float64, MATRIX), purpose="the curves of linkages")
def link_directions(c, s, dx, dy, q, branch, out):
    """Compute the directions of coupler and rocker: out = c3, s3, c4, s4, c43, s43, shape (6, n)."""
    l1, l2, l3, l4 = q[2], q[3], q[4], q[5]
    ct, st = cos(q[8]), sin(q[8])
    for j in range(c.shape[0]):
        c2 = ct * c[j] - st * s[j]
        s2 = st * c[j] + ct * s[j]
        g = close_linkage(c2, s2, l1 + dx[j] - l2 * c2, dy[j] - l2 * s2, l3, l4, branch)
        out[0, j] = g.c3
        out[1, j] = g.s3
        out[2, j] = g.c4
        out[3, j] = g.s4
        out[4, j] = g.c43
        out[5, j] = g.s43


@kernel(void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, float64, MATRIX, CUBE), purpose="the curves of linkages")
def link_jacobian(c, s, dx, dy, q, branch, out, jac):
    """Compute the angles of coupler and rocker, out = th3, th4 in (-pi, pi], shape (2, n), and their derivatives.

    jac[k, 0] = dth3/d(k), jac[k, 1] = dth4/d(k) for k in `COLUMNS`, shape (12, 2, n). They follow from the derivative of loop
    closure, projected on the rocker to find dth3 and on the coupler to find dth4.
    """
    l1, l2, l3, l4 = q[2], q[3], q[4], q[5]
    ct, st = cos(q[8]), sin(q[8])
    jac[:] = 0.0
    for j in range(c.shape[0]):
        c2 = ct * c[j] - st * s[j]
        s2 = st * c[j] + ct * s[j]
        g = close_linkage(c2, s2, l1 + dx[j] - l2 * c2, dy[j] - l2 * s2, l3, l4, branch)
        out[0, j] = atan2(g.s3, g.c3)
        out[1, j] = atan2(g.s4, g.c4)
        w3 = 1.0 / (l3 * g.s43)
        w4 = 1.0 / (l4 * g.s43)
        jac[2, 0, j] = g.c4 * w3
        jac[2, 1, j] = g.c3 * w4
        jac[3, 0, j] = -(c2 * g.c4 + s2 * g.s4) * w3
        jac[3, 1, j] = -(c2 * g.c3 + s2 * g.s3) * w4
        jac[4, 0, j] = -g.c43 * w3
        jac[4, 1, j] = -w4
        jac[5, 0, j] = w3
        jac[5, 1, j] = g.c43 * w4
        jac[8, 0, j] = l2 * (s2 * g.c4 - c2 * g.s4) * w3
        jac[8, 1, j] = l2 * (s2 * g.c3 - c2 * g.s3) * w4
        jac[10, 0, j] = g.c4 * w3
        jac[10, 1, j] = g.c3 * w4
        jac[11, 0, j] = g.s4 * w3
        jac[11, 1, j] = g.s3 * w4


@kernel(
    void(VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, float64, complex128[:, ::1], complex128[:, ::1]),
    purpose="the curves of linkages",
)
def many_directions(c, s, cg, sg, shapes, branch, coupler, rocker):
    """Compute the directions of coupler and rocker of many linkages at the same crank rotations.

    ``shapes`` has the rows (l1, l2, l3, l4, crank phase, l5, second crank's phase), shape (m, 7); l5 = 0 means no second crank.
    ``c, s`` are cosines and sines of the crank's rotations, ``cg, sg`` cosines and sines of the second crank's rotations. The
    results ``coupler`` and ``rocker`` are complex, shape (m, n), NaN where the links cannot be joined.
    """
    for i in range(shapes.shape[0]):
        l1, l2, l3, l4, l5 = shapes[i, 0], shapes[i, 1], shapes[i, 2], shapes[i, 3], shapes[i, 5]
        ct, st = cos(shapes[i, 4]), sin(shapes[i, 4])
        cp, sp = l5 * cos(shapes[i, 6]), l5 * sin(shapes[i, 6])
        for j in range(c.shape[0]):
            c2 = ct * c[j] - st * s[j]
            s2 = st * c[j] + ct * s[j]
            dx = cp * cg[j] - sp * sg[j]
            dy = sp * cg[j] + cp * sg[j]
            g = close_linkage(c2, s2, l1 + dx - l2 * c2, dy - l2 * s2, l3, l4, branch)
            coupler[i, j] = complex(g.c3, g.s3)
            rocker[i, j] = complex(g.c4, g.s4)


@kernel(void(complex128[:, ::1], complex128[::1], int64[::1], int64[::1], MATRIX), purpose="the curves of linkages")
def match_windows(curves, target, starts, spans, best):
    """Find the piece of each curve that fits an open target best, up to position, rotation and scale.

    Each curve is given at equal steps of the crank over a turn, shape (m, n). A piece begins at one of ``starts`` and is one of
    ``spans`` steps long. Points of the piece at equal steps of arc length are compared with the points of ``target``, shape
    (k,), whose mean is 0, in either direction. ``best`` receives, for each curve, the misfit relative to the target's sum of
    squares, the start, the span, and the direction (1 or -1), shape (m, 4). Pieces with a point that is not finite are skipped.
    """
    m, n = curves.shape
    k = target.shape[0]
    size = 0.0
    for i in range(k):
        size += target[i].real ** 2 + target[i].imag ** 2
    length = np.empty(2 * n + 1)
    piece = np.empty(k, dtype=np.complex128)
    for row in range(m):
        curve = curves[row]
        length[0] = 0.0
        for j in range(2 * n):
            length[j + 1] = length[j] + abs(curve[(j + 1) % n] - curve[j % n])
        best[row, 0] = np.inf
        for start in starts:
            for span in spans:
                total = length[start + span] - length[start]
                if not total > 0.0:
                    continue
                at = start
                mean = 0.0 + 0.0j
                for i in range(k):
                    place = length[start] + total * i / (k - 1)
                    while at + 1 < start + span and length[at + 1] < place:
                        at += 1
                    step = length[at + 1] - length[at]
                    share = min(1.0, max(0.0, (place - length[at]) / step)) if step > 0.0 else 0.0
                    piece[i] = (1.0 - share) * curve[at % n] + share * curve[(at + 1) % n]
                    mean += piece[i]
                mean /= k
                forward = 0.0 + 0.0j
                backward = 0.0 + 0.0j
                energy = 0.0
                for i in range(k):
                    z = piece[i] - mean
                    energy += z.real**2 + z.imag**2
                    forward += z.conjugate() * target[i]
                    backward += z.conjugate() * target[k - 1 - i]
                for direction in (1.0, -1.0):
                    product = forward if direction > 0.0 else backward
                    misfit = 1.0 - (product.real**2 + product.imag**2) / (energy * size)
                    if misfit < best[row, 0]:
                        best[row, 0] = misfit
                        best[row, 1] = start
                        best[row, 2] = span
                        best[row, 3] = direction
