"""Control the slider by a force on it: controllers are designed on linear models and tested on the nonlinear mechanism.

Three tasks: keep the slider of rig 2 still at its resonance while the crank turns; move the slider of Table 3.1 at 420 rpm by
small and large steps; balance the free crank of Table 3.1 at an unstable equilibrium. The controller samples at 1 kHz and holds
its force between samples. The mechanism is simulated in this process or, with --fmu, by its FMU.

    python examples/slider_lqr.py
    python examples/slider_lqr.py --fmu build/FiveBarSlider.fmu
    python examples/slider_lqr.py --figures docs        # linearisation-bode.png, -margins.png, -poles.png, -loop.png
"""

from __future__ import annotations

import argparse
from math import degrees, pi
from pathlib import Path

import numpy as np

from analysis import Inputs, figures, find_orbit
from analysis.figures import Curve, Panel
from analysis.linear import (
    Design,
    LoopResult,
    PeriodicModel,
    SampledController,
    control_loop,
    design_lqr,
    design_pi,
    design_pid,
    find_equilibria,
    largest_difference,
    linearise,
    linearise_orbit,
    predict_loop,
)
from analysis.units import RAD_S_PER_RPM
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1

RIG_2 = SETS["rig-2-spring-c"].parameters
PERIOD = 1e-3

#: Weights of the LQR cost: 1 mm costs as much as 1 N, 0.1 m/s as much as 1 N.
WEIGHTS = {"slider.position": 1e6, "slider.velocity": 1e2}


def turning(title: str, parameters: FiveBarParameters, speed: float) -> tuple[PeriodicModel, InitialState]:
    """Return the linear models along the motion at a constant crank speed, and the start of that motion; print a summary."""
    models = linearise_orbit(parameters, find_orbit(parameters, speed=speed))
    th2, u, w2, v = models.states[0, :4].tolist()
    start = InitialState(crank_angle=th2, crank_speed=w2, slider_position=u, slider_velocity=v)
    mean, travel = models.mean(), models.states[:, 1]
    print(title)
    print(f"  mean model: M {mean.M[0, 0]:.4f} kg, C {mean.C[0, 0]:.3f} N.s/m, K {mean.K[0, 0]:.1f} N/m")
    print(f"  without control: travel {1e3 * np.ptp(travel):.2f} mm, rms {1e3 * travel.std():.3f} mm")
    return models, start


def describe(design: Design) -> str:
    gains = ", ".join(f"{gain:.5g}" for gain in design.gains)
    return (
        f"{design.method}: k = ({gains}), k_i = {design.integral_gain:.5g}, phase margin "
        f"{degrees(design.phase_margin):.1f} deg, crossover {design.crossover:.1f} rad/s, dead time up to "
        f"{1e3 * design.delay_margin:.2f} ms, |z| <= {abs(design.sampled_poles(PERIOD)[-1]):.4f} at 1 kHz"
    )


def still(fmu: Path | None) -> tuple[PeriodicModel, list[Design], LoopResult]:
    """Keep the slider of rig 2 with spring C at the middle of its travel, at 585 rpm; print how well each controller does.

    Returns the linear models, the designs, and the run of the last design.
    """
    speed = 585.0 * RAD_S_PER_RPM
    models, start = turning("Rig 2, spring C, 585 rpm: keep the slider still", RIG_2, speed)
    mean = models.mean()
    middle = float(mean.state[1])
    print(f"  natural frequency {mean.natural_frequencies[0] / RAD_S_PER_RPM:.1f} rpm, poles {mean.poles[0]:.4f} 1/s")
    truth, foretold = (np.abs(np.linalg.eigvals(models.monodromy())).max(), np.exp(mean.poles.real[0] * models.period))
    print(f"  largest Floquet multiplier {truth:.5f}, by the mean model {foretold:.5f}")
    designs = [design_lqr(mean, WEIGHTS, 0.1, integral=1e9), design_pid(mean, bandwidth=150.0)]
    for design in designs:
        print(f"  {describe(design)}")
        controller = SampledController(design, PERIOD)
        loop = control_loop(RIG_2, controller, middle, Inputs(speed=speed), initial=start, stop_time=1.0, fmu=fmu)
        periodic = predict_loop(models, controller, middle, stop_time=1.0)
        averaged = predict_loop(models, controller, middle, stop_time=1.0, averaged=True)
        for name, run in (("plant", loop), ("periodic model", periodic), ("mean model", averaged)):
            m = run.metrics(band=1e-3, window=2.0 * pi / speed)
            print(
                f"    {name:15s} rms {1e3 * m.rms_error:.4f} mm, largest {1e3 * m.peak_error:.4f} mm, force rms "
                f"{m.rms_force:.2f} N, at first up to {m.peak_force:.1f} N"
            )
        print(
            f"    largest difference from the plant: periodic model {1e3 * largest_difference(loop, periodic):.4f} mm, "
            f"mean model {1e3 * largest_difference(loop, averaged):.4f} mm"
        )
    return models, designs, loop


def steps(fmu: Path | None) -> None:
    """Move the slider of Table 3.1 at 420 rpm by reference steps of three sizes; print how fast and how exactly it follows."""
    speed = SETS["table-3.1"].crank_speed
    title = "Table 3.1, 420 rpm: steps of the reference from the middle of the travel after 1 s, force up to 400 N"
    models, start = turning(title, TABLE_3_1, speed)
    mean = models.mean()
    low = float(mean.state[1])
    for design in (design_pi(mean, bandwidth=10.0), design_pid(mean, bandwidth=150.0)):
        print(f"  {describe(design)}")
        controller = SampledController(design, PERIOD, limit=400.0)
        for size in (1e-3, 5e-3, 25e-3):

            def reference(t: float, size: float = size) -> float:
                return low + size * (t >= 1.0 - 0.5 * PERIOD)

            loop = control_loop(
                TABLE_3_1, controller, reference, Inputs(speed=speed), initial=start, stop_time=2.0, fmu=fmu
            )
            linear = predict_loop(models, controller, reference, stop_time=2.0)
            # settled: within 1.1 times the error that the turning crank causes at the end, and 5 % of the step
            bound = 1.1 * np.abs(loop.position - loop.reference)[-143:].max() + 0.05 * size
            a, b = (run.metrics(band=bound, start=1.0, window=models.period) for run in (loop, linear))
            print(
                f"    {1e3 * size:3.0f} mm: within {1e3 * bound:.2f} mm after {_ms(a.settling_time)} (periodic model "
                f"{_ms(b.settling_time)}), peak force {a.peak_force:.1f} N ({b.peak_force:.1f} N), rms at the end "
                f"{1e3 * a.rms_error:.3f} mm ({1e3 * b.rms_error:.3f} mm), largest difference "
                f"{1e3 * largest_difference(loop, linear):.4f} mm"
            )


def _ms(seconds: float | None) -> str:
    return "never" if seconds is None else f"{1e3 * seconds:.0f} ms"


def balance(fmu: Path | None) -> None:
    """Balance the free crank of Table 3.1 at its lowest unstable equilibrium by the slider force alone; print the results."""
    upper = next(one for one in find_equilibria(TABLE_3_1) if not one.stable)
    model = linearise(TABLE_3_1, upper.state, upper.inputs)
    design = design_lqr(model, {"crank.angle": 1e2, "slider.position": 1e6}, 1.0)
    angle, position = upper.coordinates.tolist()
    print(f"Table 3.1, free crank: balance it at {degrees(angle):.3f} deg, u = {1e3 * position:.4f} mm")
    print(f"  poles without control {', '.join(f'{pole:.3f}' for pole in model.poles)} 1/s")
    print(f"  {describe(design)}")
    controller = SampledController(design, PERIOD)
    for lean in (0.01, 0.1, 0.2, 0.3):
        start = InitialState(crank_angle=angle + lean, slider_position=position)
        loop = control_loop(TABLE_3_1, controller, position, initial=start, stop_time=2.0, fmu=fmu)
        linear = predict_loop(model, controller, position, stop_time=2.0, deviation=[lean, 0.0, 0.0, 0.0])
        if loop.status:
            print(f"  from {lean:.2f} rad off: lost, {loop.message}; the linear model would have held it")
            continue
        gap = np.abs(loop.states[:, 0] - linear.states[:, 0]).max()
        print(
            f"  from {lean:.2f} rad off: {abs(loop.states[-1, 0] - angle):.1e} rad off after 2 s, peak force "
            f"{np.abs(loop.force).max():.2f} N, crank differs by up to {gap:.1e} rad from the linear model"
        )


def draw(folder: Path, models: PeriodicModel, designs: list[Design], loop: LoopResult) -> None:
    mean = models.mean()
    system = mean.to_state_space(("slider.position",), ("slider.force",))
    closed = {f"with {design.method}": design.closed_loop(("slider.position",)) for design in designs}
    figures.plot_bode(
        {"slider alone": system, **closed},
        unit="m/N",
        frequencies=np.geomspace(1.0, 2e3, 800),
        title="Rig 2, spring C, 585 rpm: slider force to slider position, mean model",
    ).savefig(folder / "linearisation-bode.png", dpi=120)
    figures.plot_bode(
        {design.method: design.loop for design in designs},
        frequencies=np.geomspace(1.0, 2e3, 800),
        margins=True,
        title="Rig 2, spring C, 585 rpm: open loops, mean model",
    ).savefig(folder / "linearisation-margins.png", dpi=120)
    figures.plot_poles(
        {"slider alone": system, **closed},
        title="Rig 2, spring C, 585 rpm: poles and zeros, mean model",
    ).savefig(folder / "linearisation-poles.png", dpi=120)
    before = models.motion()
    free = np.array([before(float(t))[1] for t in loop.time])
    first = loop.time <= 0.3
    panels = [
        Panel(
            x_label="time [s]",
            y_label="slider position [mm]",
            curves=[
                Curve(x=loop.time[first], y=1e3 * free[first], label="without control", line="--", colour="0.6"),
                Curve(x=loop.time[first], y=1e3 * loop.position[first], label=designs[-1].method),
            ],
            y_range=(-20.0, 30.0),
            legend_at="upper right",
        ),
        Panel(
            x_label="time [s]",
            y_label="slider force [N]",
            curves=[Curve(x=loop.time[first], y=loop.force[first], colour=figures.COLOURS[1])],
        ),
    ]
    figures.plot_curves(
        panels,
        title="Rig 2, spring C, 585 rpm: the slider kept still, nonlinear plant",
        size=(6.4, 2.4),
    ).savefig(folder / "linearisation-loop.png", dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fmu", type=Path, help="FiveBarSlider.fmu to run instead of the plant in process")
    parser.add_argument("--figures", type=Path, help="folder to write the figures into")
    options = parser.parse_args()
    if options.fmu and not options.fmu.exists():
        parser.error(f"--fmu {options.fmu}: it does not exist")
    if options.figures:
        try:
            options.figures.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            parser.error(f"--figures {options.figures}: the folder cannot be made ({error.strerror})")
    models, designs, loop = still(options.fmu)
    steps(options.fmu)
    balance(options.fmu)
    if options.figures:
        draw(options.figures, models, designs, loop)


if __name__ == "__main__":
    main()
