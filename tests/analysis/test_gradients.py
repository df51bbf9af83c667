"""Gradients of motions and of their special points against differences of what is found anew at other parameters."""

import doctest
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import pi
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root

from analysis import InductionMotor, Inputs, find_orbit, periodic
from analysis.linkages import linkage
from analysis.periodic import Crossing, Drive, Family, PeriodicOrbit, crossing_gradient, motion_gradient, newton_orbit
from analysis.periodic.motion.discretisation import operating_point
from analysis.periodic.motion.drive import motion_scales
from analysis.periodic.motion.orbit import trial_orbit
from analysis.periodic.motion.variables import parameter_unit, parameter_value, with_values
from analysis.periodic.stability import sensitivity as gradients
from analysis.periodic.stability.variations import _GAUSS, Variations
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import InputError, LinkworkError, UnknownNameError
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.slider_crank import published as rahman
from tests.mechanisms import rotor_on_cart, torsion
from tests.strategies import seeded

pytestmark = pytest.mark.usefixtures("registered")

FloatArray = NDArray[np.float64]
RPM = RAD_S_PER_RPM
RIG_1_B, RIG_2_C = (SETS[f"rig-{name}"].parameters for name in ("1-spring-b", "2-spring-c"))
#: With so little damping a motion repeats itself after two turns.
LIGHT = replace(RIG_2_C, slider_damping=0.5)
ROTOR = next(iter(rotor_on_cart.MECHANISM.published.values())).parameters
#: The slider-crank of section 3.1 with a spring on the axial shift.
SPRUNG = replace(rahman.parameters(20.0, 232.0), shift_stiffness=8000.0, shift_damping=60.0)
SHIFTED = Drive(speed=rahman.CRANK_SPEED, forces={"axial.force": 0.0})
MOTOR = InductionMotor(breakdown_torque=2.0, breakdown_slip=0.3, synchronous_speed=50.0)
#: So weak that the speed hangs below the resonance.
WEAK = InductionMotor(breakdown_torque=0.06, breakdown_slip=0.3, synchronous_speed=60.0)
FIELD = "drive.torque.synchronous_speed"
#: Where the steps of a parameter that is zero come from.
SIZES = {"m": 0.1, "rad": 1.0, "kg": 0.1, "N": 1.0, "N.m": 0.1, "m/s2": 10.0, "kg.m2": 1e-3}


def difference(of: Callable[[float], FloatArray], at: float, step: float, levels: int = 2) -> FloatArray:
    """The derivative by central differences, extrapolated (Richardson)."""
    steps = [step * 0.5**level for level in range(levels)]
    values = [(of(at + h) - of(at - h)) / (2.0 * h) for h in steps]
    for order in range(1, levels):
        values = [(4.0**order * fine - coarse) / (4.0**order - 1.0) for coarse, fine in pairwise(values)]
    return values[0]


def greatest(*parts: FloatArray) -> float:
    """The root of the greatest sum of squares of periodic functions, from their Fourier series."""
    square = np.sum(np.square(parts), axis=0)
    c = np.fft.rfft(square) / len(square)
    k = np.arange(len(c))
    weights = np.where(k == 0, 1.0, 2.0) * c

    def at(angle: float, order: int) -> float:
        return float(np.real(np.sum(weights * (1j * k) ** order * np.exp(1j * k * angle))))

    angle = 2.0 * pi * float(square.argmax()) / len(square)
    for _ in range(8):
        angle -= at(angle, 1) / at(angle, 2)
    return float(np.sqrt(at(angle, 0)))


def amplitude(orbit: PeriodicOrbit) -> float:
    """Half the range of the first free coordinate: both extremes as those of a function above zero."""
    turn = orbit.turn(512 * orbit.turns)
    values = turn[turn.swings[0]]
    low, high = values.min(), values.max()
    far = 3.0 * (high - low)
    return 0.5 * (greatest(values - low + far) + greatest(high + far - values) - 2.0 * far - (high - low))


def step_of(orbit: PeriodicOrbit, name: str, relative: float) -> float:
    unit = parameter_unit(orbit.flow.mechanism, name)
    value = abs(parameter_value(orbit.parameters, orbit.drive, name))
    return relative * (value if value > 0.0 else SIZES[unit])


def changed(orbit: PeriodicOrbit, name: str, value: float) -> PeriodicOrbit:
    parameters, drive = with_values(orbit.parameters, orbit.drive, {name: value})
    return newton_orbit(parameters, drive, turns=orbit.turns, start=orbit.start, settle=False)


def close(found: FloatArray, exact: FloatArray, size: FloatArray | float, step: float) -> bool:
    """To a millionth, or to what the error of what is found, relative to its size, leaves of the difference."""
    return bool(np.all(np.abs(found - exact) <= 1e-6 * np.abs(exact) + 2e-10 * np.abs(size) / step))


def random_orbit(seed: int) -> PeriodicOrbit:
    parameters = seeded(seed).parameters
    smooth = {"slider_coulomb_friction": 0.0, "slider_damping": 20.0, "slider_stiffness": 2000.0, "gravity": 9.81}
    length = 0.4 * parameters.crank_length
    short = replace(parameters, **smooth, crank_length=length, slider_spring_free_position=0.0)
    return newton_orbit(short, Drive(speed=25.0))


#: Motions, and outputs whose peaks are checked.
MOTIONS: dict[str, tuple[Callable[[], PeriodicOrbit], tuple[str, ...]]] = {
    "rig 2 C": (lambda: newton_orbit(RIG_2_C, Drive(speed=500.0 * RPM)), ("drive.applied_torque", "pin.B")),
    "rig 1 B": (lambda: newton_orbit(RIG_1_B, Drive(speed=1000.0 * RPM)), ("drive.applied_torque", "pin.C")),
    "motor, force": (lambda: find_orbit(RIG_2_C, Inputs(torque=MOTOR, force=1.0)), ("drive.applied_torque", "pin.A")),
    "torque": (lambda: newton_orbit(TABLE_3_1, Drive(torque=0.2), start=(0.0, 0.0, 45.0)), ("slider.guide_force",)),
    "two turns": (lambda: newton_orbit(RIG_2_C, Drive(speed=480.0 * RPM), turns=2), ("pin.D",)),
    "doubled": (lambda: periodic.find_orbits(LIGHT, speed=1150.0 * RPM, turns=2).orbits[-1], ("pin.D",)),
    # the Fourier series of the check cannot hold what friction does
    "friction": (lambda: newton_orbit(replace(RIG_2_C, slider_coulomb_friction=0.3), Drive(speed=500.0 * RPM)), ()),
    "slider-crank": (lambda: newton_orbit(SPRUNG, SHIFTED), ("drive.applied_torque",)),
    "rotor, motor": (lambda: find_orbit(ROTOR, Inputs(torque=(MOTOR, -0.1))), ("cart.acceleration",)),
    "random 0": (lambda: random_orbit(0), ("pin.A",)),
    "random 7": (lambda: random_orbit(7), ("pin.B",)),
}
#: Those that every change is checked with.
FAST = ("rig 2 C", "slider-crank", "rotor, motor")


@pytest.mark.parametrize("name", [n if n in FAST else pytest.param(n, marks=pytest.mark.slow) for n in MOTIONS])
def test_a_motion_changes_with_every_parameter_as_its_differences_say(name: str) -> None:
    make, outputs = MOTIONS[name]
    orbit = make()
    motion = motion_gradient(orbit)

    def quantities(at: PeriodicOrbit) -> FloatArray:
        turn = at.turn(512 * at.turns)
        parts = [[p for p in (o, f"{o}.fx", f"{o}.fy") if p in turn.names] for o in outputs]
        peaks = [amplitude(at), *(greatest(*(turn[p] for p in part)) for part in parts)] if outputs else []
        return np.array([*at.start, at.largest, at.flow.period * at.turns / turn.period, *peaks])

    peaks = [motion.amplitude, *(motion.peak(output) for output in outputs)] if outputs else []
    gradients = [motion.largest, motion.speed, *peaks]
    exact = np.vstack([motion.start, *(g.by for g in gradients)])
    size = np.abs(quantities(orbit))
    size[: len(orbit.start)] = motion_scales(orbit.parameters, orbit.drive, orbit.start)
    assert [g.value for g in gradients] == pytest.approx(size[len(orbit.start) :].tolist(), rel=1e-9)
    for column, parameter in enumerate(motion.names):
        value = motion.values[column]
        if value == 0.0 and _not_negative(orbit, parameter):
            continue
        # the large motion bends more
        step = step_of(orbit, parameter, 5e-4 if name == "doubled" else 2e-3)
        found = difference(lambda v, p=parameter: quantities(changed(orbit, p, v)), value, step)
        assert close(found, exact[:, column], size, step), (parameter, found, exact[:, column])


def _not_negative(orbit: PeriodicOrbit, name: str) -> bool:
    variable = orbit.flow.mechanism.mechanism_variables.get(name)
    return variable is not None and variable.minimum == 0.0


def test_the_cart_of_a_rotor_has_its_closed_form() -> None:
    """At a constant speed it is a linear oscillator: amplitude m r w^2 / |k - M w^2 + i c w|, multipliers by its roots."""
    speed = 35.0
    motion = motion_gradient(newton_orbit(ROTOR, Drive(speed=speed)))
    m, r, k, c = ROTOR.rotor_mass, ROTOR.rotor_radius, ROTOR.cart_stiffness, ROTOR.cart_damping
    mass = ROTOR.cart_mass + m
    a, b = k - mass * speed**2, c * speed
    size = m * r * speed**2 / np.hypot(a, b)
    assert motion.amplitude.value == pytest.approx(size, rel=1e-10)
    expected = {
        "rotor.radius": size / r,
        "cart.stiffness": -size * a / (a * a + b * b),
        "cart.damping": -size * b * speed / (a * a + b * b),
        "rotor.mass": size / m + size * a * speed**2 / (a * a + b * b),
        "gravity": 0.0,
    }
    for name, value in expected.items():
        assert motion.amplitude[name] == pytest.approx(value, rel=1e-8, abs=1e-13)
    # the amplitude is proportional to the radius, and m r is a constant of the equations
    curvature = motion.amplitude_curvature("rotor.radius")
    assert curvature.value == pytest.approx(size / r, rel=1e-8)
    assert curvature["rotor.mass"] == pytest.approx(expected["rotor.mass"] / r, rel=1e-8)
    assert curvature["cart.damping"] == pytest.approx(expected["cart.damping"] / r, rel=1e-8)
    assert curvature["rotor.radius"] == pytest.approx(0.0, abs=1e-8 * size / r**2)
    # |multiplier| = exp(-c T / (2 M))
    largest = np.exp(-c * pi / (speed * mass))
    assert motion.largest["cart.damping"] == pytest.approx(-largest * pi / (speed * mass), rel=1e-8)
    assert motion.largest["drive.speed"] == pytest.approx(largest * c * pi / (mass * speed**2), rel=1e-8)


def test_resonance_of_the_rotor_has_its_closed_form() -> None:
    """The amplitude over the speed is greatest at w^2 = k^2 / (k M - c^2 / 2), M with the rotor."""
    m, r, k, c = ROTOR.rotor_mass, ROTOR.rotor_radius, ROTOR.cart_stiffness, ROTOR.cart_damping
    mass = ROTOR.cart_mass + m
    resonance = k / np.sqrt(k * mass - 0.5 * c * c)
    found = periodic.extremum_gradient(newton_orbit(ROTOR, Drive(speed=1.03 * resonance)), "drive.speed")
    assert found.place.value == pytest.approx(resonance, rel=1e-9)
    # along a branch too, where an amplitude alone would leave it open to the root of its error
    low, high = 0.9 * resonance, 1.1 * resonance
    (top,) = periodic.frequency_response(ROTOR, low, high, doublings=0, greatest_step=5e-2).maxima()
    assert top.parameter == pytest.approx(resonance, rel=1e-9)
    # so does a branch over what a function says, to what that leaves
    family = Family(parameters=ROTOR, drive=Drive(speed=low), vary=lambda speed: (ROTOR, Drive(speed=speed)))
    (top,) = periodic.extrema(periodic.follow(family, newton_orbit(ROTOR, Drive(speed=low)), low, low=low, high=high))
    assert top.parameter == pytest.approx(resonance, rel=1e-4)
    assert found.amplitude.value == pytest.approx(m * r / (c * np.sqrt(mass / k - (0.5 * c / k) ** 2)), rel=1e-9)
    inner = k * mass - 0.5 * c * c
    expected = {
        "cart.stiffness": resonance / k - 0.5 * resonance * mass / inner,
        "cart.damping": 0.5 * resonance * c / inner,
        "cart.mass": -0.5 * resonance * k / inner,
        "rotor.radius": 0.0,
    }
    for name, value in expected.items():
        assert found.place[name] == pytest.approx(value, rel=1e-6, abs=1e-7)
    assert found.amplitude["rotor.radius"] == pytest.approx(found.amplitude.value / r, rel=1e-8)
    assert set(found.amplitude.movers(2)) == {"cart.damping", "rotor.radius"}


def relocated(orbit: PeriodicOrbit, kind: Crossing, along: str, name: str, value: float) -> FloatArray:
    """Place and amplitude of a crossing at another parameter: SciPy's solution of y(T) = y(0) and the test."""
    parameters, drive = with_values(orbit.parameters, orbit.drive, {name: value})
    here = parameter_value(parameters, drive, along)
    scale = np.append(motion_scales(parameters, drive, orbit.start), abs(here))

    def operation(z: FloatArray) -> tuple[Any, Drive]:
        return with_values(parameters, drive, {along: float(z[-1] * scale[-1])})

    def residual(z: FloatArray) -> FloatArray:
        period = operating_point(*operation(z)).period(z[:-1] * scale[:-1], orbit.turns)
        return np.append(period.shift / scale[:-1], periodic.crossing_test(period.monodromy, kind))

    found = root(residual, np.append(orbit.start, here) / scale, tol=1e-13, options={"eps": 1e-7}).x
    there = replace(orbit, parameters=operation(found)[0], drive=operation(found)[1], start=found[:-1] * scale[:-1])
    return np.array([found[-1] * scale[-1], amplitude(there)])


#: Parameters, along, range of the branch (rpm, N.m) with its beginning first, direction, turns and guess, kind.
POINTS: dict[str, tuple[Any, str, tuple[float, float, float], int, tuple[int, Any], Crossing]] = {
    "fold": (RIG_1_B, "drive.speed", (1000.0, 990.0, 1100.0), 1, (1, None), Crossing.FOLD),
    "fold, torque": (RIG_2_C, "drive.torque", (0.04, 0.03, 0.06), 1, (1, (0.0, 0.0, 60.0)), Crossing.FOLD),
    "fold, motor": (RIG_2_C, FIELD, (60.0, 55.0, 80.0), 1, (1, None), Crossing.FOLD),
    "doubling": (LIGHT, "drive.speed", (1180.0, 1170.0, 1185.0), -1, (1, None), Crossing.PERIOD_DOUBLING),
    "doubled": (RIG_1_B, "drive.speed", (920.0, 914.0, 925.0), -1, (2, (0.0185, -16.449)), Crossing.PERIOD_DOUBLING),
    "torus": (TABLE_3_1, "drive.torque", (0.12, 0.1, 0.13), -1, (1, (0.0, 0.0, 90.0)), Crossing.TORUS),
}


@pytest.mark.parametrize("name", [n if n == "fold" else pytest.param(n, marks=pytest.mark.slow) for n in POINTS])
def test_a_special_point_moves_as_its_differences_say(name: str) -> None:
    parameters, along, ends, direction, (turns, guess), kind = POINTS[name]
    begin, low, high = (end * (RPM if along == "drive.speed" else 1.0) for end in ends)
    drive = Drive(motor=WEAK) if along == FIELD else Drive(**{along.removeprefix("drive."): begin})
    family = Family(parameters=parameters, drive=drive, vary=along)
    orbit = newton_orbit(parameters, drive, turns=turns, start=guess)
    branch = periodic.follow(family, orbit, begin, low=low, high=high, direction=direction)
    point = next(s for s in branch.special if s.kind is kind)
    chosen = ("slider.damping", "slider.stiffness", "crank.length", "rocker.mass", "coupler.cog_angle", "slider.force")
    found = periodic.special_gradient(family, point, chosen)
    assert found.place.value == pytest.approx(point.parameter, rel=1e-8)
    size = np.array([found.place.value, found.amplitude.value])
    for column, parameter in enumerate(chosen):
        step = step_of(found.orbit, parameter, 2e-3)
        moved = partial(relocated, found.orbit, kind, along, parameter)
        differences = difference(moved, found.place.at[column], step, levels=3)
        exact = np.array([found.place.by[column], found.amplitude.by[column]])
        assert close(differences, exact, size, step), (parameter, differences, exact)
    # the normal of the boundary over two parameters is across the direction in which it goes
    normal = periodic.boundary_gradient(found.orbit, kind, (along, "slider.damping"))
    assert normal["slider.damping"] / normal[along] == pytest.approx(-found.place["slider.damping"], rel=1e-8)
    # from a motion beside it the same point is found
    beside = changed(found.orbit, along, found.place.value * (0.998 if kind is Crossing.FOLD else 1.001))
    again = crossing_gradient(beside, kind, along, ("slider.damping",))
    assert again.place.value == pytest.approx(found.place.value, rel=1e-9)
    assert again.place.by == pytest.approx(found.place.by[:1], rel=1e-6)


@pytest.mark.slow
def test_a_resonance_moves_as_its_differences_say() -> None:
    """Where the derivative of the amplitude, which is checked above, is zero at other parameters, by the secant method."""

    def resonance(orbit: PeriodicOrbit, name: str, value: float) -> FloatArray:
        parameters, drive = with_values(orbit.parameters, orbit.drive, {name: value})
        speeds, slopes = [drive.speed or 0.0, 1.0001 * (drive.speed or 0.0)], []
        for _ in range(8):
            there = newton_orbit(parameters, replace(drive, speed=speeds[len(slopes)]), start=orbit.start, settle=False)
            slopes.append(motion_gradient(there, ("drive.speed",)).amplitude["drive.speed"])
            if len(slopes) > 1:
                step = slopes[-1] * (speeds[-1] - speeds[-2]) / (slopes[-1] - slopes[-2])
                speeds.append(speeds[-1] - step)
                if abs(step) < 1e-10 * speeds[-1]:
                    break
        return np.array([speeds[-1], amplitude(there)])

    response = periodic.frequency_response(RIG_2_C, 560.0 * RPM, 620.0 * RPM, doublings=0)
    (peak,) = response.maxima()
    found = periodic.special_gradient(response.family, peak)
    assert found.place.value == pytest.approx(peak.parameter, rel=1e-9)
    assert found.amplitude.value == pytest.approx(peak.amplitude, rel=1e-6)
    size = np.array([found.place.value, found.amplitude.value])
    for name in ("slider.damping", "slider.stiffness", "crank.length", "rocker.inertia", "slider.guide_angle"):
        column = found.place.names.index(name)
        step = step_of(found.orbit, name, 4e-3)
        differences = difference(partial(resonance, found.orbit, name), found.place.at[column], step)
        exact = np.array([found.place.by[column], found.amplitude.by[column]])
        assert close(differences, exact, size, step), (name, differences, exact)
    # a stiffer spring by 1 % resonates half a percent higher: w^2 = k / m
    assert found.place.elasticities["slider.stiffness"] == pytest.approx(0.5, abs=0.02)


def test_tests_of_crossings_are_those_of_the_monodromy_matrix() -> None:
    orbit = newton_orbit(TABLE_3_1, Drive(torque=0.2), start=(0.0, 0.0, 45.0))
    motion = motion_gradient(orbit, ("slider.damping", "drive.torque"))
    for kind in Crossing:
        test = motion.test(kind)
        assert test.value == pytest.approx(float(periodic.crossing_test(orbit.monodromy, kind)), rel=1e-10)
        for column, name in enumerate(motion.names):
            step = step_of(orbit, name, 2e-3)
            moved = partial(changed, orbit, name)
            found = difference(lambda v: periodic.crossing_test(moved(v).monodromy, kind), motion.values[column], step)  # noqa: B023
            assert close(found, test.by[column], 1.0, step)


def in_pieces(orbit: PeriodicOrbit, name: str, value: float) -> PeriodicOrbit:
    """The motion at another parameter by Newton's method on y at the stations."""
    parameters, drive = with_values(orbit.parameters, orbit.drive, {name: value})
    angles, starts = orbit.stations.angles, orbit.stations.starts.copy()
    k, n = starts.shape
    for _ in range(6):
        ends, matrices, *_ = operating_point(parameters, drive).shoot(angles, starts)
        jacobian = np.zeros((k, n, k, n))
        for piece in range(k):
            jacobian[piece, :, piece] = matrices[piece]
            jacobian[piece, :, (piece + 1) % k] -= np.eye(n)
        gaps = ends - np.roll(starts, -1, axis=0)
        starts -= np.linalg.solve(jacobian.reshape(k * n, k * n), gaps.ravel()).reshape(k, n)
    stations = orbit.stations._replace(starts=starts)
    return replace(orbit, parameters=parameters, drive=drive, start=starts[0].copy(), stations=stations)


@pytest.mark.slow
def test_an_unstable_motion_that_is_followed_in_pieces() -> None:
    """A multiplier of thousands: the derivatives of the motion are as good as those of a stable one."""
    orbit = newton_orbit(RIG_1_B, Drive(speed=1200.0 * RPM))
    family = Family(parameters=RIG_1_B, drive=orbit.drive)
    branch = periodic.follow(family, orbit, 1200.0 * RPM, low=500.0 * RPM, high=1300.0 * RPM, direction=-1)
    grown = [o for o in branch.orbits if o.stations is not None and o.largest > 1e3]
    orbit = grown[len(grown) // 2]
    motion = motion_gradient(orbit, ("drive.speed", "slider.damping", "crank.length"))
    for column, name in enumerate(motion.names):
        step = step_of(orbit, name, 1e-4)

        def size(value: float, name: str = name) -> FloatArray:
            return np.array([amplitude(in_pieces(orbit, name, value))])

        found = difference(size, motion.values[column], step)
        assert close(found, motion.amplitude.by[column : column + 1], motion.amplitude.value, step), name


@pytest.mark.slow
@pytest.mark.parametrize("law", ["c*max(x - g, 0)", "c*max(x - g, 0)**1.5", "c*max(x - g, 0)**2.5"])
def test_a_motion_against_a_stop_changes_as_its_differences_say(law: str) -> None:
    """The derivatives of the rates jump where the block meets the stop, or change like a root; multipliers move with it."""
    bar = linkage("yoke", ground={"A": (0.0, 0.0)}, gravity=0)
    bar.body("crank", bar=("A", "B"), length=0.01, mass=0.1, inertia=1e-4)
    bar.body("yoke", points={"Y": (0.0, 0.0)}, mass=1.0, inertia=1e-3)
    bar.body("block", points={"Q": (0.0, 0.0)}, mass=2.0, inertia=1e-3)
    bar.slide("guide", body="yoke", through="A").slide("way", body="block", on="yoke", through="Y")
    bar.slot("slot", pin="B", on="yoke", through="Y", direction=0.5 * pi)
    bar.spring("soft", at="way", stiffness=800.0, free=0, damping=4.0)
    stiff = 2e3 if law.endswith(")") else 2e6 if law.endswith("1.5") else 2e8
    bar.spring("stop", at="way", law=law, constants={"c": stiff, "g": 0.001})
    bar.freedom("turn", "A", speed=25.0).freedom("shift", "way", start=0.0)
    orbit = newton_orbit(bar.mechanism().first_set.parameters, Drive(speed=25.0))
    motion = motion_gradient(orbit, ("stop.g", "soft.stiffness", "block.mass", "drive.speed"))
    for column, name in enumerate(motion.names):
        step = step_of(orbit, name, 2e-3)

        def sizes(value: float, name: str = name) -> FloatArray:
            there = changed(orbit, name, value)
            return np.append(there.start, there.monodromy.trace())

        found = difference(sizes, motion.values[column], step)
        exact = np.append(motion.start[:, column], motion.monodromy.trace()[column])
        assert found == pytest.approx(exact, rel=1e-3), name


def test_the_end_of_a_motion_that_is_not_closed_is_no_bend_of_a_law() -> None:
    closed = newton_orbit(RIG_2_C, Drive(speed=50.0))
    orbit, _ = trial_orbit(closed.point, closed.start + 0.1 * closed.scale, 1)
    counts = [len(motion_gradient(motion, ("slider.stiffness",)).variations.h) for motion in (closed, orbit)]
    assert counts[1] == counts[0]


@pytest.mark.slow
def test_friction_by_contact_forces_can_be_added_to_a_motion_without() -> None:
    """The derivative at none, from the side on which there is some."""
    orbit = newton_orbit(RIG_2_C, Drive(speed=500.0 * RPM))
    assert "slider.friction_coefficient" not in periodic.gradient_names(orbit.parameters, orbit.drive)
    (slope,) = motion_gradient(orbit, ("slider.friction_coefficient",)).amplitude.by

    def size(coefficient: float) -> float:
        return amplitude(changed(orbit, "slider.friction_coefficient", coefficient))

    h = 1e-3
    forward = (-3.0 * size(0.0) + 4.0 * size(h) - size(2.0 * h)) / (2.0 * h)
    assert slope == pytest.approx(forward, rel=1e-3)


def test_the_example_says_what_is_so() -> None:
    assert doctest.testmod(gradients).failed == 0


def test_what_has_no_gradient_says_so() -> None:
    orbit = newton_orbit(RIG_2_C, Drive(speed=500.0 * RPM))
    with pytest.raises(UnknownNameError, match=r"slider.dampin"):
        motion_gradient(orbit, ("slider.dampin",))
    with pytest.raises(InputError, match=r"drive is by speed; give drive.torque in its place"):
        motion_gradient(orbit, ("drive.torque",))
    motion = motion_gradient(orbit, ("slider.damping",))
    with pytest.raises(UnknownNameError, match=r"slider.mass"):
        motion.amplitude["slider.mass"]
    with pytest.raises(UnknownNameError, match=r"pin.Z"):
        motion.peak("pin.Z")
    with pytest.raises(LinkworkError, match="no extremum"):
        periodic.extremum_gradient(newton_orbit(RIG_2_C, Drive(speed=200.0 * RPM)), "drive.speed")
    with pytest.raises(LinkworkError, match="no period doubling"):
        crossing_gradient(orbit, Crossing.PERIOD_DOUBLING, "drive.speed")
    # nothing moves a rotor without excitation
    still = newton_orbit(torsion.Parameters(rotor_stiffness=1.0, rotor_damping=0.1), Drive(speed=0.5))
    with pytest.raises(LinkworkError, match="no extremum"):
        periodic.extremum_gradient(still, "drive.speed")
    # what two multipliers of an undamped motion are multiplied to is 1 at any speed
    undamped = newton_orbit(replace(RIG_2_C, slider_damping=0.0), Drive(speed=500.0 * RPM))
    with pytest.raises(LinkworkError):
        crossing_gradient(undamped, Crossing.TORUS, "drive.speed")
    family = Family(parameters=RIG_2_C, drive=orbit.drive, vary=lambda value: (RIG_2_C, Drive(speed=value)))
    peak = periodic.Extremum(parameter=1.0, amplitude=1.0, stability=periodic.Stability.STABLE, orbit=orbit)
    with pytest.raises(InputError, match="is a function"):
        periodic.special_gradient(family, peak)
    nothing = periodic.Gradient(value=0.0, names=("a",), by=np.ones(1), at=np.ones(1))
    with pytest.raises(InputError, match="no elasticities"):
        nothing.movers()


@pytest.mark.parametrize("panel", [0, 3, 5])
@pytest.mark.parametrize("place", [-0.5, 0.4])
def test_the_greatest_value_is_found_wherever_in_a_panel_it_lies(panel: int, place: float) -> None:
    x = 2.0 * _GAUSS.nodes - 1.0
    values = np.full((6, len(x)), -1.0)
    # above the others next to its place alone
    values[panel] = 0.1 - 20.0 * (x - place) ** 2
    value, found = Variations.greatest_value(SimpleNamespace(h=np.ones(6)), values)
    assert (value, found.panel, found.position) == pytest.approx((0.1, panel, place), abs=1e-12)
    assert found.weights @ values[panel] == pytest.approx(value, abs=1e-12)
