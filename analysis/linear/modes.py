"""Find the natural frequencies and damping ratios of small vibrations about the equilibrium, with the cranks held.

The mass matrix, and with it every natural frequency, changes with the angles of the cranks. `natural_modes` holds the cranks at
evenly spaced positions of a turn, finds the equilibrium of all free coordinates at each of them, and linearises there.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.integrate import UNDEFINED
from linkwork.mechanism import Mechanism

from ..mechanisms import InitialState, Parameters, find_mechanism
from ..run import (
    InductionMotor,
    Inputs,
    check_run,
    complete_initial_state,
    complete_inputs,
    start_ratio,
    takes_published,
)
from ..units import RAD_S_PER_RPM
from . import model
from .equilibrium import Equilibrium, find_equilibrium
from .model import FloatArray, Matrices, evaluate, layout, sample_channels
from .periodic import common_period

#: Likeness (from 0 to 1) of a mode shape to the known modes below which it is that of a new mode.
_NEW = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NaturalModes:
    """Natural frequencies and damping ratios of a mechanism, at s positions of its held cranks over a turn.

    Attributes
    ----------
    equilibria : tuple of Equilibrium
        The equilibrium at each position, dry friction left out.
    matrices : Matrices
        The linear models about these equilibria, stacked.
    poles : ndarray, shape (s, 2 n)
        Eigenvalues (1/s) of the n free coordinates, by magnitude.
    frequencies : ndarray, shape (s, k)
        Natural frequencies (rad/s) of the k modes, in rising order of their means: magnitudes of the poles that oscillate. A
        mode is followed from position to position by its mode shape, also where its frequency crosses that of another mode; nan
        at positions at which it does not oscillate.
    damping_ratios : ndarray, shape (s, k)
        Damping ratios: the negative real part of the pole over its magnitude.
    shares : ndarray, shape (k, n)
        Share of each free coordinate in the kinetic energy of each mode, averaged over the positions.
    """

    equilibria: tuple[Equilibrium, ...]
    matrices: Matrices
    poles: NDArray[np.complex128]
    frequencies: FloatArray
    damping_ratios: FloatArray
    shares: FloatArray

    def __repr__(self) -> str:
        spans = (f"{low:.6g} to {high:.6g}" for low, _, high in self.frequency_ranges / RAD_S_PER_RPM)
        words = f"natural frequencies [rpm] {', '.join(spans)}" if self.frequencies.shape[1] else "nothing vibrates"
        unstable = f", {self.unstable} of them unstable" if self.unstable else ""
        return (
            f"<NaturalModes of {self.matrices.mechanism.name}: {words}; "
            f"{len(self.equilibria)} positions of the cranks{unstable}>"
        )

    @property
    def coordinates(self) -> tuple[str, ...]:
        """FMI name of the coordinate with the greatest share in the kinetic energy of each mode."""
        return tuple(self.matrices.state_names[place] for place in self.shares.argmax(axis=1))

    @property
    def frequency_ranges(self) -> FloatArray:
        """Least, mean and greatest natural frequency (rad/s) over the positions, for each mode, shape (k, 3)."""
        return self._ranges(self.frequencies)

    @property
    def damping_ranges(self) -> FloatArray:
        """Least, mean and greatest damping ratio over the positions, for each mode, shape (k, 3)."""
        return self._ranges(self.damping_ratios)

    @property
    def unstable(self) -> int:
        """Number of positions of the cranks at which the equilibrium is unstable: a pole has a positive real part."""
        return int(np.sum(model.vibration_grows(self.poles)))

    @staticmethod
    def _ranges(values: FloatArray) -> FloatArray:
        per_mode = (column[np.isfinite(column)] for column in values.T)
        return np.array([[v.min(), v.mean(), v.max()] for v in per_mode]).reshape(-1, 3)


@takes_published(inputs=complete_inputs, initial=complete_initial_state)
def natural_modes(
    parameters: Parameters, inputs: Inputs | None = None, *, initial: InitialState | None = None, samples: int = 36
) -> NaturalModes:
    """Find the natural frequencies of all free coordinates about their equilibrium, over a turn of the held cranks.

    Parameters
    ----------
    parameters
        Parameters of a mechanism, or a published set or its name. Dry friction is left out: it would hold all
        bodies at rest.
    inputs : Inputs, optional
        Constant inputs of the motion. Degrees of freedom with a commanded rate are held: a crank at evenly spaced positions
        of the common period of all held cranks, any other at its initial position. If no crank is commanded, the first one
        is held, and its torque is left out. Every crank under a motor is held, too; from one position to the next it turns
        with the other cranks in the ratio of the speeds in ``initial``.
    initial : initial state, optional
        Position of the held degrees of freedom at the beginning, and guess of the equilibrium there.
    samples : int
        Number of positions of the cranks.

    Raises
    ------
    InputError
        If an input is not constant, or no coordinate other than the held crank is free.
    AssemblyError, EquilibriumError
        If the links cannot be joined at a position or come to the limit of assembly between two, or no equilibrium is found.

    Examples
    --------
    >>> from math import pi
    >>> from analysis import natural_modes
    >>> modes = natural_modes("rig-2-spring-c")
    >>> modes.coordinates, [f"{speed * 30.0 / pi:.1f} rpm" for speed in modes.frequency_ranges[0]]
    (('slider.position',), ['580.5 rpm', '585.5 rpm', '590.6 rpm'])
    """
    mechanism = find_mechanism(parameters)
    inputs, initial = check_run(mechanism, inputs, initial)
    if samples < 1:
        raise InputError(f"samples is {samples}: it must be at least 1")
    parameters = model.without_dry_friction(parameters)
    speeds = _held_speeds(mechanism, inputs, initial)
    if set(layout(mechanism, tuple(inputs.modes(mechanism).values())).free) <= speeds.keys():
        forces = [c.argument for c in mechanism.channels if c.kind == "force" and speeds.get(c.freedom) == 0.0]
        raise InputError(
            f"no coordinate of the {mechanism.name} other than the held crank is free to vibrate"
            + "".join(f"; a force, such as {force} = 0, frees one" for force in forces[:1])
        )
    # a force on a held degree of freedom does not act
    still = inputs.replace(
        **{c.argument: None for c in mechanism.channels if c.freedom in speeds and c.kind in ("force", "command")}
    )
    start = np.array(mechanism.state(initial)[: len(mechanism.freedoms)])
    period = common_period(mechanism, speeds)
    found: list[Equilibrium] = []
    # the last position closes the turn
    for time in period * np.arange(samples + 1 if period and samples > 1 else 1) / samples:
        held = {mechanism.freedoms[n].coordinate: start[n] + speed * time for n, speed in speeds.items()}
        guess = found[-1].coordinates if found else start
        found.append(find_equilibrium(parameters, still, held=held, guess=guess))
    for one, other in pairwise(found):
        _check_gap(mechanism, one, other)
    del found[samples:]
    states = np.array([one.state for one in found])
    modes, channels = sample_channels(mechanism, found[0].inputs, np.zeros(len(found)), states)
    matrices = Matrices(parameters=parameters, modes=modes, **evaluate(parameters, modes, states, channels))
    return _decompose(tuple(found), matrices)


def _check_gap(mechanism: Mechanism, one: Equilibrium, other: Equilibrium) -> None:
    """Raise AssemblyError if the links cannot be joined in a state on the straight line between two equilibria."""
    p = one.parameters.constants()
    idle, begin, end = mechanism.idle_inputs(p), np.array(one.state), np.array(other.state)

    def state(share: float) -> list[float]:
        return list((begin + share * (end - begin)).tolist())

    def clearance(share: float) -> float:
        with suppress(*UNDEFINED):
            return float(mechanism.equations.clearance(state(share), idle, p))
        return 0.0

    # without SciPy's optimisers, whose import takes half a second
    share, width = 0.5, 0.5
    while width > 1e-6:
        around = np.linspace(max(share - width, 0.0), min(share + width, 1.0), 9).tolist()
        share, width = min(around, key=clearance), 0.25 * width
    mechanism.check_assembly(state(share), p)


def _held_speeds(mechanism: Mechanism, inputs: Inputs, initial: Any) -> dict[int, float]:
    """Return the speeds of the held degrees of freedom by index; zero for those that do not turn."""
    speeds = {}
    for n in layout(mechanism, tuple(inputs.modes(mechanism).values())).commanded:
        command = mechanism.channel_index(n, "command")
        constant = inputs.constants([mechanism.channels[command].argument]) if command is not None else [0.0]
        if constant is None:
            raise InputError(f"{inputs}: natural frequencies need constant speeds")
        speeds[n] = constant[0] if mechanism.freedoms[n].period else 0.0
    cranks = [n for n in mechanism.cyclic_freedoms if mechanism.channel_index(n, "command") is not None]
    if not cranks:
        return speeds
    first = next((n for n in cranks if speeds.get(n)), next((n for n in cranks if n in speeds), cranks[0]))
    commanded = bool(speeds.get(first))
    speeds[first] = speeds.get(first) or 1.0
    start = {n: float(getattr(initial, mechanism.freedoms[n].initial[1])) for n in cranks}
    begins = speeds[first] if commanded else start[first] or 1.0
    motors = {
        c.freedom for c in mechanism.channels for part in inputs.parts(c.argument) if isinstance(part, InductionMotor)
    }
    return {n: float(start_ratio(start[n], begins)) * speeds[first] for n in motors.intersection(cranks)} | speeds


def _pair(likeness: FloatArray) -> Iterable[tuple[int, int]]:
    """Return the pairs of row and column with the greatest sum of likeness, each row and column in one pair at most."""
    if len(likeness) == 1:
        return zip(range(1), range(likeness.shape[1]))
    from scipy.optimize import linear_sum_assignment  # takes a third of a second

    return zip(*linear_sum_assignment(likeness, maximize=True))


def _decompose(equilibria: tuple[Equilibrium, ...], matrices: Matrices) -> NaturalModes:
    values, vectors = np.linalg.eig(matrices.A)
    size, shape = matrices.M.shape[-1], matrices.M.shape[:2]
    frequencies, ratios, shares = np.full(shape, np.nan), np.full(shape, np.nan), np.full((*shape, size), np.nan)
    known = np.zeros((size, size), dtype=complex)  # column k: the shape in which mode k oscillated last, or zeros
    for j, (poles, mass) in enumerate(zip(values, matrices.M)):
        oscillating = np.flatnonzero(poles.imag > model.ROUNDING * np.abs(poles).max())
        oscillating = oscillating[np.argsort(np.abs(poles[oscillating]))]
        shapes = vectors[j, :size, oscillating].T
        energies = (shapes.conj() * (mass @ shapes)).real
        # modal assurance criterion: 1 for equal shapes, 0 for shapes that are orthogonal with respect to the mass matrix
        products = np.outer((known.conj() * (mass @ known)).real.sum(axis=0), energies.sum(axis=0))
        likeness = np.full(products.shape, _NEW)
        np.divide(np.abs(known.conj().T @ mass @ shapes) ** 2, products, out=likeness, where=products > 0.0)
        for k, own in _pair(likeness):
            pole, known[:, k] = poles[oscillating[own]], shapes[:, own]
            shares[j, k] = energies[:, own] / energies[:, own].sum()
            frequencies[j, k], ratios[j, k] = abs(pole), -pole.real / abs(pole)
    found = np.flatnonzero(np.isfinite(frequencies).any(axis=0))
    found = found[np.argsort(np.nanmean(frequencies[:, found], axis=0))]
    return NaturalModes(
        equilibria=equilibria,
        matrices=matrices,
        poles=np.take_along_axis(values.astype(complex), np.argsort(np.abs(values), axis=1), axis=1),
        frequencies=frequencies[:, found],
        damping_ratios=ratios[:, found],
        shares=np.nanmean(shares[:, found], axis=0),
    )
