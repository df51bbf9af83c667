"""Motions that no branch leads to: isolas, closed curves over a parameter, and branches that both ends of a range miss."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from linkwork.errors import InputError

from ..numerics.workers import interruptible
from ..run import shown
from .branches import follow_both
from .finder import orbits_of, passages
from .lines import GREATEST, passes
from .orbits import PeriodicOrbit, require_turns
from .resonance import Response, ResponseInterrupted, ended

#: Largest multiplier with which a motion of several turns is followed.
GREATEST_OF_SEVERAL = 100.0


def with_isolas(
    response: Response, *, places: int = 5, turns: int = 1, greatest_step: float = 5e-3, progress: bool = False
) -> Response:
    """A response with the motions that are connected with none of its branches.

    All motions are sought at some values of the parameter; one that lies on no branch begins another, which is followed to both
    sides until it closes or ends. None is begun from a motion so unstable that deviations grow a thousandfold in a turn.

    Motions of several turns are stable in narrow ranges only, between a fold and a period doubling. Beyond the doubling they go
    on, less and less stable, over a range some ten times as wide: what has to be met is that. None of these is followed where
    deviations grow more than `GREATEST_OF_SEVERAL` times in a period.

    Parameters
    ----------
    response : Response
    places : int
        Values of the parameter, evenly spaced inside the range, at which all motions are sought.
    turns : int
        Motions of up to so many turns of the crank are sought.
    greatest_step, progress
        See `frequency_response`.

    Raises
    ------
    InputError
        If there are no places, or no turns.
    ResponseInterrupted
        On Ctrl-C, with the branches that there are.

    Examples
    --------
    >>> from analysis import frequency_response, with_isolas
    >>> response = frequency_response("rig-2-spring-c", "500 rpm", "650 rpm", doublings=0)
    >>> len(with_isolas(response, places=2).branches)
    1
    """
    if places < 1:
        raise InputError(f"places is {places}: motions must be sought at one value of the parameter at least")
    require_turns(turns)
    search = _Isolas(response, greatest_step)
    with interruptible() as interrupted, shown(progress, float(places * turns), "seeking closed branches") as show:
        values = np.linspace(response.low, response.high, places + 2)[1:-1].tolist()
        for number, (value, period) in enumerate(product(values, range(1, turns + 1)), start=1):
            search.seek(value, period, lambda: bool(interrupted))
            show(float(number))
            if interrupted:
                break
    result = replace(response, branches=tuple(search.branches), problems=tuple(search.problems))
    if interrupted:
        raise ResponseInterrupted(result)
    return result


class _Isolas:
    """The branches of a response, to which are added those that no other leads to."""

    def __init__(self, response: Response, greatest: float) -> None:
        self.response, self.greatest = response, greatest
        self.branches, self.problems = list(response.branches), list(response.problems)

    def seek(self, value: float, turns: int, stop: Callable[[], bool]) -> None:
        """Seek the motions of so many turns at a value of the parameter, and follow those that are on no branch."""
        family = self.response.family
        parameters, drive = family.at(value)
        start = None
        if not drive.speed_drive:
            # under a torque there is no guess of the speed but that of a known motion
            simple = [b for b in self.branches if b.turns == 1]
            points = [point for b in simple for point in zip(np.abs(b.parameter - value), b.orbits)]
            start = min(points, key=lambda point: float(point[0]))[1].start
        limit = GREATEST if turns == 1 else GREATEST_OF_SEVERAL
        for orbit in orbits_of(parameters, drive, turns=turns, start=start).orbits:
            if stop() or orbit.largest > limit or self._knows(orbit, value):
                continue
            branch = follow_both(
                family,
                orbit,
                value,
                low=self.response.low,
                high=self.response.high,
                greatest=self.greatest,
                stop=lambda orbit: stop() or (turns > 1 and orbit.largest > limit),
            )
            self.branches.append(branch)
            strayed = turns > 1 and max(branch.orbits[end].largest for end in (0, -1)) > limit
            if not (branch.reached or strayed):
                self.problems.append(ended(branch))

    def _knows(self, orbit: PeriodicOrbit, value: float) -> bool:
        """Whether a branch passes a motion, whichever of its turns that begins with."""
        width = self.response.high - self.response.low
        starts = passages(orbit)
        own = [branch for branch in self.branches if branch.turns == orbit.turns]
        return any(passes(branch, value, start, width) for branch in own for start in starts)
