"""The result of a run: every output of the FMI contract over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..display import NotebookResult, format_count, format_range
from ..files import unknown_name
from ..libraries import require
from ..mechanisms import MECHANISMS, Parameters, output_units, wrapping_outputs
from .masses import describe_masses, trace_masses

if TYPE_CHECKING:
    import pandas

#: Greatest change of an angle from one sample to the next up to which its turns are counted (rad).
_DENSE = 0.5 * pi


@dataclass(frozen=True, slots=True)
class Occurrence:
    """An event that happened: its name, its time (s), and the state at that time in SI.

    The state has all coordinates of the mechanism, followed by all their rates.
    """

    name: str
    time: float
    state: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory(NotebookResult):
    """Result of a run: times and outputs, how it ended, and how it was computed.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Times of the samples (s).
    values : ndarray, shape (n, m)
        Values of the outputs ``names``, in the order of the mechanism's FMI interface, SI units. At a sample where an input
        jumps they are the values after the jump.
    status : int
        0 if the run reached its end or a stopping event, else the solver.status of the FMI contract.
    message : str
        Why the run ended early. For a complete run a caution if it is stiff, if outputs are not finite numbers, or if the
        residual of the energy balance is larger than the tolerance promises; else empty.
    events : tuple of Occurrence
        Events in order of time.
    source : str
        What computed the trajectory, such as ``compiled DOP853`` or the name of an FMU.
    statistics : mapping
        Statistics of the integrator, as far as known: numbers of steps, rejected steps and evaluations; ``seconds`` of the
        whole run, and ``seconds_integrating`` in the compiled loop.
    parameters : parameters of a mechanism, optional
        Parameters of the mechanism that ran.

    Notes
    -----
    ``trajectory["slider.position"]`` is the column of an output, shape (n,).
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    names: tuple[str, ...]
    status: int = 0
    message: str = ""
    events: tuple[Occurrence, ...] = ()
    source: str = ""
    statistics: Mapping[str, float] = field(default_factory=dict)
    parameters: Parameters | None = None

    def __post_init__(self) -> None:
        if self.values.shape != (len(self.time), len(self.names)):
            raise InputError(
                f"a run with {len(self.time)} times and {len(self.names)} outputs needs values of that shape, not "
                f"{self.values.shape}"
            )

    def __repr__(self) -> str:
        over = f" from {self.time[0]:.4g} to {self.time[-1]:.4g} s" if len(self) else ""
        ended = f"ended early, {self.message}" if self.status else "complete"
        happened = f", {format_count(len(self.events), 'event')}" if self.events else ""
        moving = dict.fromkeys(n for m in MECHANISMS.values() for f in m.freedoms for n in (f.coordinate, f.rate))
        ranges = [f"{name} {format_range(self[name], self.units[name])}" for name in moving if name in self.names]
        source = self.source or "hand"
        parts = (f"{len(self)} samples{over} by {source}, {ended}{happened}", ", ".join(ranges), self.masses)
        return f"<Trajectory: {'; '.join(filter(None, parts))}>"

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.values[:, self.column(name)]

    def __len__(self) -> int:
        return len(self.time)

    @property
    def units(self) -> Mapping[str, str]:
        """Return the unit of each output."""
        known = output_units()
        return MappingProxyType({name: known[name] for name in self.names})

    @property
    def masses(self) -> str:
        """Return a sentence on the masses of the mechanism and their origin; empty if the parameters are not known.

        Links that have the masses of a published set but other lengths are also named.
        """
        if self.parameters is None:
            return ""
        masses = trace_masses(self.parameters)
        return "; ".join((describe_masses(masses)[0], *(mass.stale for mass in masses if mass.stale)))

    def column(self, name: str) -> int:
        """Return the index of an output's column.

        Raises
        ------
        UnknownNameError
            If there is no output of that name.
        """
        try:
            return self.names.index(name)
        except ValueError:
            raise unknown_name(name, self.names, f"output {name!r}") from None

    def unwrapped(self, name: str) -> NDArray[np.float64]:
        """Return the column of an output without the jumps of an angle by a full turn, as when an arm swings past pi.

        The samples must be so dense that the angle changes by less than a quarter of a turn from each to the next; otherwise
        its turns cannot be counted, and the column is returned unchanged. The first value is never changed.
        """
        return unwrap(name, self[name])

    def to_csv(self, path: str | Path) -> Path:
        """Write time and all outputs to a CSV file, in an existing folder; the header has names and units.

        The size of a large file is announced first. Ctrl-C stops the writing within a second, as `linkwork.errors.Interrupted`,
        and no incomplete file is left.
        """
        from ..files import write_csv

        columns = {"time [s]": self.time} | {f"{name} [{unit}]": self[name] for name, unit in self.units.items()}
        return write_csv(path, columns)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the run as a DataFrame indexed by time; this needs pandas, which is in Linkwork's extra ``dataframe``."""
        require("pandas")
        import pandas

        return pandas.DataFrame(self.values, index=pandas.Index(self.time, name="time"), columns=list(self.names))


def unwrap(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of the output ``name`` over time without jumps by a full turn; see `Trajectory.unwrapped`."""
    if name not in wrapping_outputs():
        return values
    followed = np.unwrap(values)
    return followed if bool((np.abs(np.diff(followed)) < _DENSE).all()) else values
