"""Damping and natural frequency from a decaying record, against the exact motion of a mass on a spring."""

from collections.abc import Callable
from math import exp, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from analysis import figures
from analysis.numerics.decay import fit_decay
from linkwork.errors import InputError, LinkworkError

from .conftest import cells

MASS, STIFFNESS, DAMPING = 0.6, 3000.0, 9.0


def free(t: NDArray[np.float64], damping: float = DAMPING, friction: float = 0.0) -> NDArray[np.float64]:
    """The mass let go 2 cm from rest, half swing by half swing about rest -+ friction / stiffness."""
    decay = damping / (2.0 * MASS)
    frequency = sqrt(STIFFNESS / MASS - decay**2)
    x = np.zeros(len(t))
    start = 0.02
    for n in range(int(t[-1] * frequency / pi) + 1):
        centre = np.sign(start) * friction / STIFFNESS
        if abs(start) < abs(centre):
            x[t >= n * pi / frequency] = start
            break
        s = t - n * pi / frequency
        swing = np.exp(-decay * s) * (np.cos(frequency * s) + decay / frequency * np.sin(frequency * s))
        x = np.where(s >= 0.0, centre + (start - centre) * swing, x)
        start = centre - (start - centre) * exp(-decay * pi / frequency)
    return x


def noisy(size: float, seed: int = 1, count: int = 4001) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    t = np.linspace(0.0, 0.8, count)
    return t, free(t) + size * 0.02 * np.random.default_rng(seed).standard_normal(len(t))


@pytest.mark.parametrize("offset", [0.0, 0.3, -7.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_clean_record(offset: float, sign: float) -> None:
    t = np.linspace(0.0, 0.8, 2001)
    found = fit_decay(t, sign * free(t) + offset)
    assert found.damping(MASS)[0] == pytest.approx(DAMPING, rel=1e-4)
    assert found.stiffness(MASS)[0] == pytest.approx(STIFFNESS, rel=1e-4)
    assert found.damping_ratio == pytest.approx(DAMPING / (2.0 * sqrt(STIFFNESS * MASS)), rel=1e-4)
    assert found.offset == pytest.approx(offset, abs=2e-6)
    assert found.cycle_decrements == pytest.approx(found.decrement, rel=1e-3)
    assert found.residual < 1e-4


def test_uneven_times() -> None:
    t = np.sort(np.random.default_rng(2).uniform(0.0, 0.8, 3000))
    assert fit_decay(t, free(t)).damping(MASS)[0] == pytest.approx(DAMPING, rel=1e-3)


def test_turning_points_of_a_pendulum_whose_period_changes() -> None:
    def rates(_: float, y: NDArray[np.float64]) -> list[float]:
        return [y[1], -0.12 * y[1] - 40.0 * sin(y[0])]

    def rate(_: float, y: NDArray[np.float64]) -> float:
        return float(y[1])

    t = np.linspace(0.0, 20.0, 4001)
    run = solve_ivp(rates, (0.0, 20.0), [1.0, 0.0], t_eval=t, events=rate, rtol=1e-9, atol=1e-12)
    found, known = fit_decay(t, run.y[0]).position, run.y_events[0][:, 0]
    assert found == pytest.approx(known[np.abs(known - found[0]).argmin() :][: len(found)], rel=0.01)


@pytest.mark.parametrize(("size", "count"), [(0.003, 4001), (0.01, 4001), (0.02, 181)])
def test_noise_is_within_the_standard_errors(size: float, count: int) -> None:
    """Over forty records the errors divided by their standard errors have about the spread of one; 181 are 20 a cycle."""
    scatter = []
    for seed in range(40):
        found = fit_decay(*noisy(size, seed, count))
        damping, error = found.damping(MASS)
        stiffness, width = found.stiffness(MASS)
        assert damping == pytest.approx(DAMPING, rel=10.0 * size)
        scatter.append(((damping - DAMPING) / error, (stiffness - STIFFNESS) / width))
    assert np.abs(np.mean(scatter, axis=0)).max() < 0.6
    spread = np.std(scatter, axis=0)
    assert spread.min() > 0.6
    assert spread.max() < 2.5


@pytest.mark.parametrize("friction", [0.5, 1.5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_dry_friction(friction: float, sign: float) -> None:
    t = np.linspace(0.0, 0.8, 4001)
    x = sign * free(t, 4.0, friction)
    found = fit_decay(t, x, friction=True)
    assert found.friction * STIFFNESS == pytest.approx(friction, rel=0.01)
    assert found.damping(MASS)[0] == pytest.approx(4.0, rel=0.02)
    # taken for a damper alone, the friction adds to it, and the decrement grows from cycle to cycle
    alone = fit_decay(t, x)
    assert alone.damping(MASS)[0] > 4.4
    assert alone.residual > 10.0 * found.residual
    assert (np.diff(alone.cycle_decrements) > 0.0).all()


@pytest.mark.parametrize("start", [0.0, 0.002, 0.004, 0.006, 0.008])
def test_eight_samples_per_cycle(start: float) -> None:
    """The samples nearest to a turning point are up to 45 deg from it, where a parabola is no cosine."""
    t = start + 0.011 * np.arange(70)
    found = fit_decay(t, free(t, 4.0, 0.5), friction=True)
    assert found.damping(MASS)[0] == pytest.approx(4.0, rel=0.01)
    assert found.friction * STIFFNESS == pytest.approx(0.5, rel=0.015)


@pytest.mark.parametrize(("friction", "dt"), [(0.5, 2e-4), (1.5, 2e-4), (1.5, 1e-3)])
def test_dry_friction_does_not_move_the_frequency(friction: float, dt: float) -> None:
    """The acceleration jumps at each turning point, the more, the smaller the swing: the frequency does not follow that."""
    t = np.arange(0.0, 0.8, dt)
    found = fit_decay(t, free(t, 4.0, friction), friction=True)
    assert found.stiffness(MASS)[0] == pytest.approx(STIFFNESS, rel=1e-4)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_a_fit_that_is_found_at_once_has_errors_in_any_unit(size: float) -> None:
    """Six turning points of a record without noise or friction."""
    t, damping = np.arange(0.0, 3.0, 1e-3), 0.11
    below = np.sqrt(1.0 - damping**2)
    swing = np.cos(20.0 * below * t) + damping / below * np.sin(20.0 * below * t)
    found = fit_decay(t, size * np.exp(-20.0 * damping * t) * swing, friction=True)
    assert found.damping_ratio == pytest.approx(damping, rel=1e-3)
    assert found.friction / size == pytest.approx(0.0, abs=1e-4)
    assert np.isfinite(found.friction_error)


def test_no_friction_is_found_where_there_is_none() -> None:
    found = fit_decay(*noisy(0.005), friction=True)
    assert abs(found.friction) < 3.0 * found.friction_error


T = np.linspace(0.0, 0.8, 401)


@pytest.mark.parametrize(
    ("time", "position", "words"),
    [
        (T, T[:-1], "lists of one length"),
        (T, np.where(T > 0.4, np.nan, free(T)), "not finite"),
        (free(T), T, "time does not increase"),
        (T, ["high"] * len(T), "must be numbers"),
        (T[:20], free(T[:20]), "turning points"),
        (T, np.where(T > 0.1, free(T, 40.0)[np.arange(len(T)) - 51], 0.02), "begin where the mass moves freely"),
        (T, np.zeros(len(T)), "0 turning points"),
        (T, T, "0 turning points"),
        (T, free(T)[::-1], "do not decay"),
        (T, np.random.default_rng(0).standard_normal(len(T)), "s apart"),
        ([], [], "record is empty"),
    ],
)
def test_what_is_no_decay(time: object, position: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        fit_decay(time, position)


@pytest.mark.parametrize("ratio", [0.2, 0.3, 0.4, 0.5])
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_strong_damping_is_fitted_to_the_whole_curve(ratio: float, noise: float) -> None:
    damping = 2.0 * ratio * sqrt(STIFFNESS * MASS)
    x = 3.0 + free(T, damping) + 0.02 * noise * np.random.default_rng(1).standard_normal(len(T))
    found = fit_decay(T, x)
    assert found.whole
    assert len(found.cycle_decrements) == 0
    value, error = found.damping(MASS)
    assert abs(value - damping) < 4.0 * error + 1e-6 * damping
    assert error < 2.0 * noise * damping + 1e-6 * damping
    stiffness, error = found.stiffness(MASS)
    assert abs(stiffness - STIFFNESS) < 4.0 * error + 1e-6 * STIFFNESS
    assert found.offset == pytest.approx(3.0, abs=1e-4)


def test_strong_damping_with_friction_is_refused_with_a_way_out() -> None:
    with pytest.raises(InputError, match="can be fitted without friction only"):
        fit_decay(T, free(T, 30.0, 0.5), friction=True)


@pytest.mark.parametrize("least", [0.0, 1.0, -0.1, float("nan")])
def test_least_swing(least: float) -> None:
    with pytest.raises(LinkworkError, match="least swing"):
        fit_decay(T, free(T), least_swing=least)


class TestCommand:
    """linkwork decrement."""

    @pytest.fixture
    def run(self, linkwork: Callable[..., Result]) -> Callable[..., str]:
        return lambda *options, code=0: linkwork("decrement record.csv", *options, code=code).output

    def write(self, header: str, separator: str = ",", columns: tuple[int, ...] = (0, 1)) -> None:
        t = np.linspace(0.0, 0.8, 2001)
        table = np.column_stack([1e3 * t, 1e3 * free(t) + 5.0, np.zeros(len(t))])
        np.savetxt("record.csv", table[:, columns], delimiter=separator, header=header, comments="")

    @pytest.mark.parametrize(
        ("header", "separator", "columns", "options"),
        [
            ("t,u", ",", (0, 1), ()),
            ("u [mm];nothing;t [ms]", ";", (1, 2, 0), ("--time", "t", "--position", "u [mm]")),
            ("", "\t", (0, 1), ()),
        ],
    )
    def test_numbers_and_files(self, run, header, separator, columns, options) -> None:
        self.write(header, separator, columns)
        rows = cells(run("--time-unit", "ms", "--unit", "mm", "--mass", "600 g", *options))
        assert float(rows["damping coefficient"][0]) == pytest.approx(DAMPING, rel=1e-3)
        assert float(rows["stiffness"][0]) == pytest.approx(STIFFNESS, rel=1e-3)
        assert float(rows["natural frequency"][0]) == pytest.approx(sqrt(STIFFNESS / MASS), rel=1e-3)
        assert Path("out/record-decrement.csv").read_text().startswith("time [s],position [mm],fit [mm]\n")
        assert Path("out/record-decrement.png").exists()

    @pytest.mark.parametrize(
        ("header", "separator", "options"),
        [
            ("t [ms],u [mm]", ",", ()),
            ("t (ms),u (mm)", ",", ("--unit", "mm")),
            ("# t [ms],u [V]", ",", ()),
            ("t [ticks];u [mm]", ";", ("--time-unit", "ms")),
        ],
    )
    def test_the_units_of_the_headings_hold(self, run, header, separator, options) -> None:
        self.write(header, separator)
        if separator == ";":
            Path("record.csv").write_text(Path("record.csv").read_text().replace(".", ","))
        rows = cells(run("--mass", "600 g", "--friction", "--no-plot", *options))
        assert float(rows["stiffness"][0]) == pytest.approx(STIFFNESS, rel=1e-3)
        assert float(rows["natural frequency"][0]) == pytest.approx(sqrt(STIFFNESS / MASS), rel=1e-3)
        # what the volts of a gauge are in metres is not known
        assert ("dry friction" in rows) == ("[V]" not in header)

    @pytest.mark.parametrize(
        ("header", "options", "code", "words"),
        [
            ("t [ms],u [mm]", ("--time-unit", "s"), 2, "--time-unit s: the column's heading says ms"),
            ("t [ms],u [mm]", ("--unit", "m"), 2, "--unit m: the column's heading says mm"),
            ("t [mm],u [mm]", (), 1, "the times are in 'mm' by their heading, which is no unit of time"),
        ],
    )
    def test_headings_that_contradict(self, run, header, options, code, words) -> None:
        self.write(header)
        assert words in " ".join(run(*options, code=code).split())

    @pytest.mark.parametrize(
        ("factor", "header", "options"),
        [(np.degrees(1.0), "t,a [deg]", ("--mass", "0.6 kg*m^2")), (1e3, "", ("--unit", "mm", "--mass", "0.6"))],
    )
    def test_friction_has_the_unit_of_a_force_or_a_moment(self, run, factor, header, options) -> None:
        t = np.linspace(0.0, 0.8, 4001)
        record = np.column_stack([t, factor * free(t, 4.0, 1.0)])
        np.savetxt("record.csv", record, delimiter=",", header=header, comments="")
        output = run("--friction", "--no-plot", *options)
        assert float(cells(output)["dry friction"][0]) == pytest.approx(1.0, rel=0.02)
        assert ("N.m.s/rad" in output) == bool(header)
        assert "record.csv: no unit in the heading, so column 1 in s (" in " ".join(output.split())

    def test_friction_that_was_not_fitted_is_said(self, run) -> None:
        t = np.linspace(0.0, 0.8, 4001)
        for friction in (0.0, 1.0):
            np.savetxt("record.csv", np.column_stack([t, free(t, 4.0, friction)]), delimiter=",")
            assert ("as with dry friction" in run("--no-plot")) == bool(friction)

    def test_strong_damping(self, run) -> None:
        np.savetxt("record.csv", np.column_stack([T, free(T, 40.0)]), delimiter=",", header="t [s],u [m]", comments="")
        output = run("--mass", "0.6")
        assert "401 samples" in output
        assert "the whole curve is fitted" in output
        assert Path("out/record-decrement.png").exists()

    @pytest.mark.parametrize(
        ("options", "code", "words"),
        [
            (("--position", "v"), 1, "there is no column 'v' in record.csv"),
            (("--time", "u", "--position", "t"), 1, "time does not increase"),
            (("--from", "795 s"), 1, "turning points"),
            (("--from", "9000 s"), 1, "record is empty"),
            (("--unit", "kg"), 1, "--unit"),
            (("--time-unit", "mm"), 1, "--time-unit"),
            (("--mass", "600 mm"), 1, "--mass"),
            (("--mass", "0"), 2, "above zero"),
        ],
    )
    def test_what_is_wrong_is_said(self, run, options, code, words) -> None:
        self.write("t,u")
        assert words in " ".join(run(*options, code=code).split())
        assert not Path("out").exists()


def test_a_decay_in_metres_is_shown_in_millimetres() -> None:
    time = np.linspace(0.0, 2.0, 2001)
    record = 3e-3 * np.exp(-1.2 * time) * np.cos(38.0 * time)
    axis = figures.plot(fit_decay(time, record), (time, record), unit="m").axes[0]
    assert axis.get_ylabel() == "position [mm]"
    assert all(1.0 < np.abs(line.get_ydata()).max() < 3.1 for line in axis.lines)
