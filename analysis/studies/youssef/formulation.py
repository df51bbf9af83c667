"""Section 3.1: the integration of the equations with Lagrange's multipliers.

By the first approach of section 3.1 all coordinates are integrated, and the loop does not stay closed exactly. By the second
only the independent coordinates are integrated: the slider position u, and in a launch the crank angle th2. The others follow
from the closure of the loop. A launch, section 3.2.2, is a motion from rest under a torque that falls to zero at th2 = 1 rad.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from ...figures import Figure, Panel, plot_curves
from ...run import Hamming
from ...units import CM_PER_METRE
from ..rules import SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, near, statement, within
from ..study import Study, StudyResult, result_curves
from .integrators import CLASSICAL, SLIP, order_of_series, runge_kutta, spurious_root, stable_steps
from .multipliers import OMEGA, ROUNDING, TABLE, TORQUE, chapter_2_statements, closed_loop_state, solve_multipliers

#: Duration of the motion, and steps (s); appendix 1 begins with 1e-3 s.
STOP, STEPS = 0.5, (4e-3, 2e-3, 1e-3, 5e-4)
#: Power of 1 - th2 with which the torque of a launch ends smoothly.
SMOOTH = 5
#: Step (s) with which the errors are large.
LONG_STEP = 1e-2
#: Why the closure does not show the error of a launch.
KINK = "the step in which the torque of the launch ends leaves an error along the motion, while the loop stays closed"
#: Step (s) with which appendix 1 begins; with this step the estimate of Hamming's method is judged.
STEP = 1e-3
#: Errors (m) with which this estimate is tested: of the start, and the unit to which the back values are rounded.
START_ERROR, UNIT = 1e-5, 1e-6


def all_derivatives(t: float, y: FloatArray) -> FloatArray:
    """Return y' of y = (th3, th4, u, th3', th4', u') at constant crank speed: the first approach of section 3.1."""
    w = solve_multipliers((OMEGA * t, *y[:3]), (OMEGA, *y[3:]))
    return np.array([*y[3:], w[5], w[4], w[3]])


def slider_derivatives(t: float, y: FloatArray) -> FloatArray:
    """Return y' of y = (u, u'), with th3 and th4 from the closure of the loop: the second approach of section 3.1."""
    return np.array([y[1], solve_multipliers(*closed_loop_state(OMEGA * t, y[0], OMEGA, y[1]))[3]])


class Integrated(NamedTuple):
    """Results of the two approaches of section 3.1 by Hamming's method with a constant step.

    ``gap`` is the closure error (cm) at ``times`` (s) by the first approach. ``errors`` are the greatest errors of u (cm) by
    the first and by the second approach. By the second approach, ``unseen`` is the greatest closure error (cm) and ``slider``
    has the times (s) and u (cm).
    """

    times: FloatArray
    gap: FloatArray
    errors: tuple[float, float]
    unseen: float
    slider: tuple[FloatArray, FloatArray]

    @property
    def hidden(self) -> float:
        """Return the error of u by the second approach divided by the closure error, to one digit."""
        return float(f"{self.errors[1] / self.unseen:.0e}")


def _by_hamming(f: Callable[..., Any], start: ArrayLike, step: float, stop: float = STOP, *args: int) -> Any:
    """Integrate y' = f(t, y) by Hamming's method with a constant step (s), without control of the error."""
    options = {"method": Hamming, "first_step": step, "max_step": step, "rtol": 1e3, "atol": 1e9}
    return solve_ivp(f, (0.0, stop), start, args=args, **options)


@cache
def integrate_both(step: float) -> Integrated:
    """Integrate the motion from rest by the two approaches of section 3.1, by Hamming's method with a constant step (s)."""
    q, qd = closed_loop_state(0.0, 0.0, OMEGA, 0.0)
    first, second = (
        _by_hamming(f, start, step)
        for f, start in ((all_derivatives, [*q[1:], *qd[1:]]), (slider_derivatives, [0.0, 0.0]))
    )
    error, other = (
        CM_PER_METRE * float(np.abs(u - exact_motion()(first.t)[0]).max()) for u in (first.y[2], second.y[0])
    )
    again = np.transpose([closed_loop_state(OMEGA * t, u, OMEGA, 0.0)[0] for t, u in zip(second.t, second.y[0])])
    gaps = (closure_error(np.array([OMEGA * first.t, *first.y[:3]])), closure_error(again))
    slider = (second.t, CM_PER_METRE * second.y[0])
    return Integrated(first.t, gaps[0], (error, other), float(gaps[1].max()), slider)


def bar_torque(crank: float, power: int = 1) -> float:
    """Return the torque (N.m) of a launch at a crank angle (rad): that of 3.2.2 for the power 1; for 5 it ends smoothly."""
    return float(TORQUE * max(1.0 - crank, 0.0) ** power)


def launch_derivatives(t: float, y: FloatArray, power: int) -> FloatArray:
    """Return y' of y = (q, q') in a launch: the first approach of 3.1."""
    w = solve_multipliers(y[:4], y[4:], bar_torque(y[0], power))
    return np.array([*y[4:], w[0], *w[:2:-1]])


def reduced_launch_derivatives(t: float, y: FloatArray, power: int) -> FloatArray:
    """Return y' of y = (th2, u, th2', u') in a launch with the loop closed by its kinematics: the second approach."""
    w = solve_multipliers(*closed_loop_state(*y), bar_torque(y[0], power))
    return np.array([*y[2:], w[0], w[3]])


@cache
def integrate_launch(step: float, power: int = 1) -> tuple[float, tuple[float, float]]:
    """Integrate a launch by both approaches; return the greatest closure error (cm) by the first, and the errors of u (cm).

    The errors are the greatest errors by the first and by the second approach, as in `Integrated`. The power is that of
    `bar_torque`.
    """
    first, second = (
        _by_hamming(f, start, step, STOP, power)
        for f, start in (
            (launch_derivatives, np.concatenate(closed_loop_state(0.0, 0.0, 0.0, 0.0))),
            (reduced_launch_derivatives, np.zeros(4)),
        )
    )
    error, other = (
        CM_PER_METRE * float(np.abs(u - exact_launch(power)(first.t)[1]).max()) for u in (first.y[3], second.y[1])
    )
    return float(closure_error(first.y[:4]).max()), (error, other)


@cache
def exact_launch(power: int = 1) -> Callable[[FloatArray], FloatArray]:
    """Return a function that gives (th2, u, th2', u') in SI at times (s) of a launch, accurate to 1e-9 cm."""
    solution: Callable[[FloatArray], FloatArray]
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13, "dense_output": True, "args": (power,)}
    solution = solve_ivp(reduced_launch_derivatives, (0.0, STOP), np.zeros(4), **options).sol
    return solution


def judge_closure() -> tuple[Case, ...]:
    """Judge whether the closure error by the first approach shows the error of u, at constant speed and in a launch."""
    runs = {step: integrate_both(step) for step in STEPS}
    shown = {_step(step): run.gap.max() / run.errors[0] for step, run in runs.items()}
    for step in STEPS:
        gap, errors = integrate_launch(step)
        shown[f"launch; {_step(step)}"] = gap / errors[0]
    gap, errors = integrate_launch(STEP, SMOOTH)
    why = (
        f"{KINK}. Under a torque that ends smoothly, T0 (1 - theta2)^{SMOOTH}, the closure is {gap / errors[0]:.1f} times the "
        f"error, {_step(STEP)}"
    )
    return tuple(within(label, 1.0, 100.0, x, why=why) for label, x in shown.items())


@cache
def exact_motion(start: float = 0.0) -> Callable[[FloatArray], FloatArray]:
    """Return a function of times (s) that gives (u, u') in SI, accurate to rounding, from rest at u = ``start`` (m)."""
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "dense_output": True}
    solution: Callable[[FloatArray], FloatArray]
    solution = solve_ivp(slider_derivatives, (0.0, STOP), [start, 0.0], **options).sol
    return solution


def estimated_errors(start: float = 0.0, unit: float = 0.0) -> tuple[FloatArray, ...]:
    """Return estimated errors of u, true errors of u, and roundings of u (all in m), for single steps of Hamming's method.

    The estimate is 9/121 (p - c). Each step has the length `STEP` and begins with the exact motion from rest at ``start`` (m).
    If ``unit`` is not zero, u and u' at the beginning are rounded to multiples of it; the roundings are these changes of u.
    """
    h, t = STEP, np.linspace(0.0, STOP, round(STOP / STEP) + 1)
    exactly = exact_motion(start)(t).T
    back = unit * np.round(exactly / unit) if unit else exactly
    f = np.array([slider_derivatives(*point) for point in zip(t.tolist(), back)])
    difference, found = np.zeros(2), []
    for i in range(3, len(t) - 1):
        p = back[i - 3] + 4.0 * h / 3.0 * (2.0 * f[i] - f[i - 1] + 2.0 * f[i - 2])
        m = p - 112.0 / 121.0 * difference
        c = (9.0 * back[i] - back[i - 2]) / 8.0 + 3.0 * h / 8.0 * (
            slider_derivatives(t[i + 1], m) + 2.0 * f[i] - f[i - 1]
        )
        difference = p - c
        found.append((9.0 / 121.0 * difference[0], exactly[i + 1, 0] - c[0]))
    # the first step has no difference before it
    estimates, errors = np.transpose(found[1:])
    return estimates, errors, (back - exactly)[:, 0]


@cache
def integrate_by_runge_kutta(
    step: float, first: bool = False, stages: tuple[tuple[float, float], ...] = CLASSICAL
) -> FloatArray:
    """Integrate the motion by Runge-Kutta's method; return the states at the start and after each step.

    The equations are those of the second approach of section 3.1, or of the first if ``first``.
    """
    q, qd = closed_loop_state(0.0, 0.0, OMEGA, 0.0)
    f, start = (all_derivatives, [*q[1:], *qd[1:]]) if first else (slider_derivatives, [0.0, 0.0])
    n = round(STOP / step)
    return runge_kutta(f, start, STOP / n, n, stages)


def integration_error(u: FloatArray) -> float:
    """Return the greatest error (cm) of u (m), given at evenly spaced times from 0 to `STOP`."""
    return CM_PER_METRE * float(np.abs(u - exact_motion()(np.linspace(0.0, STOP, len(u)))[0]).max())


def runge_kutta_estimate_ratio(step: float) -> float:
    """Return the greatest error of u by Runge-Kutta's method relative to its estimate by halving the step.

    The estimate is the greatest change of u divided by 1 - 1/16. The motion is integrated by the second approach.
    """
    u, halved = integrate_by_runge_kutta(step)[:, 0], integrate_by_runge_kutta(0.5 * step)[::2, 0]
    return integration_error(u) / (CM_PER_METRE * float(np.abs(u - halved).max()) / (1.0 - 2.0**-4))


def closure_error(q: FloatArray) -> FloatArray:
    """Return the closure error (cm), eq (2.1), for each column of q, shape (4, n)."""
    lengths = np.array([TABLE.crank_length, TABLE.coupler_length, -TABLE.rocker_length])
    gap: FloatArray = CM_PER_METRE * np.abs(lengths @ np.exp(1j * q[:3]) - TABLE.ground_length - q[3])
    return gap


def change_on_halving(step: float) -> float:
    """Return the greatest change of u (cm) if the step of the second approach is halved."""
    (times, u), (finer, other) = (integrate_both(h).slider for h in (step, 0.5 * step))
    return float(np.abs(u - np.interp(times, finer, other)).max())


def slip_ratio(step: float) -> float:
    """Return the greatest closure error divided by the greatest error of u if Runge-Kutta's method has the wrong stages `SLIP`.

    The motion is integrated by the first approach.
    """
    states = integrate_by_runge_kutta(step, True, SLIP)
    crank = OMEGA * np.linspace(0.0, STOP, len(states))
    return float(closure_error(np.array([crank, *states[:, :3].T])).max()) / integration_error(states[:, 2])


def evaluations_a_step() -> float:
    """Count the evaluations of the accelerations in one step of Hamming's method, without the starting steps."""
    counts = []
    for stop in (0.4, 0.5):
        found = _by_hamming(slider_derivatives, [0.0, 0.0], 1e-3, stop)
        counts.append((found.nfev, len(found.t)))
    (fewer, short), (more, long) = counts
    return float((more - fewer) / (long - short))


def compute() -> StudyResult:
    """Judge chapter II and section 3.1, and compute the closure error of the loop over time."""
    found = {_step(step): integrate_both(step) for step in STEPS}
    columns = {"time [s]": found[_step(STEPS[0])].times}
    for label, run in found.items():
        columns[f"failure of closure; {label} [cm]"] = np.interp(columns["time [s]"], run.times, run.gap)
    return StudyResult(
        claim="The multipliers are the pin forces. If all second derivatives are integrated, the closure of the loop shows the "
        "error of the integration.",
        assignment="The integrations are those of Table 3.1 with k = 1e6 dyn/cm and mu = 3e4 dyn.s/cm (our choice), for "
        f"{STOP:g} s from u = u' = 0 in constant steps, at 420 rpm or in a launch from rest with T0 = 1e8 dyn.cm. Hamming's "
        "method begins with three Runge-Kutta steps, each in two halves.",
        columns=columns,
        statements=(*chapter_2_statements(), *_closure_statements(), *_one_step_statements(), *_hamming_statements()),
    )


def _step(step: float) -> str:
    return f"step {1e3 * step:g} ms"


def _closure_statements() -> Iterator[Statement]:
    """Judge section 3.1: whether the closure of the loop shows the error."""
    found = {_step(step): integrate_both(step) for step in STEPS}
    long, label = integrate_both(LONG_STEP), _step(LONG_STEP)
    travel = CM_PER_METRE * float(np.ptp(exact_motion()(np.linspace(0.0, STOP, 2001))[0]))
    yield statement(
        "The accuracy or even the debugging of the integration procedure may then be examined by simple checks on loop "
        "closure.",
        "3.1, L1744-1748; with L1772-1782",
        "greatest failure of closure divided by the greatest error of u. All second derivatives are integrated by "
        "Hamming's method, at 420 rpm and in a launch. For *debugging*, the same at 420 rpm by Runge-Kutta's method "
        "with a slip that we put in: its last stage is at mid-step",
        "1 to 100, our choice: the closure must show the error, and must not be more than a hundred times as large",
        *judge_closure(),
        within(f"a slip; {_step(STEP)}", 1.0, 100.0, slip_ratio(STEP)),
        why="a large failure does show an error, as L1772-1782 says, since it is nowhere more than a hundred times as large",
    )
    yield statement(
        "It is important to recognise that a loop closure check is meaningful other than for trivial arithmetical "
        "checks, only if used in conjunction with the first approach.",
        "3.1, L1748-1755",
        "greatest error of u by the second approach, which integrates u alone and closes the loop by its kinematics, divided "
        "by its failure of closure, to one digit, since this failure is a rounding error; Hamming's method, at 420 rpm",
        "more than 100, our choice as above: then the check shows nothing of the error",
        *(at_least(name, 100.0, run.hidden) for name, run in found.items()),
    )
    yield statement(
        "[L]arge errors may be involved in the numerical integrations yet they are not realised by the designer "
        "because the kinematics are used to force the closure of the mechanism and hence no simple check is available "
        "to indicate whether the solution is accurate.",
        "3.1, L1763-1772",
        f"greatest error of u by the second approach as in the row before, with a step of {1e3 * LONG_STEP:g} ms (our choice). "
        "It is divided by the range of u, by the failure of closure, and by the greatest change of u when the step is halved",
        f"more than {SMALL:g}, the rule for *small*; more than 100, our choice as above, for the two checks. One simple "
        "check that shows the error refutes *no*",
        at_least(f"large error; {label}", SMALL, long.errors[1] / travel),
        at_least(f"not seen in the closure; {label}", 100.0, long.hidden),
        at_least(
            f"not seen on halving; {label}",
            100.0,
            long.errors[1] / change_on_halving(LONG_STEP),
            why="halving the step shows the error",
        ),
    )
    yield statement(
        "This [to integrate all the second order derivatives and bound the errors in loop closure, before the second "
        "approach is taken] will ensure that the integration method is reliable and leads to accurate results.",
        "3.1, L1796-1798",
        "greatest error of u by the second approach divided by the greatest failure of closure by the first approach with the "
        "same step. Hamming's method, at 420 rpm and in the launch, which are two of *the coming solutions* (L1784)",
        "at most 1, our choice: then a bound on the failure of closure also bounds the error",
        *(at_most(name, 1.0, run.errors[1] / run.gap.max()) for name, run in found.items()),
        *(
            at_most(f"launch; {_step(step)}", 1.0, errors[1] / gap, why=KINK)
            for step, (gap, errors) in ((step, integrate_launch(step)) for step in STEPS)
        ),
    )


def _one_step_statements() -> Iterator[Statement]:
    """Judge section 2.4 on the Runge-Kutta methods and on series."""
    halved = max(max(ratio, 1.0 / ratio) for ratio in map(runge_kutta_estimate_ratio, STEPS))
    classical, hamming = stable_steps(1j)
    # the same number of evaluations: four instead of two per step, and steps twice as long
    dearer = {
        f"{approach} approach, Hamming's {_step(step)}": integration_error(
            integrate_by_runge_kutta(2.0 * step, i == 0)[:, 2 - 2 * i]
        )
        / integrate_both(step).errors[i]
        for i, approach in enumerate(("first", "second"))
        for step in (STEPS[1], STEPS[-1])
    }
    used = len(CLASSICAL)
    yield statement(
        "Their [the Runge-Kutta methods'] serious drawbacks are, firstly, the lack of simple means of estimating the "
        "errors; this makes them highly susceptible to numerical instabilities ...",
        "2.4, L1334-1340",
        "factor between the greatest error of u and its estimate, which is the change when the step is halved, divided "
        "by 1 - 1/16. Second approach, classical method, 420 rpm, the greatest factor for steps of 4, 2, 1 and 0.5 ms. "
        "Then the greatest stable step for y'' = -y (our example) divided by that of Hamming's method",
        "more than 2, our choice, since an estimate within a factor of 2 is useful; at most 1, since *highly* is read "
        "as more than Hamming's method",
        at_least(
            "lack of an estimate",
            2.0,
            halved,
            why="halving the step estimates the error, at the cost of three times the evaluations",
        ),
        at_most(
            "susceptible to instabilities",
            1.0,
            classical / hamming,
            why=f"it is stable up to steps of {classical:.1f}, Hamming's method up to {hamming:.2f}",
        ),
    )
    yield statement(
        "... and, secondly, the large number of evaluation of the function [Phi]; four times for each step in a fourth "
        "order method. The second of these drawbacks makes them unfavourable for use with our Lagrangian multiplier "
        "formulation of the equations of the motion because of the large number of equations, and hence the lengthy "
        "time involved in computation of the function [Phi].",
        "2.4, L1340-1356; with L1401-1405",
        "number of evaluations of Phi in a step of the classical method. Then its greatest error of u at 420 rpm, by each "
        "approach of 3.1, divided by that of Hamming's method with half the step, which takes as many evaluations and so "
        "as much time for them; this also judges *the most suitable*, as L1401-1405 calls the predictor-corrector methods",
        "none for the number; more than 1, the sign alone, as *unfavourable* says",
        replace(near("evaluations a step", 4.0, used, 0.0), stated="four"),
        *(
            at_least(
                f"unfavourable; {label}",
                1.0,
                ratio,
                why="by the second approach with long steps Runge-Kutta's error is the smaller",
            )
            for label, ratio in dearer.items()
        ),
    )
    yield statement(
        "For example, to obtain a solution equivalent to a fourth order Runge-kutta method we need to evaluate the "
        "fourth derivative of the function [Phi].",
        "2.4, L1364-1370",
        "order of the error of a Taylor series for y' = Phi that uses the derivatives of Phi up to the third; Phi = -y "
        "(our example), up to t = 1, steps of 0.1 and 0.05",
        "at most 3.5, between the orders three and four: if the fourth derivative were needed, the order without it "
        "would be lower",
        at_most("", 3.5, order_of_series(3), why="the third derivative is enough, since Phi is itself a derivative"),
    )


def _hamming_statements() -> Iterator[Statement]:
    """Judge section 2.4 on the predictor-corrector methods."""
    classical, hamming = stable_steps(1j)
    order = np.log2(integrate_both(STEPS[-1]).errors[1] / integrate_both(0.5 * STEPS[-1]).errors[1])
    estimates, errors, _ = estimated_errors()
    rounded, _, roundings = estimated_errors(unit=UNIT)
    truncation = float(np.abs(estimates).max() / np.abs(errors).max())
    roundoff = float(np.std(rounded - estimates) / np.std(roundings))
    inherent = float(np.abs(estimated_errors(START_ERROR)[0] - estimates).max()) / START_ERROR
    yield statement(
        "They [the predictor-corrector methods] provide an easy estimate of the errors, inherent, roundoff or truncation, from "
        "the information already calculated. These errors are in all cases convergent and, thus the methods are highly stable.",
        "2.4, L1379-1387",
        f"Hamming's estimate 9/121 (p - c) of the error of u by the corrector, c, in single steps of {1e3 * STEP:g} "
        "ms from the exact motion at 420 rpm. For *truncation*: greatest estimate divided by the greatest error. For "
        f"*roundoff*: change of the estimate when u is rounded to {CM_PER_METRE * UNIT:g} cm, divided by the rounding "
        "(rms values). *Inherent* is read as an error of the start: greatest change of the estimate when u is wrong by "
        f"{CM_PER_METRE * START_ERROR:g} cm there, divided by this error. For *convergent*: factor per step by which the "
        "spurious solution of Milne's corrector grows, for y' = -y with the step 0.1 (our example). For *highly stable*: "
        "greatest stable step of Hamming's method for y'' = -y (our example), divided by that of Runge-Kutta's",
        "0.5 to 2, our choice, since an estimate within a factor of 2 is useful; at most 1, as *convergent* says: one "
        "counterexample refutes *in all cases*; at least 1, since *highly* is read as no less than Runge-Kutta's method, "
        "which L1338 calls *highly susceptible* to instabilities",
        within("estimate of the truncation", 0.5, 2.0, truncation),
        within("estimate of the roundoff", 0.5, 2.0, roundoff, why="the estimate shows a small part of it"),
        within(
            "estimate of the inherent error", 0.5, 2.0, inherent, why="the motion from the wrong start is a motion too"
        ),
        at_most(
            "convergent",
            1.0,
            spurious_root((1, 0, -1), (1 / 3, 4 / 3, 1 / 3), 0.1),
            why="Milne's corrector, which the thesis uses, too (L1409-1415), is weakly unstable",
        ),
        at_least(
            "highly stable",
            1.0,
            hamming / classical,
            why=f"Hamming's method is stable up to steps of {hamming:.2f}, Runge-Kutta's up to {classical:.1f}",
        ),
    )
    yield statement(
        "One of their most attractive qualities is that they require only two evaluations of the function "
        "[Phi] per step of integration.",
        "2.4, L1387-1391",
        "number of evaluations in one further step of (2.28) to (2.31)",
        "none, since they are counted",
        replace(near("", 2.0, evaluations_a_step(), 0.0), stated="two"),
    )
    yield statement(
        "The Hamming fourth order modified predictor-corrector is the method chosen here ...",
        "2.4, L1407-1409",
        "order with which the error of u at 420 rpm falls, by (2.28) to (2.31) in the second approach, when the step "
        f"changes from {1e3 * STEPS[-1]:g} to {500.0 * STEPS[-1]:g} ms",
        "at least the stated order",
        replace(at_least("", 4.0, order), stated="fourth"),
        why="the final value (2.31) removes the leading error of the corrector, which adds one order",
    )


def draw(result: StudyResult) -> Figure:
    """Draw the closure error over time."""
    time, *names = result.columns
    curves = result_curves(result, time, {name: name.partition("; ")[2].partition(" [")[0] for name in names})
    panel = Panel(
        x_label=time,
        y_label="failure of closure [cm]",
        curves=curves,
        logarithmic="y",
        legend_at="outside",
        x_range=(0.0, STOP),
        # the start is closed but for rounding
        y_range=(ROUNDING, 2.0 * max(float(result.columns[name].max()) for name in names)),
    )
    return plot_curves([panel], title=result.heading)


#: The studies by number.
STUDIES = {"3.1": Study(compute, draw)}
