"""Check whether `periodic.search_orbits` misses a stable motion in which long runs end.

    python -m benchmarks.motions --mechanisms 20
    python -m benchmarks.motions --light 77

The first command draws five-bars at random near the published rigs, with weak dampers. The second takes rig 1 with spring B and
a damper of 2 N.s/m at a number of speeds from 1120 to 2640 rpm. The mechanism runs for 600 turns from 129 starts. If its motion
then repeats after one to four turns, Newton's method confirms this motion, and `search_orbits` must have found it.
"""

import argparse
from collections import Counter
from dataclasses import fields, replace

import numpy as np

from analysis.periodic import Drive, OrbitError, motion_scales, natural_frequency, newton_orbit, search_orbits
from analysis.periodic.motion.discretisation import operating_point
from analysis.periodic.motion.drive import spread_starts
from analysis.periodic.motion.flow import PLAIN
from analysis.periodic.motion.kernels import segments
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import LinkworkError
from linkwork.five_bar.published import SETS

STARTS, TURNS, MOST = 128, 600, 4
#: A run is settled if the state changes less than this over a period; two starts closer than this belong to one motion (both
#: relative to the scales of the motion).
SETTLED, SAME = 1e-4, 1e-3
RIGS = [known.parameters for known in SETS.values() if known.parameters.slider_stiffness > 0.0]


def draw_five_bar(random: np.random.Generator):
    """Draw a five-bar near a published one, and a speed (rad/s) of 0.4 to 2.4 times its natural frequency."""
    rig = RIGS[random.integers(len(RIGS))]
    while True:
        changed = {}
        for field in fields(rig):
            value = getattr(rig, field.name)
            if isinstance(value, float) and any(
                word in field.name for word in ("length", "mass", "stiffness", "inertia")
            ):
                changed[field.name] = value * float(np.exp(random.normal(0.0, 0.25)))
        changed["slider_damping"] = rig.slider_damping * 10.0 ** random.uniform(-1.3, 0.0)
        try:
            made = replace(rig, **changed)
            return made, natural_frequency(made) * random.uniform(0.4, 2.4)
        except LinkworkError:
            continue


def settled_ends(parameters, drive):
    """Yield, for each run that settles, the number of turns after which its motion repeats, and the state y at its end."""
    point, guess = operating_point(parameters, drive), np.zeros(2)
    scale, turn = point.scale(guess), np.array([0.0, point.flow.period])
    section = point.section(guess, PLAIN, tolerance=1e-8)
    for start in (guess, *spread_starts(parameters, drive, guess, STARTS, 5)):
        z, last = start[None].copy(), np.full((MOST + 1, 2), np.inf)
        for _ in range(TURNS):
            if segments(section, turn, z.copy(), z) != 0:
                break
            last = np.vstack([z, last[:-1]])
        else:
            away = np.abs((last[1:] - last[0]) / scale).max(axis=1)
            if (away < SETTLED).any():
                yield int(np.argmax(away < SETTLED)) + 1, z[0]


def compare(parameters, drive) -> tuple[Counter, int]:
    """Count the runs by the number of turns of their final motion, and the runs whose final motion `search_orbits` misses."""
    scale, seen, missed = motion_scales(parameters, drive, np.zeros(2)), Counter(), 0
    known = {turns: search_orbits(parameters, drive, turns=turns).orbits for turns in range(1, MOST + 1)}
    starts = {turns: np.array([p for o in found for p in o.passages()]) for turns, found in known.items()}
    for turns, end in settled_ends(parameters, drive):
        try:
            orbit = newton_orbit(parameters, drive, turns=turns, start=end, settle=False)
        except OrbitError:
            continue
        passed = np.abs((orbit.passages() - orbit.start) / scale).max(axis=1)
        least = next((n for n in range(1, turns) if passed[n] < SAME), turns)
        seen[least] += 1
        near = len(starts[least]) and np.abs((starts[least] - orbit.start) / scale).max(axis=1).min() < SAME
        missed += not near
    return seen, missed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mechanisms", type=int, default=0)
    parser.add_argument("--light", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    random = np.random.default_rng(asked.seed)
    light = replace(SETS["rig-1-spring-b"].parameters, slider_damping=2.0)
    cases = [draw_five_bar(random) for _ in range(asked.mechanisms)]
    cases += [(light, rpm * RAD_S_PER_RPM) for rpm in np.linspace(1120.0, 2640.0, asked.light)]
    total = 0
    for parameters, speed in cases:
        seen, missed = compare(parameters, Drive(speed=speed))
        total += missed
        runs = ", ".join(f"{seen[turns]} in motions of {turns} turns" for turns in sorted(seen)) or "none comes to rest"
        print(f"{speed / RAD_S_PER_RPM:8.1f} rpm: {runs}{'; MISSED ' + str(missed) if missed else ''}", flush=True)
    print(f"{len(cases)} cases, {total} runs that end in a motion the finder has not")


if __name__ == "__main__":
    main()
