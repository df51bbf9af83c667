"""Motions that no branch leads to: isolas, closed curves over a parameter, and branches that both ends of a range miss."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linkwork.errors import InputError

from ..numerics.workers import interruptible
from ..run import shown
from .branches import follow_both
from .finder import orbits_of
from .lines import GREATEST, passes
from .resonance import Response, ResponseInterrupted, ended


def with_isolas(
    response: Response, *, places: int = 5, greatest_step: float = 5e-3, progress: bool = False
) -> Response:
    """A response with the motions of one turn that are connected with none of its branches.

    All motions are sought at some values of the parameter; one that lies on no branch begins another, which is followed to both
    sides until it closes or ends. None is begun from a motion so unstable that deviations grow a thousandfold in a turn.

    Parameters
    ----------
    response : Response
    places : int
        Values of the parameter, evenly spaced inside the range, at which all motions are sought.
    greatest_step, progress
        See `frequency_response`.

    Raises
    ------
    InputError
        If there are no places.
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
    family, low, high = response.family, response.low, response.high
    branches, problems = list(response.branches), list(response.problems)
    with interruptible() as interrupted, shown(progress, float(places), "seek isolas") as show:
        for number, value in enumerate(np.linspace(low, high, places + 2)[1:-1].tolist(), start=1):
            parameters, drive = family.at(value)
            own = [branch for branch in branches if branch.turns == 1]
            # under a torque there is no guess of the speed but that of a known motion
            points = [point for branch in own for point in zip(np.abs(branch.parameter - value), branch.orbits)]
            start = None if drive.speed_drive else min(points, key=lambda point: float(point[0]))[1].start
            for orbit in orbits_of(parameters, drive, start=start).orbits:
                known = any(passes(branch, value, orbit.start, high - low) for branch in own)
                if interrupted or known or orbit.largest > GREATEST:
                    continue
                branch = follow_both(
                    family, orbit, value, low=low, high=high, greatest=greatest_step, stop=lambda _: bool(interrupted)
                )
                own.append(branch)
                branches.append(branch)
                if not branch.reached:
                    problems.append(ended(branch))
            show(float(number))
            if interrupted:
                break
    result = replace(response, branches=tuple(branches), problems=tuple(problems))
    if interrupted:
        raise ResponseInterrupted(result)
    return result
