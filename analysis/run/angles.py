"""Keep angles small in long runs: subtract whole turns from the state, and add them back to the outputs.

An angle of 1e9 turns is rounded to 1e-6 rad. An integrator would take this rounding for motion. The integrator's tolerance is
relative to the state, and would allow errors of whole turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.mechanism import Mechanism

from .events import Event
from .inputs import Encoded

#: Number of turns above which turns are subtracted: all whole turns or, if the mechanism is not the same after one turn, as
#: with a groove, multiples of this number. It is a power of two, like the denominators of most ratios of a groove.
TURNS = 1024


class WholeTurns:
    """Whole turns subtracted from the angles of a run.

    No turns are subtracted if an input or an event is a user's function.
    """

    def __init__(
        self, mechanism: Mechanism, p: Any, modes: Sequence[float], encoded: Encoded, events: Sequence[Event]
    ) -> None:
        self._mechanism, self._p, self._modes = mechanism, p, modes
        self._periods = [freedom.period for freedom in mechanism.freedoms]
        self.subtracted = np.zeros(mechanism.size)
        self._never = encoded.has_functions or any(event.function for event in events)
        #: index of a sample, and the angles subtracted from that sample on
        self._since: list[tuple[int, NDArray[np.float64]]] = []

    def subtract(
        self, x: NDArray[np.float64], u: NDArray[np.float64], laws: NDArray[np.float64], first: int, watch: Any = None
    ) -> None:
        """Subtract whole turns from large angles of the state x, in place, if the mechanism behaves the same without them.

        ``u`` are the values of the input channels, ``laws`` the torque laws of the inputs; nothing is subtracted while a
        torsion bar acts. ``first`` is the index of the next sample. ``watch`` has the table of events, in which levels of
        angles are reduced too.
        """
        if not self.has_many_turns(x) or laws[:, 2].any():
            return
        period = np.zeros(len(x))
        period[: len(self._periods)] = self._periods
        for way in (period, TURNS * period):
            less = self._without_turns(x, u, way)
            if less is not None:
                break
        else:
            self._never = True
            return
        off = x - less
        x[:] = less
        self.subtracted += off
        self._since.append((first, off))
        if watch is not None:
            for column, angle in zip(self._columns, off):
                # columns of the table of events: output, level
                watch.table[(watch.table[:, 0] == column), 1] -= angle

    def _without_turns(self, x: NDArray[np.float64], u: NDArray[np.float64], way: NDArray[np.float64]) -> Any:
        """Return the state x less multiples of ``way``; None if the mechanism does not behave the same there.

        ``way`` has the period of each angle, or a multiple of the period, and zeros elsewhere. The same multiple of ``way`` is
        subtracted from all angles if a spring between turning bodies is twisted by the difference of their turns.
        """
        turning = way > 0.0

        def are_equal(y: NDArray[np.float64], off: NDArray[np.float64]) -> bool:
            return repeats(self._mechanism, self._p, self._modes, y, u, off)

        less = np.fmod(x, way, out=x.copy(), where=turning)
        if not are_equal(less, way):
            return None
        turns = np.trunc(np.divide(x, way, out=np.zeros(len(x)), where=turning))
        most = turns[np.abs(turns).argmax()]
        apart = np.where(turning, np.clip(turns - most, -TURNS, TURNS), 0.0)
        if not apart.any() or are_equal(less, apart * way):
            return less
        less = x - most * way
        return less if np.abs(less[turning] / way[turning]).max() < abs(most) else None

    def put_back(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add the subtracted turns back to the outputs at the samples, in place, and return the outputs."""
        for first, off in self._since:
            values[first:, self._columns] += off[: len(self._columns)]
        return values

    def has_many_turns(self, x: NDArray[np.float64]) -> bool:
        """Return whether the angles of the state x are large enough to subtract turns."""
        return not self._never and any(0.0 < TURNS * way < abs(angle) for way, angle in zip(self._periods, x.tolist()))

    @property
    def _columns(self) -> list[int]:
        """Return for each degree of freedom the index of the output that is its coordinate."""
        return coordinate_outputs(self._mechanism)


def coordinate_outputs(mechanism: Mechanism) -> list[int]:
    """Return for each degree of freedom of a mechanism the index of the output that is its coordinate."""
    return [mechanism.output_names.index(freedom.coordinate) for freedom in mechanism.freedoms]


def repeats(
    mechanism: Mechanism,
    p: Any,
    modes: Sequence[float],
    x: NDArray[np.float64],
    u: NDArray[np.float64],
    way: NDArray[np.float64],
) -> bool:
    """Return whether the derivatives, and all outputs except the coordinates, are equal at the states x and x + way.

    ``way`` is for instance a whole turn of each angle; ``p`` are the constants of the equations; ``u`` are the values of the
    input channels, the same at both states.
    """
    equations = mechanism.equations
    acting = equations.apply_inputs(modes, tuple(u.tolist()), p)
    coordinates = coordinate_outputs(mechanism)

    def seen(y: NDArray[np.float64]) -> NDArray[np.float64]:
        state = tuple(y.tolist())
        values = np.array(equations.outputs(state, acting, 0.0, p))
        values[coordinates] = 0.0
        return np.append(values, equations.derivative(state, acting, p))

    here = seen(x)
    return bool(np.allclose(seen(x + way), here, rtol=1e-7, atol=1e-9 * float(np.abs(here).max())))
