"""Compiled: the area between two curves and how the curve changes it; the nearest places of one curve to points of another.

`targets.even_odd_area` is the measure; this is the same number as a function to descend by, a thousand times a second. The
boundary of the area is made of pieces of both curves, cut where they cross one another or themselves, and by Green's theorem
the area is half the sum of x dy - y dx over them, each with the sign of its side. A curve that moves changes the area by what
it sweeps: the gradient is exact for the polygons, and continuous, since where a piece begins to count it has no length yet.
"""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, int64, void

from ..numerics.codegen import MATRIX, VECTOR, kernel

#: Most crossings of one segment that are looked at.
CROSSINGS = 64
#: Horizontal bands by which segments are found: a segment is compared with those in its own bands alone.
BANDS = 96
#: Segments of a polyline that are passed over together where none of them can be the nearest.
STRETCH = 12


@kernel(float64(MATRIX, MATRIX, MATRIX), purpose="the curves of linkages")
def symmetric_difference(curve, target, gradient):
    """Area between two closed polygons by the even-odd rule; its gradient with respect to the curve's vertices.

    ``curve`` and ``target`` have the rows x, y, shape (2, n) and (2, m); ``gradient`` takes the derivatives, shape (2, n).
    """
    n, m = curve.shape[1], target.shape[1]
    total = n + m
    xa, ya, xb, yb = np.empty(total), np.empty(total), np.empty(total), np.empty(total)
    for i in range(n):
        j = (i + 1) % n
        xa[i], ya[i], xb[i], yb[i] = curve[0, i], curve[1, i], curve[0, j], curve[1, j]
    for i in range(m):
        j = (i + 1) % m
        xa[n + i], ya[n + i], xb[n + i], yb[n + i] = target[0, i], target[1, i], target[0, j], target[1, j]
    low_x, high_x = np.minimum(xa, xb), np.maximum(xa, xb)
    low_y, high_y = np.minimum(ya, yb), np.maximum(ya, yb)
    gradient[:] = 0.0
    floor, height = low_y.min(), high_y.max() - low_y.min()
    if not np.isfinite(height):
        return np.nan
    # the segments of each band, one band after the other
    scale = BANDS / max(height, 1e-300)
    first, last = np.empty(total, np.int64), np.empty(total, np.int64)
    begin = np.zeros(BANDS + 1, np.int64)
    for i in range(total):
        first[i] = min(int(scale * (low_y[i] - floor)), BANDS - 1)
        last[i] = min(int(scale * (high_y[i] - floor)), BANDS - 1)
        begin[first[i] + 1 : last[i] + 2] += 1
    begin = np.cumsum(begin)
    members, filled = np.empty(begin[BANDS], np.int64), begin[:BANDS].copy()
    for i in range(total):
        for band in range(first[i], last[i] + 1):
            members[filled[band]] = i
            filled[band] += 1
    area = 0.0
    cuts = np.empty(CROSSINGS + 2)
    for i in range(total):
        dx, dy = xb[i] - xa[i], yb[i] - ya[i]
        left, right, low, high = low_x[i], high_x[i], low_y[i], high_y[i]
        cuts[0] = 0.0
        count = 1
        for band in range(first[i], last[i] + 1):
            for k in members[begin[band] : begin[band + 1]]:
                # once, in the first band that both are in
                apart = (high_x[k] < left) | (low_x[k] > right) | (high_y[k] < low) | (low_y[k] > high)
                if apart or k == i or band != max(first[i], first[k]):
                    continue
                ex, ey = xb[k] - xa[k], yb[k] - ya[k]
                cross = dx * ey - dy * ex
                if cross == 0.0:
                    continue
                wx, wy = xa[k] - xa[i], ya[k] - ya[i]
                own, other = (wx * ey - wy * ex) / cross, (wx * dy - wy * dx) / cross
                if 0.0 < own < 1.0 and 0.0 <= other <= 1.0 and count <= CROSSINGS:
                    cuts[count] = own
                    count += 1
        cuts[count] = 1.0
        cuts[: count + 1].sort()
        for piece in range(count):
            a, b = cuts[piece], cuts[piece + 1]
            if b <= a:
                continue
            # left of the middle of this piece: the ray from there to the right counts what is gone round
            middle = 0.5 * (a + b)
            x, y = xa[i] + middle * dx, ya[i] + middle * dy
            # a horizontal segment has its left above or below, any other to one side
            odd = (dy > 0.0) or (dy == 0.0 and dx < 0.0)
            band = min(max(int(scale * (y - floor)), 0), BANDS - 1)
            for k in members[begin[band] : begin[band + 1]]:
                spans = k != i and (ya[k] > y) != (yb[k] > y)
                if spans and xa[k] + (y - ya[k]) * (xb[k] - xa[k]) / (yb[k] - ya[k]) > x:
                    odd = not odd
            side = 1.0 if odd else -1.0
            x0, y0 = xa[i] + a * dx, ya[i] + a * dy
            area += 0.5 * side * (b - a) * (x0 * dy - y0 * dx)
            if i < n:
                # shares of the piece's sweep that go to the segment's two ends
                late = 0.5 * (b * b - a * a)
                early = (b - a) - late
                j = (i + 1) % n
                gradient[0, i] += side * early * dy
                gradient[1, i] -= side * early * dx
                gradient[0, j] += side * late * dy
                gradient[1, j] -= side * late * dx
    return area


@kernel(void(MATRIX, MATRIX, boolean, VECTOR, int64[::1], VECTOR), purpose="the curves of linkages")
def nearest(points, line, closed, distance, segment, share):
    """The nearest place of a polyline to each point: distance, number of the segment, share of it, shape (k,).

    ``points`` and ``line`` have the rows x, y, shape (2, k) and (2, m); a closed line goes on from its last point to its first.
    """
    m = line.shape[1]
    count = m if closed else m - 1
    # boxes about stretches of the line: one that is farther off than the nearest segment so far is passed over
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
        # first where the point before was nearest
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
