"""A linkage in the plane: against the plant, dense sampling, brute-force circuits, and bars integrated numerically."""

from dataclasses import replace
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.numerics.fourier import FourierSeries
from analysis.synthesis import Linkage, MachineSpec, SecondCrank, SliderMotion, Verdicts, judge
from linkwork.errors import AssemblyError, ParameterError
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from tests.linkages import drawn, linkages


def moved(linkage: Linkage) -> Linkage:
    """The linkage with a slider whose motion is small beside the crank, and small enough for the links to stay joined."""
    a = 0.1 * linkage.crank_length
    while True:
        series = FourierSeries(np.array([0.05, 0.5, -0.3]) * a, np.array([0.0, 0.4, 0.2]) * a)
        made = replace(linkage, pivot=SliderMotion(series, 0.8))
        if made.least_transmission > 0.1:
            return made
        a *= 0.5


class TestAgainstThePlant:
    @pytest.mark.parametrize("slides", [False, True])
    @settings(max_examples=25)
    @given(linkage=linkages())
    def test_path_and_angles_are_the_plants_turned_and_shifted(self, slides: bool, linkage: Linkage) -> None:
        if slides:
            linkage = moved(linkage)
        plant = MachineSpec().sliding_five_bar(linkage)
        p = plant.constants()
        phi = np.linspace(-3.0, 3.0, 9)
        path, rocker = linkage.path(phi), linkage.rocker_angle(phi)
        coupler, transmission = linkage.coupler_angle(phi), linkage.transmission(phi)
        series = linkage.pivot.series(phi) if isinstance(linkage.pivot, SliderMotion) else np.zeros(9)
        for k, u in enumerate(series):
            g = kinematics.position(phi[k] + linkage.crank_phase, u, p)
            x, y = kinematics.coupler_point(g, p)
            place = complex(linkage.pivot_x, linkage.pivot_y) + np.exp(1j * plant.ground_inclination) * complex(x, y)
            assert abs(complex(*path[k]) - place) < 1e-12
            th3, th4 = kinematics.link_angles(g, p)
            turned = th4 + linkage.output_angle
            assert abs(np.exp(1j * rocker[k]) - np.exp(1j * turned)) < 1e-12
            turned = th3 + linkage.ground_angle + linkage.output_angle
            assert abs(np.exp(1j * coupler[k]) - np.exp(1j * turned)) < 1e-12
            angle = kinematics.transmission_angle(g, p)
            assert transmission[k] == pytest.approx(min(angle, pi - angle), abs=1e-12)

    @settings(max_examples=25)
    @given(linkage=linkages(), phi=st.floats(-7.0, 7.0))
    def test_pins_are_as_far_apart_as_the_links_are_long(self, linkage: Linkage, phi: float) -> None:
        linkage = replace(moved(linkage), branch=-linkage.branch)
        z = {name: complex(*place) for name, place in linkage.pins(phi).items()}
        links = {"AB": "crank_length", "BC": "coupler_length", "CD": "rocker_length", "AE": "ground_length"}
        for (begin, end), name in (links | {"BP": "point_distance"}).items():
            assert abs(z[begin] - z[end]) == pytest.approx(getattr(linkage, name), rel=1e-12)
        assert complex(*linkage.path([phi])[0]) == pytest.approx(z["P"], abs=1e-12)
        # branch: C to the left of B -> D
        side = ((z["D"] - z["B"]).conjugate() * (z["C"] - z["B"])).imag
        assert np.sign(side) == linkage.branch
        # the slider travels along its guide
        travel = (z["D"] - z["E"]) * np.exp(-1j * (linkage.ground_angle + linkage.pivot.guide_angle))
        assert travel == pytest.approx(linkage.pivot.series(phi), abs=1e-12)

    def test_angles_are_continuous_over_turns(self) -> None:
        # a drag link, whose coupler and rocker turn with the crank
        linkage = Linkage(ground_length=0.5, crank_length=1.0, coupler_length=0.9, rocker_length=0.9)
        phi = np.linspace(0.0, 4.0 * pi, 200)
        assert linkage.grashof == "drag-link"
        for angle in (linkage.rocker_angle(phi), linkage.coupler_angle(phi)):
            assert np.abs(np.diff(angle)).max() < 0.3
        assert linkage.rocker_angle(phi)[-1] - linkage.rocker_angle(phi)[0] == pytest.approx(4.0 * pi)


class TestSecondCrank:
    def test_the_rocker_pivot_goes_round_it(self) -> None:
        series = FourierSeries(np.array([0.0, 0.1]), np.array([0.0, 0.2]))
        pivot = SecondCrank(0.05, ratio=2.0, phase=0.4, series=series)
        linkage = replace(drawn(np.random.default_rng(1)), crank_length=0.05).with_pivot(pivot)
        for phi in (0.0, 1.3, 5.0):
            z = {name: complex(*place) for name, place in linkage.pins(phi).items()}
            psi = 2.0 * phi + 0.4 + 0.1 * cos(phi) + 0.2 * sin(phi)
            assert z["D"] - z["E"] == pytest.approx(0.05 * np.exp(1j * (psi + linkage.ground_angle)), abs=1e-12)
        assert abs(complex(*linkage.path([0.0])[0]) - complex(*linkage.path([2.0 * pi])[0])) < 1e-12

    def test_the_plant_has_none(self) -> None:
        linkage = drawn(np.random.default_rng(1)).with_pivot(SecondCrank(0.2))
        with pytest.raises(ParameterError, match="five-bar slider"):
            MachineSpec().sliding_five_bar(linkage)


# lengths l1, l2, l3, l4: the shortest and the longest against the others (Grashof)
TYPES = {
    "crank-rocker": (1.0, 0.3, 0.9, 0.8),
    "drag-link": (0.3, 1.0, 0.9, 0.8),
    "double-rocker": (1.0, 0.9, 0.3, 0.8),
    "rocker-crank": (1.0, 0.9, 0.8, 0.3),
    "triple-rocker": (1.0, 0.5, 0.6, 0.7),
    "change-point": (1.0, 0.4, 0.8, 0.6),
}


def four_bar(l1: float, l2: float, l3: float, l4: float) -> Linkage:
    return Linkage(ground_length=l1, crank_length=l2, coupler_length=l3, rocker_length=l4, point_distance=0.4)


class TestGrashof:
    @pytest.mark.parametrize("type_", TYPES)
    def test_types(self, type_: str) -> None:
        assert four_bar(*TYPES[type_]).grashof == type_

    @settings(max_examples=150)
    @given(lengths=st.tuples(*[st.floats(0.1, 1.0)] * 4))
    def test_the_type_says_which_links_turn(self, lengths: tuple[float, float, float, float]) -> None:
        """By brute force: a link turns fully against its neighbour if the other two can close every gap."""

        def turns(a: float, b: float, c: float, d: float) -> bool:
            """Whether a turns fully against b, c and d joining their ends."""
            gap = np.hypot(b - a * np.cos(ANGLES), a * np.sin(ANGLES))
            return bool((gap <= c + d).all() and (gap >= abs(c - d)).all())

        l1, l2, l3, l4 = lengths
        linkage = four_bar(*lengths)
        excess = 2.0 * (min(lengths) + max(lengths)) - sum(lengths)
        if abs(excess) < 1e-3 or np.diff(np.sort(lengths)).min() < 1e-3:
            return
        crank, rocker = turns(l2, l1, l3, l4), turns(l4, l1, l3, l2)
        coupler = turns(l3, l2, l4, l1)
        assert linkage.turns_fully == crank
        neither = "double-rocker" if coupler else "triple-rocker"
        names = {(True, True): "drag-link", (True, False): "crank-rocker", (False, True): "rocker-crank"}
        assert linkage.grashof == names.get((crank, rocker), neither)


ANGLES = np.linspace(0.0, 2.0 * pi, 721)


class TestTransmission:
    @pytest.mark.parametrize("slides", [False, True])
    @settings(max_examples=40)
    @given(linkage=linkages())
    def test_range_is_what_dense_sampling_finds(self, slides: bool, linkage: Linkage) -> None:
        if slides:
            linkage = moved(linkage)
        g = linkage.directions(np.linspace(0.0, 2.0 * pi, 20000))
        angle = np.arctan2(np.abs(g[5]), g[4])
        low, high = linkage.transmission_range()
        assert low == pytest.approx(angle.min(), abs=5e-3 if slides else 1e-6)
        assert high == pytest.approx(angle.max(), abs=5e-3 if slides else 1e-6)
        assert linkage.least_transmission == pytest.approx(min(low, pi - high))


class TestVerdicts:
    def judged(self, linkage: Linkage, *rotation: float, closed: bool = False) -> Verdicts:
        return judge(linkage, np.array(rotation), closed=closed)

    @pytest.mark.parametrize(
        ("links", "rotation", "closed", "expected"),
        [
            (TYPES["crank-rocker"], (0.0, 2.0, 4.0), False, {"sound": True, "full_turn": True}),
            # joined at both rotations, but not half a turn on
            ((1.0, 0.5, 0.6, 0.7), (0.3, 6.0), False, {"circuit": False, "branch": False, "full_turn": False}),
            ((1.0, 0.5, 0.6, 0.7), (0.3, 6.0), False, {"greatest_transmission": pi, "sound": False}),
            ((1.0, 0.5, 0.6, 0.7), (-0.5, 0.3, 1.0), False, {"sound": True, "grashof": "triple-rocker"}),
            # a change point: coupler and rocker collinear at a crank angle of pi, l1 + l2 = l3 + l4
            ((1.0, 0.5, 0.75, 0.75), (2.5, 4.0), False, {"circuit": True, "branch": False}),
            ((1.0, 0.5, 0.75, 0.75), (-2.5, 2.5), False, {"sound": True}),
            (TYPES["crank-rocker"], (0.0, 2.0, 1.0), False, {"order": False, "defects": ("order defect",)}),
            (TYPES["crank-rocker"], (2.0, 1.0, 0.5), False, {"order": True}),
            # of a closed path the whole turn counts
            ((1.0, 0.5, 0.6, 0.7), (-0.2, 0.2), False, {"sound": True}),
            ((1.0, 0.5, 0.6, 0.7), (-0.2, 0.2), True, {"sound": False}),
        ],
    )
    def test_defects(self, links: Any, rotation: Any, closed: bool, expected: dict[str, Any]) -> None:
        verdicts = self.judged(four_bar(*links), *rotation, closed=closed)
        assert {name: getattr(verdicts, name) for name in expected} == expected

    def test_words(self) -> None:
        verdicts = self.judged(four_bar(*TYPES["crank-rocker"]), 0.0, 2.0, 4.0)
        assert str(verdicts).startswith("crank-rocker, full turn, transmission angle 48.2 to ")

    @pytest.mark.parametrize("phase", [0.0, 0.7, -2.2])
    def test_the_extremes_are_seen_between_the_stations(self, phase: float) -> None:
        linkage = replace(four_bar(*TYPES["crank-rocker"]), crank_phase=phase)
        low, high = linkage.transmission_range()
        verdicts = self.judged(linkage, -0.1 - phase, pi + 0.1 - phase)
        assert verdicts.least_transmission == pytest.approx(low, abs=1e-12)
        assert verdicts.greatest_transmission == pytest.approx(high, abs=1e-12)
        verdicts = self.judged(linkage, 0.5 - phase, 2.0 - phase)
        angle = np.arccos(linkage.directions(np.array([0.5, 2.0]) - phase)[4])
        assert verdicts.least_transmission == pytest.approx(angle.min(), abs=1e-12)
        assert verdicts.greatest_transmission == pytest.approx(angle.max(), abs=1e-12)

    def test_a_slider_can_save_the_turn(self) -> None:
        # l1 + l2 = 1.5 > l3 + l4 = 1.3: with D drawn in by 0.3 half a turn on, it is joined
        linkage = four_bar(1.0, 0.5, 0.6, 0.7)
        pivot = SliderMotion(FourierSeries(np.array([-0.15, 0.15]), np.array([0.0, 0.0])))
        assert not linkage.turns_fully
        assert linkage.with_pivot(pivot).turns_fully
        assert self.judged(linkage.with_pivot(pivot), 0.0, 6.0).sound


class TestFiveBar:
    WIDTH, THICKNESS, DENSITY = 0.03, 0.004, 2700.0

    def bars(self, linkage: Linkage) -> FiveBarParameters:
        return MachineSpec(density=self.DENSITY, width=self.WIDTH, thickness=self.THICKNESS).sliding_five_bar(linkage)

    def integrated(self, *bars: tuple[float, float, float]) -> tuple[float, complex, float]:
        """Mass, centre, and moment of inertia about it, of bars (from, to, direction), by summing over small squares."""
        n = 200
        masses, places = [], []
        for begin, end, direction in bars:
            x = begin + (np.arange(n) + 0.5) / n * (end - begin)
            y = ((np.arange(n) + 0.5) / n - 0.5) * self.WIDTH
            z = (x[:, None] + 1j * y[None, :]) * np.exp(1j * direction)
            places.append(z.ravel())
            mass = self.DENSITY * self.WIDTH * self.THICKNESS * (end - begin)
            masses.append(np.full(z.size, mass / z.size))
        m, z = np.concatenate(masses), np.concatenate(places)
        centre = complex((m * z).sum() / m.sum())
        return float(m.sum()), centre, float((m * np.abs(z - centre) ** 2).sum())

    LINKAGE = Linkage(
        ground_length=0.4, crank_length=0.1, coupler_length=0.35, rocker_length=0.3, point_distance=0.2,
        point_angle=1.1, ground_angle=0.6, crank_phase=0.3,
    )  # fmt: skip

    def test_crank_and_rocker(self) -> None:
        p = self.bars(self.LINKAGE)
        mass, centre, inertia = self.integrated((0.0, 0.1, 0.0))
        assert p.crank_mass == pytest.approx(mass, rel=1e-12)
        assert p.crank_cog_distance == pytest.approx(centre.real, rel=1e-12)
        # about the shaft, as the plant wants it
        assert p.crank_inertia == pytest.approx(inertia + mass * abs(centre) ** 2, rel=1e-4)
        mass, centre, inertia = self.integrated((0.0, 0.3, 0.0))
        assert p.rocker_mass == pytest.approx(mass, rel=1e-12)
        assert p.rocker_cog_distance == pytest.approx(centre.real, rel=1e-12)
        assert p.rocker_inertia == pytest.approx(inertia, rel=1e-4)

    @pytest.mark.parametrize(
        ("distance", "angle", "bars"),
        [
            (0.2, 1.1, ((0.0, 0.35, 0.0), (0.0, 0.2, 1.1))),
            (0.5, -2.5, ((0.0, 0.35, 0.0), (0.0, 0.5, -2.5))),
            (0.2, 0.0, ((0.0, 0.35, 0.0),)),
            (0.5, 0.0, ((0.0, 0.5, 0.0),)),
            (0.2, pi, ((-0.2, 0.35, 0.0),)),
            (0.0, 1.0, ((0.0, 0.35, 0.0),)),
        ],
    )
    def test_the_coupler_reaches_its_point(self, distance: float, angle: float, bars: Any) -> None:
        p = self.bars(replace(self.LINKAGE, point_distance=distance, point_angle=angle))
        mass, centre, inertia = self.integrated(*bars)
        own = p.coupler_cog_distance * np.exp(1j * p.coupler_cog_angle)
        assert p.coupler_mass == pytest.approx(mass, rel=1e-12)
        assert complex(own) == pytest.approx(centre, abs=1e-12)
        assert p.coupler_inertia == pytest.approx(inertia, rel=1e-4)

    def test_gravity_pulls_down_in_the_plane(self) -> None:
        """Inclination: the plant's potential energy is that of the bars' centres in the plane, to a constant."""
        from linkwork.five_bar import dynamics

        linkage = replace(self.LINKAGE, point_distance=0.0)
        p = MachineSpec(slider_mass=0.0).sliding_five_bar(linkage)
        line = 7850.0 * 0.02 * 0.005
        values = []
        for phi in (0.0, 1.0, 2.5):
            z = {name: complex(*place) for name, place in linkage.pins(phi).items()}
            height = sum(line * abs(z[a] - z[b]) * 0.5 * (z[a] + z[b]).imag for a, b in ("AB", "BC", "CD"))
            state = (phi + linkage.crank_phase, 0.0, 0.0, 0.0, 0.0, 0.0)
            values.append(dynamics.energy(state, p.constants()) - 9.81 * height)
        np.testing.assert_allclose(values, values[0], atol=1e-12)


class TestBadDimensions:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"crank_length": 0.0}, "crank_length is 0.0: it must be greater than zero"),
            ({"rocker_length": -1.0}, "rocker_length is -1.0: it must be greater than zero"),
            ({"ground_angle": np.nan}, "ground_angle is nan: it must be a finite number"),
            ({"pivot_x": np.inf}, "pivot_x is inf: it must be a finite number"),
            ({"branch": 0}, "branch is 0: it must be"),
        ],
    )
    def test_are_named(self, change: dict[str, float], message: str) -> None:
        with pytest.raises(ParameterError, match=message):
            replace(TestFiveBar.LINKAGE, **change)

    def test_where_it_cannot_be_joined_it_has_no_pins(self) -> None:
        with pytest.raises(AssemblyError, match=r"crank rotation of 3\.14159 rad"):
            four_bar(*TYPES["triple-rocker"]).pins(pi)


class TestMovedPivots:
    @pytest.mark.parametrize("angle", [np.nan, np.inf])
    def test_a_guide_has_a_direction(self, angle: float) -> None:
        with pytest.raises(ParameterError, match="guide_angle is"):
            SliderMotion(FourierSeries.constant(0.0), angle)

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ({"length": -0.1}, "second_crank_length is -0.1"),
            ({"length": 0.0}, "second_crank_length is 0.0"),
            ({"length": np.inf}, "second_crank_length is inf"),
            ({"length": 0.1, "ratio": 1.51}, "ratio of the second crank is 1.51: .* whole numbers up to 6"),
            ({"length": 0.1, "ratio": np.nan}, "ratio of the second crank is nan"),
            ({"length": 0.1, "phase": np.nan}, "second_crank_phase is nan"),
        ],
    )
    def test_a_second_crank_is_one(self, values: dict[str, float], message: str) -> None:
        with pytest.raises(ParameterError, match=message):
            SecondCrank(**values)

    def test_verdicts_name_what_moves_the_pivot(self) -> None:
        """The lengths alone, a triple-rocker's, say nothing of a linkage whose pivot moves, as this one's crank turns."""
        linkage = four_bar(1.0, 0.5, 0.73, 0.73)
        assert linkage.grashof == "triple-rocker"
        follows = SliderMotion(FourierSeries(np.array([0.0, 0.3]), np.zeros(2)))
        for pivot, words in ((follows, "four-bar with a moved pivot"), (SecondCrank(0.3), "five-bar, gears 1")):
            verdicts = judge(linkage.with_pivot(pivot), np.array([0.0, 2.0 * pi]), closed=True)
            assert verdicts.full_turn
            assert str(verdicts).startswith(f"{words}, full turn")
