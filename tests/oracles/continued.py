"""Find special points of periodic motions with other continuation codes: AUTO-07p, through bifpy, and jaxcont.

Both follow autonomous equations by collocation. The excitation by the crank is therefore an oscillator of its own, c + i s,
that converges to the unit circle; the independent variable is the crank angle. The equations are those of the oracles, and each
branch begins at a motion to which SciPy's integrator has settled: no code of this project takes part.

    python -m tests.oracles.continued

prints what `tests.published.CONTINUED` contains. The codes are installed with the extra ``continuation``.
"""

from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from math import pi
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from analysis.units import RAD_S_PER_RPM
from linkwork.five_bar.dynamics import Inputs
from linkwork.five_bar.published import SETS

from .five_bar import solve

#: Function of a library, which supplies functions such as sin, of (x, v, c, s) and of the parameter's value: the derivatives of
#: x and v with respect to the crank angle.
Rates = Callable[[Any, Sequence[Any], Any], Sequence[Any]]


class Case(NamedTuple):
    """A branch of periodic motions for continuation.

    ``turns`` is the number of crank turns per period. The parameter begins at ``begin`` and is followed towards the farther end
    of the range from ``low`` to ``high``. The first motion is settled from ``start`` over ``settle`` turns; ``mesh`` is the
    number of elements per turn.
    """

    rates: Rates
    turns: int
    begin: float
    low: float
    high: float
    start: tuple[float, float]
    settle: int
    mesh: int

    @property
    def direction(self) -> int:
        """Return the direction from the first parameter towards the farther end of the range, 1 or -1."""
        return 1 if self.high - self.begin > self.begin - self.low else -1

    def full(self, library: Any, u: Sequence[Any], value: Any) -> list[Any]:
        """Return the derivatives of (x, v, c, s) with respect to the crank angle."""
        c, s = u[2], u[3]
        rest = 1.0 - c * c - s * s
        return [*self.rates(library, u, value), c * rest - s, s * rest + c]

    def settled(self) -> Callable[[Any], np.ndarray]:
        """Return the first motion of the branch, as a function of the crank angle from 0 to the end of its period."""

        def right(angle: float, y: np.ndarray) -> Sequence[float]:
            return self.rates(np, (*y, np.cos(angle), np.sin(angle)), self.begin)

        after, end = 2.0 * pi * self.settle, 2.0 * pi * (self.settle + self.turns)
        run = solve_ivp(right, (0.0, end), self.start, "DOP853", dense_output=True, rtol=1e-10, atol=1e-12)

        def motion(angle: Any) -> np.ndarray:
            return np.array([*run.sol(after + angle), np.cos(angle), np.sin(angle)])

        return motion


def duffing(library: Any, u: Sequence[Any], speed: Any) -> Sequence[Any]:
    """Return the derivatives for Duffing's equation x'' + 0.1 x' + x + 0.04 x^3 = cos w t."""
    x, v, c, _ = u
    return v, (c - 0.1 * speed * v - x - 0.04 * x * x * x) / (speed * speed)


def pendulum(library: Any, u: Sequence[Any], strength: Any) -> Sequence[Any]:
    """Return the derivatives for Taylor's driven damped pendulum: w0 = 1.5 w, b = w0 / 4."""
    x, v, c, _ = u
    return v, 2.25 * (strength * c - library.sin(x)) - 0.75 * v


RIG = SETS["rig-1-spring-b"].parameters


def five_bar(library: Any, u: Sequence[Any], speed: Any) -> Sequence[Any]:
    """Return the derivatives for rig 1 with spring B in redundant coordinates with multipliers; u is in crank lengths."""
    x, v, c, s = (float(value) for value in u)
    length = RIG.crank_length
    state = float(np.arctan2(s, c)), length * x, speed, length * speed * v
    return v, float(solve(RIG, state, Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)).accelerations[3]) / (length * speed * speed)


RPM = RAD_S_PER_RPM
CASES: dict[str, Case] = {
    "duffing": Case(duffing, 1, 1.0, 0.9, 1.8, (0.0, 0.0), 60, 20),
    "pendulum": Case(pendulum, 1, 1.064, 1.063, 1.068, (-2.27, 2.0), 200, 40),
    "pendulum, 2 turns": Case(pendulum, 2, 1.078, 1.077, 1.080, (-2.27, 2.0), 200, 40),
    "pendulum, 4 turns": Case(pendulum, 4, 1.0818, 1.0816, 1.0823, (-2.27, 2.0), 400, 40),
    "five-bar, small motion": Case(five_bar, 1, 1020.0 * RPM, 1000.0 * RPM, 1060.0 * RPM, (0.0, 0.0), 60, 30),
    "five-bar, large motion": Case(five_bar, 1, 940.0 * RPM, 928.0 * RPM, 945.0 * RPM, (1.143, -3.238), 60, 30),
    "five-bar, 2 turns": Case(five_bar, 2, 920.0 * RPM, 914.0 * RPM, 925.0 * RPM, (1.592, -3.005), 60, 30),
}


def by_auto(case: Case) -> Iterator[tuple[str, float]]:
    """Yield kind and parameter of every special point of a branch, by AUTO-07p."""
    import math

    from bifpy import auto

    motion, period = case.settled(), 2.0 * pi * case.turns

    def begin(state: Any, parameters: Any, place: float) -> None:
        parameters[0], parameters[auto.PERIOD_INDEX - 1] = case.begin, period
        for n, value in enumerate(motion(period * place)):
            state[n] = float(value)

    settings = {
        **{"ips": auto.IPS_PERIODIC_ORBIT, "ndim": 4, "npar": 1, "nmx": 300, "ntst": case.mesh * case.turns, "ncol": 5},
        **{"iad": 3, "ilp": 1, "isp": 2, "mxbf": 0, "iads": 1, "itmx": 12, "itnw": 7, "nwtn": 3, "jac": 0},
        **{"ds": case.direction * 1e-3, "dsmin": 1e-6, "dsmax": 0.1, "rl0": case.low, "rl1": case.high},
        **{"a0": -1e300, "a1": 1e300, "epsl": 1e-10, "epsu": 1e-10, "epss": 1e-9},
    }
    found = auto.run(lambda u, p: case.full(math, u, p[0]), begin, settings, icu=[1, auto.PERIOD_INDEX])
    for point in found.branches[0].points:
        kind = {"FOLD": "fold", "PERIOD_DOUBLING": "period doubling"}.get(point.point_type.name)
        if kind:
            yield kind, float(point.parameters[0])


def by_jaxcont(case: Case) -> Iterator[tuple[str, float]]:
    """Yield kind and parameter of every special point of a branch, by jaxcont.

    Its period doublings are bisected to an interval of 1e-6.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp
    import jaxcont
    from jaxcont.core.collocation import Collocation
    from jaxcont.problems.periodic import periodic_orbit_problem

    def right(u: Any, value: Any, args: Any) -> Any:
        return jnp.array(case.full(jnp, u, value))

    period, mesh = 2.0 * pi * case.turns, Collocation(ntst=case.mesh * case.turns, ncol=4)
    angles = np.linspace(0.0, period, 2000 * case.turns + 1)
    motion = jnp.asarray(case.settled()(angles).T)
    problem = periodic_orbit_problem(right, motion, jnp.asarray(angles), period, case.begin, mesh)
    settings = jaxcont.ContinuationPar(
        ds=0.05, ds_max=1.0, ds_min=1e-6, max_steps=100, newton_tol=1e-9, compute_stability=False
    )
    events = [jaxcont.Fold(), jaxcont.PeriodDoubling(raw_f=right, mesh=mesh)]
    span = (case.begin, case.high if case.direction > 0 else case.low)
    for event in jaxcont.continuation(problem, p_span=span, settings=settings, events=events).events:
        yield event.kind.replace("_", " "), float(event.p)


#: Codes by the name of their package, with the branches that each follows.
CODES: dict[str, tuple[Callable[[Case], Iterator[tuple[str, float]]], tuple[str, ...]]] = {
    "bifpy": (by_auto, tuple(CASES)),
    "jaxcont": (by_jaxcont, ("duffing", "pendulum")),
}


def main() -> None:
    """Print the special points that every code finds."""
    for package, (follow, names) in CODES.items():
        print(f"{package} {version(package)}")  # noqa: T201
        for name in names:
            found = follow(CASES[name])
            print(f"  {name}:", *(f"{kind} at {value:.11g}" for kind, value in found))  # noqa: T201


if __name__ == "__main__":
    main()
