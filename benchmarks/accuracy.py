"""Compare the times of solvers at equal accuracy: each solver runs at its loosest setting that reaches the accuracy."""

from collections.abc import Callable, Iterable
from time import process_time
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.mechanisms import Parameters, find_mechanism
from analysis.numerics.codegen import evaluate
from analysis.run import Inputs, encode, machine
from analysis.run.equations import DERIVATIVE

#: Largest allowed error of a run, relative to the largest value.
ACCURACY = 1e-6
TOLERANCES = 10.0 ** np.arange(-3.0, -11.0, -0.1)
SCIPY_METHODS = ("RK45", "DOP853", "LSODA", "Radau", "BDF")


class Choice(NamedTuple):
    """A solver setting, such as a tolerance or a time step, with its error, and whether the error is within `ACCURACY`."""

    setting: float
    error: float
    reached: bool


def loosest_setting(error: Callable[[float], float], settings: Iterable[float]) -> Choice:
    """Return the first of the settings, from loose to tight, that reaches `ACCURACY`; if none does, the most accurate one.

    ``error`` returns the error at a setting. A setting counts only if the next tighter one reaches the accuracy as well, to
    exclude lucky cancellation.
    """
    tried: list[Choice] = []
    for setting in settings:
        found = error(float(setting))
        tried.append(Choice(float(setting), found, found <= ACCURACY))
        if len(tried) > 1 and tried[-1].reached and tried[-2].reached:
            return tried[-2]
    if tried[-1].reached:
        return tried[-1]
    return min(tried, key=lambda choice: choice.error)._replace(reached=False)


def shortest_time(run: Callable[[], object], repeats: int = 7) -> float:
    """Return the shortest processor time of several runs (s); other work on the machine disturbs it little."""
    times = []
    for _ in range(repeats):
        begun = process_time()
        run()
        times.append(process_time() - begun)
    return min(times)


@njit(error_model="numpy")
def _evaluate_in_turn(equation, modes, constants, states, forces):
    """Evaluate an equation at each row of ``states``; each evaluation waits for the previous one, like the stages of a step."""
    x, out = np.empty(states.shape[1]), np.zeros(states.shape[1])
    for i in range(states.shape[0]):
        for j in range(x.shape[0]):
            x[j] = states[i, j] + 0.0 * out[j]
        evaluate(equation, 0.0, x, modes, forces, constants, out)  # type: ignore[call-arg]  # Numba adds the first
    return out


def right_hand_side_time(parameters: Parameters, inputs: Inputs, states: NDArray[np.float64]) -> float:
    """Return the time of one compiled right-hand side (s), evaluated at each row of ``states`` in turn, without forces."""
    mechanism = find_mechanism(parameters)
    p = parameters.constants()
    equation = machine(mechanism, mechanism.is_switched_on(p)).addresses[DERIVATIVE]
    modes = np.array([*encode(inputs, mechanism).modes.values()], dtype=float)
    arguments = (equation, modes, np.array([*p, 0.0]), states, np.zeros(len(mechanism.channels)))
    return shortest_time(lambda: _evaluate_in_turn(*arguments), 20) / len(states)
