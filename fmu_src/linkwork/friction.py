"""Friction, smoothed near zero speed: viscous and Coulomb friction of a guide, and friction proportional to contact forces."""

from __future__ import annotations

from math import fabs, sqrt, tanh

#: Slider speed (m/s) at which the regularised Coulomb friction F tanh(u'/v0) has reached 76 % of its level.
FRICTION_SPEED = 1e-3
#: Relative angular velocity of the links of a pin (rad/s) at which its friction has reached 76 % of its level.
FRICTION_RATE = 0.1
#: Force F0 that rounds off the magnitude of a contact force F near zero (N): it is taken as sqrt(F^2 + F0^2). For a
#: described linkage of less than 100 g, F0 is 0.1 N per kg of its mass.
FRICTION_FORCE = 1e-2
#: Greatest norm of the response of the contact forces to friction at which a motion is followed: at 1 the links may jam.
MOST_RESPONSE = 0.8
#: Steps of Newton's method for the forces of contacts with friction, before the last step.
SWEEPS = 4

Vector = tuple[float, float]


def lesser(a: float, b: float) -> float:
    """Return the lesser of two numbers."""
    return 0.5 * (a + b - fabs(a - b))


def resistance(v: float, mu: float, fc: float) -> float:
    """Return the force that opposes a motion at speed v (N): damper force mu v plus Coulomb friction of level fc; odd in v."""
    return mu * v + fc * tanh(v / FRICTION_SPEED)


def contact_forces(
    smooth: tuple[Vector, ...], response: tuple[tuple[Vector, ...], ...], rounding: float = FRICTION_FORCE
) -> tuple[float, ...]:
    """Solve for the magnitudes s_j = sqrt(|F_j|^2 + F0^2) of the contact forces (N) with friction proportional to them.

    ``smooth`` are the forces without friction; ``response[k]`` has the change of each force per newton of the k-th magnitude,
    so that F_j = smooth_j + sum_k response[k]_j s_k; ``rounding`` is F0 (N). Newton's method starts at the
    forces without friction.
    """
    least = rounding * rounding
    s = tuple(sqrt(x * x + y * y + least) for x, y in smooth)
    for _ in range(SWEEPS):
        s = _newton_step(smooth, response, s, least)
    return _newton_step(smooth, response, mark_converged(s), least)


def jamming_margin(response: tuple[tuple[Vector, ...], ...]) -> float:
    """Return the margin to jamming by friction, 1 - |response|/MOST_RESPONSE; it is negative beyond the limit.

    ``response`` is the argument of `contact_forces`. If its norm |response| is below 1, the solution for the contact forces is
    unique.
    """
    # the 1e-24, negligible in any other case, gives the root a finite derivative at rest
    return 1.0 - sqrt(1e-24 + sum(x * x + y * y for forces in response for x, y in forces)) / MOST_RESPONSE


def mark_converged(s: tuple[float, ...]) -> tuple[float, ...]:
    """Return ``s`` unchanged; ``s`` is the solution to within rounding.

    The call marks where differentiation may begin: one more step of Newton's method from ``s`` has the derivatives of the
    solution, whatever the derivatives of ``s`` are. Code that differentiates these equations can therefore skip the steps
    before the call.
    """
    return s


def _newton_step(
    smooth: tuple[Vector, ...], response: tuple[tuple[Vector, ...], ...], s: tuple[float, ...], least: float
) -> tuple[float, ...]:
    """Take one step of Newton's method for the magnitudes ``s`` of contact forces; ``least`` is F0^2 of `contact_forces`."""
    n = range(len(smooth))
    forces = tuple(tuple(smooth[j][c] + sum(response[k][j][c] * s[k] for k in n) for c in (0, 1)) for j in n)
    size = tuple(sqrt(x * x + y * y + least) for x, y in forces)
    # from the tangent of sqrt(|F|^2 + F0^2): size_j s_j = F_j . (smooth_j + sum_k response[k]_j s_k) + F0^2
    matrix = tuple(
        tuple(
            (1.0 if j == k else 0.0) - (forces[j][0] * response[k][j][0] + forces[j][1] * response[k][j][1]) / size[j]
            for k in n
        )
        for j in n
    )
    right = tuple((forces[j][0] * smooth[j][0] + forces[j][1] * smooth[j][1] + least) / size[j] for j in n)
    return solve_linear(matrix, right)


def solve_linear(matrix: tuple[tuple[float, ...], ...], right: tuple[float, ...]) -> tuple[float, ...]:
    """Solve linear equations without pivoting; the matrix is diagonally dominant, or symmetric positive definite."""
    if not right:
        return ()
    first, *rows = matrix
    reduced = []
    values = []
    for row, value in zip(rows, right[1:]):
        factor = row[0] / first[0]
        reduced.append(tuple(a - factor * b for a, b in zip(row[1:], first[1:])))
        values.append(value - factor * right[0])
    rest = solve_linear(tuple(reduced), tuple(values))
    return ((right[0] - sum(a * b for a, b in zip(first[1:], rest))) / first[0], *rest)
