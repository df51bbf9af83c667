"""Model the hydraulic part of a published benchmark: F. Gonzalez, cosim-benchmarks, hydraulic manipulator, section 1.2.

A cylinder has two chambers between pump and tank. A valve opens the ports of both chambers. The speed of the arm is assumed
constant over a sample; the pressures are integrated by Runge and Kutta's method.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from analysis.export.controllers import Controller, Row

#: Table 2: piston area (m2), cylinder length (m), friction (N.s/m), discharge coefficient, density (kg/m3), pressures of pump
#: and tank (Pa), compressibility (1/Pa, 1/Pa2); the greatest area of a valve (m2).
AREA, LENGTH, FRICTION, DISCHARGE, DENSITY, PUMP, TANK = 65e-4, 0.442, 1e5, 0.67, 850.0, 7.6e6, 0.1e6
A, B, VALVE = 6.53e-10, -1.19e-18, 5e-4
#: Equilibrium at the start: length of the actuator (m), pressures of the chambers (Pa), opening of the valve (0 to 1).
START, PRESSURES, OPENING = 0.5, (3170846.2, 4529153.8), 0.45434559
#: Number of integration steps of the pressures in a sample.
STEPS = 4


def opening(t: float) -> float:
    """Return the opening of the valve in manoeuvre M1: steps of -0.01 at 2 s and +0.03 at 6 s, over 1 and 2 ms."""
    down, up = min(max((t - 2.0) / 1e-3, 0.0), 1.0), min(max((t - 6.0) / 2e-3, 0.0), 1.0)
    return OPENING - 0.01 * down + 0.03 * up


def rates(t: float, p: tuple[float, float], s: float, ds: float) -> tuple[float, float]:
    """Return the time derivatives of both pressures (Pa/s), eqs 9 and 10; ``s`` is the actuator's length, ``ds`` its rate."""
    kappa = opening(t)
    inlet, outlet = VALVE * kappa, VALVE * (1.0 - kappa)

    def flow(area: float, difference: float) -> float:
        return area * DISCHARGE * sqrt(max(2.0 * difference / DENSITY, 0.0))

    def bulk(pressure: float) -> float:
        return (1.0 + A * pressure + B * pressure**2) / (A + 2.0 * B * pressure)

    first = AREA * ds + flow(inlet, PUMP - p[0]) - flow(outlet, p[0] - TANK)
    second = -AREA * ds + flow(outlet, PUMP - p[1]) - flow(inlet, p[1] - TANK)
    lengths = 0.5 * LENGTH + START - s, 0.5 * LENGTH + s - START
    return bulk(p[0]) * first / (AREA * lengths[0]), bulk(p[1]) * second / (AREA * lengths[1])


class Hydraulics(Controller):
    """Hydraulic cylinder of a manipulator."""

    rows = (
        Row("angle", "input", "rad", 0.0, "Angle of the boom"),
        Row("speed", "input", "rad/s", 0.0, "Its rate"),
        Row("force", "output", "N", 0.0, "Force that lengthens the actuator"),
        Row("first", "local", "Pa", PRESSURES[0], "Pressure of the first chamber"),
        Row("second", "local", "Pa", PRESSURES[1], "Pressure of the second chamber"),
    )
    first: float
    second: float

    def sample(self, t: float) -> None:
        s = sqrt(1.0 - 0.5 * sqrt(3.0) * cos(self.angle))
        ds = sqrt(3.0) * sin(self.angle) / (4.0 * s) * self.speed
        h, p = self.sample_time / STEPS, (self.first, self.second)
        for n in range(STEPS if self.count > 0 else 0):
            # integrate over the last sample period, with the motion extrapolated backwards from now
            start, place = t - self.sample_time + n * h, s - ds * (self.sample_time - n * h)

            def slope(
                after: float, q: tuple[float, float], start: float = start, place: float = place
            ) -> tuple[float, ...]:
                return rates(start + after, q, place + after * ds, ds)

            k1 = slope(0.0, p)
            k2 = slope(0.5 * h, (p[0] + 0.5 * h * k1[0], p[1] + 0.5 * h * k1[1]))
            k3 = slope(0.5 * h, (p[0] + 0.5 * h * k2[0], p[1] + 0.5 * h * k2[1]))
            k4 = slope(h, (p[0] + h * k3[0], p[1] + h * k3[1]))
            p = tuple(x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d) for x, a, b, c, d in zip(p, k1, k2, k3, k4))  # type: ignore[assignment]
        self.first, self.second = p
        self.force = (p[1] - p[0]) * AREA - FRICTION * ds
