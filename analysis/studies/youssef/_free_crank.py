"""What Fig 3.6 to 3.9 and 3.11 to 3.14 share: runs with a free crank, one quantity of each over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM

from ...figures import Figure, Panel, plot_curves
from ...run import Trajectory
from ..study import ASSIGNED, OURS, StudyResult, Verdict, at_most, curves_of
from ._runs import STIFFNESSES, TORQUES, coast, launch, plain, scientific

#: Quantity of a plot: what the axis calls it, output, factor to its unit, unit.
SLIDER = ("slider position u", "slider.position", CM_PER_METRE, "cm")
CRANK_SPEED = ("crank speed", "crank.speed", 1.0 / RAD_S_PER_RPM, "rpm")

Quantity = tuple[str, str, float, str]


def launches_by_torque() -> dict[str, Trajectory]:
    """Launches with the three torques, k = 1e6 dyn/cm."""
    return {f"T0 = {plain(t)} dyn.cm": launch(t, 1e6) for t in TORQUES}


def launches_by_spring() -> dict[str, Trajectory]:
    """Launches with the three springs, T0 = 1e8 dyn.cm."""
    return {f"k = {plain(k)} dyn/cm": launch(1e8, k) for k in STIFFNESSES}


def launch_result(number: str, runs: Mapping[str, Trajectory], quantity: Quantity, *verdicts: Verdict) -> StudyResult:
    """A quantity of launches as the result of a study, with the energy balance among the verdicts."""
    return StudyResult(
        number=number,
        claim="The crank is launched from rest by T = T0 (1 - th2), which ends at th2 = 1 rad.",
        assignment=ASSIGNED,
        columns=_columns(runs, quantity),
        verdicts=(*verdicts, _energy_verdict(runs)),
    )


def coast_result(number: str, stiffness: float, quantity: Quantity) -> StudyResult:
    """A quantity of the free motion with a spring (dyn/cm) as the result of a study."""
    run = coast(stiffness)
    energy = run["energy.kinetic"] + run["energy.potential"]
    rise = float(np.diff(energy).max())
    return StudyResult(
        number=number,
        claim="The crank is left to itself at 420 rpm; spring and damper act on the slider.",
        assignment=ASSIGNED,
        columns=_columns({f"k = {plain(stiffness)} dyn/cm": run}, quantity),
        verdicts=(
            _energy_verdict({"": run}),
            at_most("rise of the mechanical energy between two samples", OURS, 1e-9, rise, "J"),
        ),
    )


def draw_launches_by_torque(result: StudyResult) -> Figure:
    """The launches with the three torques over time."""
    return draw_over_time(result, [scientific(t) for t in TORQUES], r"$T_0$ [dyn cm]")


def draw_launches_by_spring(result: StudyResult) -> Figure:
    """The launches with the three springs over time."""
    return draw_over_time(result, [scientific(k) for k in STIFFNESSES], "stiffness k [dyn/cm]")


def draw_over_time(result: StudyResult, labels: Sequence[str] = ("",), legend: str = "") -> Figure:
    """All columns over time, with their labels in order; a single one needs none."""
    names = [name for name in result.columns if name != "time [s]"]
    time = result.columns["time [s]"]
    panel = Panel(
        x_label="time [s]",
        y_label=f"{names[0].partition(';')[0]} [{names[0].rpartition('[')[2]}",
        curves=curves_of(result, "time [s]", dict(zip(names, labels))),
        legend=legend,
        legend_at="outside",
        x_range=(0.0, float(time[-1])),
    )
    return plot_curves([panel], title=result.heading)


def _columns(runs: Mapping[str, Trajectory], quantity: Quantity) -> dict[str, NDArray[np.float64]]:
    name, output, factor, unit = quantity
    columns = {"time [s]": next(iter(runs.values())).time}
    return columns | {f"{name}; {run_name} [{unit}]": factor * run[output] for run_name, run in runs.items()}


def _energy_verdict(runs: Mapping[str, Trajectory]) -> Verdict:
    """That no energy is lost or made: the largest residual of the balance relative to the energy that is in play."""
    worst = max(
        float(np.abs(run["energy.residual"]).max() / max(run["energy.supplied"].max(), run["energy.kinetic"].max()))
        for run in runs.values()
    )
    return at_most("residual of the energy balance, relative to the energy in play", OURS, 1e-7, worst)
