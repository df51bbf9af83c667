"""Compiled functions for two closed curves: the area between them and its gradient, and the nearest points of a curve.

The boundary of the area consists of pieces of both curves, cut where they cross one another or themselves. By Green's theorem
the area is half the sum of x dy - y dx over the pieces, with a sign for the side on which the area lies. If a curve moves, the
area changes by the area that the pieces sweep: the gradient is exact for polygons, and continuous, since a new piece begins
with length zero.
"""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, int64, void

from .codegen import MATRIX, VECTOR, inner, kernel, part

#: Segments coincide up to this sine of the angle between them and this distance, as a fraction of the extent of the curves.
PARALLEL = 1e-12
#: Number of horizontal bands into which segments are sorted: a segment is compared with those in its own bands only.
BANDS = 96
#: Number of successive segments of a polyline in a group; a group is skipped if none of its segments can be the nearest.
STRETCH = 12


@part
def _segments(curve, target):
    """Return the ends of all segments of two closed polygons, rows xa, ya, xb, yb, and their ranges of x and y."""
    n, m = curve.shape[1], target.shape[1]
    ends, box = np.empty((4, n + m)), np.empty((4, n + m))
    for i in range(n + m):
        for axis in range(2):
            if i < n:
                ends[axis, i], ends[2 + axis, i] = curve[axis, i], curve[axis, (i + 1) % n]
            else:
                ends[axis, i], ends[2 + axis, i] = target[axis, i - n], target[axis, (i - n + 1) % m]
            box[2 * axis, i] = min(ends[axis, i], ends[2 + axis, i])
            box[2 * axis + 1, i] = max(ends[axis, i], ends[2 + axis, i])
    return ends, box


@part
def _sort_into_bands(box, floor, scale):
    """Sort segments into horizontal bands; return the first and the last band of each segment, and the segments of each band.

    ``box`` has the ranges of x and y of the segments, ``floor`` is the lowest y, ``scale`` the number of bands per unit of y.
    The segments of band b are ``members[begin[b] : begin[b + 1]]``; the return value is (first, last, begin, members).
    """
    total = box.shape[1]
    first, last = np.empty(total, np.int64), np.empty(total, np.int64)
    begin = np.zeros(BANDS + 1, np.int64)
    for i in range(total):
        first[i] = min(int(scale * (box[2, i] - floor)), BANDS - 1)
        last[i] = min(int(scale * (box[3, i] - floor)), BANDS - 1)
        # for a sum of slices Numba would also compile its messages about shapes
        for band in range(first[i], last[i] + 1):
            begin[band + 1] += 1
    for band in range(BANDS):
        begin[band + 1] += begin[band]
    members, filled = np.empty(begin[BANDS], np.int64), begin[:BANDS].copy()
    for i in range(total):
        for band in range(first[i], last[i] + 1):
            members[filled[band]] = i
            filled[band] += 1
    return first, last, begin, members


@inner
def _cut(i, ends, box, bands, near, cuts, twins, spans):
    """Find where other segments cross segment i, and which segments coincide with part of it.

    Fills ``cuts`` with the crossings, fractions of the segment from 0 to 1, ``twins`` with the coinciding segments and
    ``spans`` with the fractions between which they coincide; ``near`` is the distance up to which parallel segments coincide.
    Returns the numbers of pieces and of coinciding segments.
    """
    first, last, begin, members = bands
    dx, dy = ends[2, i] - ends[0, i], ends[3, i] - ends[1, i]
    size, square = abs(dx) + abs(dy), dx * dx + dy * dy
    low_x, high_x, low_y, high_y = box[0], box[1], box[2], box[3]
    left, right, low, high = low_x[i], high_x[i], low_y[i], high_y[i]
    cuts[0] = 0.0
    count, like = 1, 0
    for band in range(first[i], last[i] + 1):
        for k in members[begin[band] : begin[band + 1]]:
            # compare two segments once, in the first band that both are in
            apart = (high_x[k] < left) | (low_x[k] > right) | (high_y[k] < low) | (low_y[k] > high)
            if apart or k == i or band != max(first[i], first[k]):
                continue
            ex, ey = ends[2, k] - ends[0, k], ends[3, k] - ends[1, k]
            if ex == 0.0 and ey == 0.0:  # a point, which bounds nothing
                continue
            cross = dx * ey - dy * ex
            wx, wy = ends[0, k] - ends[0, i], ends[1, k] - ends[1, i]
            if abs(cross) <= PARALLEL * size * (abs(ex) + abs(ey)):
                if square > 0.0 and abs(wx * dy - wy * dx) <= near * size:
                    own = (wx * dx + wy * dy) / square
                    other = own + (ex * dx + ey * dy) / square
                    spans[0, like], spans[1, like], twins[like] = min(own, other), max(own, other), k
                    like += 1
                    for place in (own, other):
                        if 0.0 < place < 1.0:
                            cuts[count] = place
                            count += 1
                continue
            own, other = (wx * ey - wy * ex) / cross, (wx * dy - wy * dx) / cross
            if 0.0 < own < 1.0 and 0.0 <= other <= 1.0:
                cuts[count] = own
                count += 1
    cuts[count] = 1.0
    return count, like


@kernel(float64(MATRIX, MATRIX, MATRIX), purpose="the curves of linkages")
def symmetric_difference(curve, target, gradient):
    """Return the area between two closed polygons by the even-odd rule; compute its gradient with respect to the vertices.

    ``curve`` and ``target`` have the rows x, y, shape (2, n) and (2, m); ``gradient`` receives the derivatives of
    the area with respect to the vertices of ``curve``, shape (2, n).
    """
    n = curve.shape[1]
    ends, box = _segments(curve, target)
    xa, ya, xb, yb = ends[0], ends[1], ends[2], ends[3]
    gradient[:] = 0.0
    floor, height = box[2].min(), box[3].max() - box[2].min()
    if not np.isfinite(height):
        return np.nan
    scale, near = BANDS / max(height, 1e-300), PARALLEL * (height + box[1].max() - box[0].min())
    bands = _sort_into_bands(box, floor, scale)
    _, _, begin, members = bands
    area = 0.0
    # each other segment cuts a segment twice at most
    total = ends.shape[1]
    cuts, twins, spans = np.empty(2 * total + 2), np.empty(total, np.int64), np.empty((2, total))
    # number of the last piece with which each segment coincides
    covered, number = np.full(total, -1), 0
    for i in range(total):
        count, like = _cut(i, ends, box, bands, near, cuts, twins, spans)
        cuts[: count + 1].sort()
        xi, yi = xa[i], ya[i]
        dx, dy = xb[i] - xi, yb[i] - yi
        for piece in range(count):
            a, b = cuts[piece], cuts[piece + 1]
            if b <= a:
                continue
            middle = 0.5 * (a + b)
            number += 1
            shared = 1
            for t in range(like):
                if spans[0, t] < middle < spans[1, t]:
                    covered[twins[t]] = number
                    shared += 1
            if shared % 2 == 0:
                # an even number of coinciding segments bounds no area
                continue
            # even-odd rule for a point just left of the middle of this piece, with a ray to the right
            x, y = xi + middle * dx, yi + middle * dy
            # the left of a horizontal segment is above or below it
            odd = (dy > 0.0) or (dy == 0.0 and dx < 0.0)
            band = min(max(int(scale * (y - floor)), 0), BANDS - 1)
            for k in members[begin[band] : begin[band + 1]]:
                spanned = k != i and (ya[k] > y) != (yb[k] > y)
                if spanned and xa[k] + (y - ya[k]) * (xb[k] - xa[k]) / (yb[k] - ya[k]) > x and covered[k] != number:
                    odd = not odd
            side = (1.0 if odd else -1.0) / shared
            x0, y0 = xi + a * dx, yi + a * dy
            area += 0.5 * side * (b - a) * (x0 * dy - y0 * dx)
            if i < n:
                # shares of the swept area due to the two ends of the segment
                late = 0.5 * (b * b - a * a)
                early = (b - a) - late
                j = (i + 1) % n
                gradient[0, i] += side * early * dy
                gradient[1, i] -= side * early * dx
                gradient[0, j] += side * late * dy
                gradient[1, j] -= side * late * dx
    return area


@kernel(void(MATRIX, MATRIX, boolean, VECTOR, int64[::1], VECTOR), purpose="the curves of linkages")
def find_nearest(points, line, closed, distance, segment, share):
    """Find the nearest point of a polyline to each point; write its distance, segment index and fraction of the segment.

    ``points`` and ``line`` have the rows x, y, shape (2, k) and (2, m); a closed line goes on from its last point to its first.
    The results have shape (k,).
    """
    m = line.shape[1]
    count = m if closed else m - 1
    # boxes around groups of segments: a group is skipped if its box is farther off than the nearest segment so far
    stretches = -(-count // STRETCH)
    box = np.empty((stretches, 4))
    for b in range(stretches):
        low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
        for k in range(b * STRETCH, min((b + 1) * STRETCH, count) + 1):
            low_x, high_x = min(low_x, line[0, k % m]), max(high_x, line[0, k % m])
            low_y, high_y = min(low_y, line[1, k % m]), max(high_y, line[1, k % m])
        box[b, 0], box[b, 1], box[b, 2], box[b, 3] = low_x, low_y, high_x, high_y
    begin = 0
    for i in range(points.shape[1]):
        x, y = points[0, i], points[1, i]
        least = np.inf
        segment[i], share[i] = 0, 0.0
        # begin with the group that was nearest to the last point
        for turn in range(stretches):
            b = (begin + turn) % stretches
            ex, ey = max(box[b, 0] - x, x - box[b, 2], 0.0), max(box[b, 1] - y, y - box[b, 3], 0.0)
            if ex * ex + ey * ey >= least:
                continue
            for k in range(b * STRETCH, min((b + 1) * STRETCH, count)):
                j = (k + 1) % m
                dx, dy = line[0, j] - line[0, k], line[1, j] - line[1, k]
                wx, wy = x - line[0, k], y - line[1, k]
                length = dx * dx + dy * dy
                t = min(1.0, max(0.0, (wx * dx + wy * dy) / length)) if length > 0.0 else 0.0
                ex, ey = wx - t * dx, wy - t * dy
                square = ex * ex + ey * ey
                if square < least:
                    least = square
                    segment[i], share[i] = k, t
        distance[i] = np.sqrt(least)
        begin = segment[i] // STRETCH
