"""Slider-cranks and geared five-bars beside four-bars: their kinematics by complex numbers, what is known of them in closed
form, and searches that find again what is known.
"""

from dataclasses import replace
from math import acos, pi, radians, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq, differential_evolution, fsolve

import analysis.synthesis as syn
from analysis.mechanisms import SLIDER_CRANK
from analysis.synthesis.linkage.kernels import COLUMNS, coupler_path_jacobian
from analysis.synthesis.result.report import displacements, report
from analysis.synthesis.search.program import make_linkage
from analysis.synthesis.search.scan import scan
from analysis.synthesis.task.limits import limits_by_kind
from linkwork.errors import InputError, ParameterError
from linkwork.slider_crank import kinematics as plant
from tests.linkages import ellipse, outline

FloatArray = NDArray[np.float64]

SLIDER = syn.SliderCrank(
    pivot_x=0.3, pivot_y=-0.1, ground_length=0.04, crank_length=0.05, coupler_length=0.16,
    point_distance=0.09, point_angle=0.7, ground_angle=0.4, crank_phase=1.1, output_angle=0.0,
)  # fmt: skip
QUICK = syn.Search(starts=6, candidates=1 << 13, solutions=3)


def by_bisection(linkage: syn.Linkage, phi: float) -> dict[str, complex]:
    """Pins of a slider-crank in the plane: C where a point that goes along the guide is a coupler's length from B."""
    a, turned = complex(linkage.pivot_x, linkage.pivot_y), np.exp(1j * linkage.ground_angle)
    b = a + linkage.crank_length * np.exp(1j * (linkage.ground_angle + linkage.crank_phase + phi))
    foot = a + linkage.ground_length * turned
    beside = ((b - foot) * np.conj(1j * turned)).real
    far = beside + linkage.branch * 2.0 * linkage.coupler_length

    def off(s: float) -> float:
        return abs(foot + 1j * turned * s - b) - linkage.coupler_length

    c = foot + 1j * turned * brentq(off, beside, far, xtol=1e-15)
    p = b + (c - b) / linkage.coupler_length * linkage.point_distance * np.exp(1j * linkage.point_angle)
    return {"A": a, "B": b, "C": c, "D": c, "E": foot, "P": p}


@pytest.mark.parametrize("branch", [1, -1])
def test_a_slider_crank_is_where_bisection_finds_it(branch: int) -> None:
    linkage = replace(SLIDER, branch=branch)
    assert linkage.grashof == "slider-crank"
    for phi in (0.0, 0.9, 2.5, 4.4):
        wanted = by_bisection(linkage, phi)
        assert {n: complex(*z) for n, z in linkage.pins(phi).items()} == pytest.approx(wanted, abs=1e-13)
        assert complex(*linkage.path([phi])[0]) == pytest.approx(wanted["P"], abs=1e-13)
        along = (wanted["C"] - wanted["E"]) / np.exp(1j * linkage.ground_angle)
        assert linkage.slider_position([phi])[0] == pytest.approx(along.imag, abs=1e-13)
        angle = np.angle((wanted["C"] - wanted["B"]) * np.exp(-1j * linkage.ground_angle))
        assert np.exp(1j * linkage.coupler_angle([phi])[0]) == pytest.approx(np.exp(1j * (angle + 0.4)), abs=1e-12)


@pytest.mark.parametrize("branch", [1, -1])
def test_the_slider_goes_as_that_of_the_plant(branch: int) -> None:
    """Rahman's slider-crank with the guide at right angles to the crank shaft's axis is the planar one."""
    linkage = replace(SLIDER, branch=branch, ground_angle=0.0, crank_phase=0.0)
    constants = next(iter(SLIDER_CRANK.published.values())).parameters.constants()
    known = {"a1": linkage.crank_length, "a2": linkage.coupler_length, "a4": -linkage.ground_length}
    p = constants._replace(**known, ca=0.0, sa=1.0, branch=-float(branch))
    for phi in np.linspace(0.0, 6.0, 13):
        q = plant.position(float(phi), 0.0, p)
        assert plant.slider_pin(q, p).y == pytest.approx(linkage.slider_position([phi])[0], abs=1e-14)
        angle = linkage.transmission([phi])[0]
        assert plant.transmission_angle(q, p) == pytest.approx(angle, abs=1e-12)


def test_derivatives_of_the_coupler_point_are_limits_of_differences() -> None:
    phi, h = np.linspace(0.0, 6.0, 7), 1e-6
    zero = np.zeros(7)
    q, out, jacobian = SLIDER.vector, np.empty((2, 7)), np.empty((12, 2, 7))
    coupler_path_jacobian(np.cos(phi), np.sin(phi), zero, zero, q, 1.0, out, jacobian)
    for k, name in enumerate(COLUMNS[:10]):
        if name == "rocker_length":
            continue
        ends = [syn.SliderCrank.from_vector(q + side * h * (np.arange(10) == k)).path(phi).T for side in (1.0, -1.0)]
        np.testing.assert_allclose(jacobian[k], (ends[0] - ends[1]) / (2.0 * h), rtol=1e-7, atol=1e-8, err_msg=name)


@pytest.mark.parametrize(("offset", "crank", "coupler"), [(0.0, 0.05, 0.16), (0.04, 0.05, 0.16), (0.10, 0.05, 0.17)])
def test_transmission_angle_and_turning_by_the_textbook(offset: float, crank: float, coupler: float) -> None:
    """cos mu = (e + r)/l at its extreme; the crank turns if e + r < l (R. L. Norton, Design of Machinery, chapter 3)."""
    linkage = replace(SLIDER, ground_length=offset, crank_length=crank, coupler_length=coupler)
    assert linkage.least_transmission == pytest.approx(acos((offset + crank) / coupler))
    verdicts = syn.judge(linkage, np.array([0.0, 2.0 * pi]), closed=True)
    assert verdicts.sound
    assert verdicts.full_turn
    assert pi - verdicts.greatest_transmission == pytest.approx(acos((offset + crank) / coupler), abs=1e-12)
    short = replace(linkage, coupler_length=0.999 * (offset + crank))
    assert not short.turns_fully
    assert syn.judge(short, np.array([0.0, 2.0 * pi]), closed=True).defects == ("circuit defect", "branch defect")


def textbook(linkage: syn.Linkage) -> tuple[float, float]:
    """Stroke and time ratio of a slider-crank, from its positions."""
    phi = np.linspace(0.0, 2.0 * pi, 200001)
    s = linkage.slider_position(phi)
    way = abs(phi[int(s.argmax())] - phi[int(s.argmin())])
    return float(np.ptp(s)), max(way, 2.0 * pi - way) / min(way, 2.0 * pi - way)


class TestQuickReturn:
    @pytest.mark.parametrize(("ratio", "least"), [(1.0, 40.0), (1.1, 40.0), (1.25, 40.0), (1.5, 20.0), (1.8, 15.0)])
    def test_stroke_and_time_ratio_are_those_asked_for(self, ratio: float, least: float) -> None:
        task = syn.QuickReturn(stroke="80 mm", time_ratio=ratio)
        found = syn.synthesize(task, constraints=[syn.LeastTransmission(angle=radians(least))])
        assert len(found.with_variants) == 2
        for s in found.with_variants:
            stroke, time = textbook(s.linkage)
            assert stroke == pytest.approx(0.08, rel=1e-8)
            assert time == pytest.approx(ratio, rel=1e-4)
            # out slowly, and to the last digit at the ends
            assert s.evaluation.worst < 1e-15
            assert s.verdicts.sound

    def test_no_other_transmits_better(self) -> None:
        """Against SciPy's differential evolution over all slider-cranks of that stroke and ratio, by other formulas."""
        task = syn.QuickReturn(stroke=0.1, time_ratio=1.2)
        best = syn.synthesize(task).best.linkage

        def places(offset: float, crank: float, coupler: float) -> tuple[float, float]:
            return sqrt((coupler + crank) ** 2 - offset**2), sqrt((coupler - crank) ** 2 - offset**2)

        def worst(x: FloatArray) -> float:
            """The stroke gives the offset, if there is one; the time ratio is held by a penalty."""
            crank, coupler = x
            if coupler <= crank or np.subtract(*places(0.0, crank, coupler)) > 0.1:
                return 10.0

            def off(offset: float) -> float:
                return float(np.subtract(*places(offset, crank, coupler))) - 0.1

            if off(coupler - crank) < 0.0:
                return 10.0
            offset = brentq(off, 0.0, coupler - crank)
            far, near = places(offset, crank, coupler)
            angle = abs(np.angle(complex(far, offset) / complex(near, offset)))
            return (offset + crank) / coupler + 10.0 * abs((pi + angle) / (pi - angle) - 1.2)

        found = differential_evolution(worst, [(0.01, 0.05), (0.05, 0.5)], seed=1, maxiter=200, tol=1e-10)
        assert np.cos(best.least_transmission) == pytest.approx(found.fun, rel=1e-4)

    @pytest.mark.parametrize(
        ("task", "fixed"),
        [
            (syn.QuickReturn(stroke=0.1, time_ratio=1.1), {"ground_length": 0.02}),
            (syn.QuickReturn(stroke=0.1, time_ratio=1.1), {"crank_length": 0.0495}),
            (syn.QuickSwing(swing="60 deg", time_ratio=1.1), {"rocker_length": 0.08, "ground_length": 0.2}),
        ],
    )
    def test_links_may_be_fixed(self, task: syn.Task, fixed: dict[str, float]) -> None:
        best = syn.synthesize(task, {name: (x, x) for name, x in fixed.items()}, [syn.FullTurn()]).best
        assert {name: getattr(best.linkage, name) for name in fixed} == pytest.approx(fixed, rel=1e-8)
        assert best.evaluation.worst < 1e-9
        assert best.verdicts.full_turn

    def test_what_cannot_be_had_is_said(self) -> None:
        with pytest.raises(syn.InfeasibleError, match=r"time ratio of 1.5 the best slider-crank has 27.46 deg"):
            syn.synthesize(syn.QuickReturn(stroke=0.1, time_ratio=1.5))
        with pytest.raises(syn.InfeasibleError, match="the coupler is to be"):
            syn.synthesize(syn.QuickReturn(stroke=0.1, time_ratio=1.2), constraints=[syn.LargestLink(length=0.04)])
        with pytest.raises(InputError, match="cannot keep TimeRatio"):
            syn.synthesize(syn.QuickReturn(stroke=0.1), constraints=[syn.TimeRatio(least=1.1)])
        with pytest.raises(ParameterError, match="time ratio is"):
            syn.QuickReturn(stroke=0.1, time_ratio=0.9)


class TestQuickSwing:
    @pytest.mark.parametrize(("swing", "ratio"), [(40.0, 1.0), (60.0, 1.1), (-60.0, 1.1), (-80.0, 1.3), (100.0, 1.5)])
    def test_the_rocker_swings_as_it_is_asked(self, swing: float, ratio: float) -> None:
        found = syn.synthesize(syn.QuickSwing(swing=f"{swing} deg", time_ratio=ratio), constraints=[])
        assert {s.linkage.branch for s in found.with_variants} == {1, -1}
        for s in found.with_variants:
            phi = np.linspace(0.0, 2.0 * pi, 20001)
            angle = s.linkage.rocker_angle(np.sign(swing) * phi)
            slow = phi[np.argmax(angle * np.sign(swing))]
            assert slow / (2.0 * pi - slow) == pytest.approx(ratio, rel=1e-3)
            assert np.ptp(angle) == pytest.approx(radians(abs(swing)), rel=1e-6)
            assert s.evaluation.worst < 1e-9
            assert s.verdicts.grashof == "crank-rocker"

    @pytest.mark.parametrize("swing", [50.0, -50.0])
    def test_no_other_transmits_better(self, swing: float) -> None:
        """Crank-rockers with the same swing and ratio and another coupler, by roots of the laws of cosines."""
        best = syn.synthesize(syn.QuickSwing(swing=f"{swing} deg", time_ratio=1.15), constraints=[]).best.linkage
        l3, advance = best.coupler_length / best.rocker_length, pi * 0.15 / 2.15

        def ends(ground: float, crank: float, coupler: float) -> tuple[list[float], list[float]]:
            """Directions of C from A, and angles of the rocker at D, in the dead centres; by the law of cosines."""
            reach = np.array([coupler + crank, coupler - crank])
            cosines = (
                (ground**2 + reach**2 - 1.0) / (2.0 * ground * reach),
                (ground**2 + 1.0 - reach**2) / (2.0 * ground),
            )
            at_a, at_d = (np.arccos(np.clip(c, -1.0, 1.0)).tolist() for c in cosines)
            return at_a, at_d

        def off(x: FloatArray, coupler: float) -> FloatArray:
            at_a, at_d = ends(*x, coupler)
            return np.array([at_a[1] - at_a[0] - advance, at_d[0] - at_d[1] - radians(50.0)])

        start = np.array([best.ground_length, best.crank_length]) / best.rocker_length
        assert np.abs(off(start, l3)).max() < 1e-9
        for other in (0.9 * l3, 0.99 * l3, 1.01 * l3, 1.1 * l3):
            (ground, crank), _, good, _ = fsolve(off, start, args=(other,), full_output=True)
            assert good == 1
            made = syn.Linkage(ground_length=ground, crank_length=crank, coupler_length=other, rocker_length=1.0)
            assert 0.9 * best.least_transmission < made.least_transmission < best.least_transmission

    def test_a_swing_to_the_right_is_one_to_the_left_seen_from_behind(self) -> None:
        left, right = (
            {s.linkage.branch: s.linkage for s in syn.synthesize(task, constraints=[]).with_variants}
            for task in (syn.QuickSwing(swing=swing, time_ratio=1.2) for swing in ("40 deg", "-40 deg"))
        )
        phi = syn.turn(36)
        for branch in (1, -1):
            np.testing.assert_allclose(right[branch].rocker_angle(-phi), -left[-branch].rocker_angle(phi), atol=1e-9)

    def test_size_and_what_cannot_be_had(self) -> None:
        task = syn.QuickSwing(swing="-60 deg", time_ratio=1.1)
        assert syn.synthesize(task, constraints=[]).best.linkage.ground_length == pytest.approx(0.1)
        fixed = syn.synthesize(task, {"rocker_length": ("50 mm", "50 mm")}, [syn.LargestLink(length=0.1)]).best.linkage
        assert fixed.rocker_length == pytest.approx(0.05)
        small = syn.synthesize(task, constraints=[syn.LargestLink(length="40 mm")]).best.linkage
        assert small.largest_link == pytest.approx(0.04)
        with pytest.raises(syn.InfeasibleError, match=r"100 deg and a time ratio of 1.5 .* has 20.35 deg"):
            syn.synthesize(syn.QuickSwing(swing="100 deg", time_ratio=1.5))
        with pytest.raises(InputError, match="cannot keep TimeRatio: leave it out, or ask for a RockerFunction"):
            syn.synthesize(task, constraints=[syn.TimeRatio(least=1.1)])
        with pytest.raises(syn.InfeasibleError, match="no crank-rocker with a swing of -60 deg"):
            syn.synthesize(task, {"crank_length": (0.02, 0.02), "rocker_length": ("1 cm", "2 cm")})
        shape = syn.synthesize(task, constraints=[]).best.linkage
        for bounds in ({"crank_length": ("20 cm", "30 cm")}, {"rocker_length": (None, "5 mm")}):
            sized = syn.synthesize(task, bounds, constraints=[]).best.linkage  # type: ignore[arg-type]
            assert sized.least_transmission == pytest.approx(shape.least_transmission, abs=1e-6)
        with pytest.raises(ParameterError, match="bound one of ground_length"):
            syn.synthesize(task, {"pivot_x": (0.0, 0.0)})
        with pytest.raises(ParameterError, match=r"bounds of crank_length is 0\.05: it must be two numbers"):
            syn.synthesize(task, {"crank_length": 0.05})  # type: ignore[dict-item]
        with pytest.raises(ParameterError, match=r"crank_length is 0\.0: it must be above zero"):
            syn.synthesize(task, {"crank_length": (0.0, 0.0)})
        for wrong in ({"swing": "180 deg"}, {"swing": 0.0}, {"swing": 1.0, "time_ratio": 0.5}):
            with pytest.raises(ParameterError):
                syn.QuickSwing(**wrong)  # type: ignore[arg-type]


class TestSearch:
    """Targets that a known slider-crank makes: found again to rounding."""

    @pytest.mark.parametrize("branch", [1, -1])
    def test_a_timed_path(self, branch: int) -> None:
        task = syn.TimedPath(points=replace(SLIDER, branch=branch).path(syn.turn(24)))
        found = syn.synthesize(task, kinds=("slider-crank",), search=QUICK)
        assert found.best.error < 1e-16
        assert isinstance(found.best.linkage, syn.SliderCrank)
        assert found.best.linkage.crank_length == pytest.approx(0.05, rel=1e-5)

    def test_an_untimed_path(self) -> None:
        task = outline(SLIDER.path(syn.turn(120)))
        found = syn.synthesize(task, kinds=("slider-crank",), search=QUICK)
        assert found.best.evaluation.rms < 2e-5

    def test_a_motion(self) -> None:
        at = np.linspace(0.0, 3.0, 8)
        task = syn.Motion(points=SLIDER.path(at), angle=SLIDER.coupler_angle(at) + 0.3, rotation=at)
        found = syn.synthesize(task, kinds=("slider-crank",), search=QUICK)
        assert found.best.error < 1e-14

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_a_function_of_the_slider(self, side: float) -> None:
        x = 0.2 + side * SLIDER.slider_position(syn.turn(24))
        found = syn.synthesize(syn.SliderFunction(position=x), search=QUICK)
        assert found.best.error < 1e-16
        linkage = found.best.linkage
        assert linkage.point_is_pin
        np.testing.assert_allclose(linkage.path(syn.turn(24)), np.column_stack([x, np.zeros(24)]), atol=1e-8)
        np.testing.assert_allclose([*linkage.vector[2:5]], [0.04, 0.05, 0.16], rtol=1e-4)

    @pytest.mark.parametrize(
        ("bounds", "height", "rms"),
        [
            ({"pivot_y": ("-60 mm", "-30 mm")}, -0.03, 3.3294e-3),
            ({"pivot_y": (0.02, 0.02)}, 0.02, 1.6006e-3),
            ({"ground_length": (None, 0)}, 0.0, 2.7618e-3),
        ],
    )
    def test_the_shaft_stays_in_its_bounds_beside_the_guide(self, bounds: Any, height: float, rms: float) -> None:
        """The errors are those of the best linkages by SciPy's differential evolution."""
        at = np.radians(np.linspace(0.0, 300.0, 13))
        task = syn.SliderFunction(position=0.05 * np.cos(at - 0.4) + 0.006 * np.sin(2.0 * at), rotation=at)
        best = syn.synthesize(task, bounds, search=QUICK).best
        assert best.linkage.pivot_y == pytest.approx(height, abs=1e-7)
        assert best.evaluation.rms == pytest.approx(rms, rel=1e-4)

    def test_stroke_and_time_ratio_are_kept(self) -> None:
        task = syn.TimedPath(points=ellipse(36))
        stroke = syn.Stroke(least="115 mm", greatest=0.15)
        limits = [syn.LeastTransmission(angle=radians(20)), syn.TimeRatio(least=1.2), stroke]
        found = syn.synthesize(task, None, limits, kinds=("slider-crank",), search=QUICK)
        stroke, ratio = textbook(found.best.linkage)
        assert ratio >= 1.2 - 1e-3
        assert 0.115 - 1e-6 <= stroke <= 0.15 + 1e-6
        free = syn.synthesize(task, kinds=("slider-crank",), search=QUICK)
        assert textbook(free.best.linkage)[1] < 1.1
        assert free.best.error < found.best.error

    def test_the_kinds_are_ranked_together(self) -> None:
        task = syn.TimedPath(points=ellipse(24))
        both = syn.synthesize(task, kinds=("four-bar", "slider-crank"), search=QUICK)
        assert len(both.solutions) >= 2
        assert {s.linkage.kind for s in both.solutions} == {"slider-crank", "four-bar"}
        errors = [s.error for s in both.solutions]
        assert errors == sorted(errors)
        alone = [syn.synthesize(task, kinds=(kind,), search=QUICK).best.error for kind in ("four-bar", "slider-crank")]
        assert errors[0] == pytest.approx(min(alone), rel=1e-6)
        sliders = [s for s in both.solutions if isinstance(s.linkage, syn.SliderCrank)]
        again = syn.synthesize(task, kinds=("slider-crank",), guesses=sliders[:1])
        assert again.best.error <= min(s.error for s in sliders) * (1.0 + 1e-9)


#: A path that a slider-crank traces.
WAY = syn.TimedPath(points=SLIDER.path(syn.turn(12)) + 1e-3)
REGION = syn.PivotRegion(pivot="D", polygon=[[0, 0], [1, 0], [0, 1]])


@pytest.mark.parametrize(
    ("task", "more", "message"),
    [
        (syn.RockerFunction(angle=[0.1, 0.2, 0.4]), {"kinds": ("slider-crank",)}, "RockerFunction needs a rocker"),
        (syn.SliderFunction(position=[0.0, 0.1, 0.2]), {"kinds": ("four-bar",)}, "SliderFunction needs a slider"),
        (syn.QuickReturn(stroke=0.1), {"kinds": ("four-bar",)}, "QuickReturn is a task for the slider of"),
        (syn.QuickSwing(swing=1.0), {"kinds": ("slider-crank",)}, "QuickSwing is a task for the rocker of a four-bar"),
        (None, {"kinds": ("slider-crank",), "constraints": [syn.Grashof(type="crank-rocker")]}, "cannot keep Grashof"),
        (None, {"constraints": [syn.Stroke(least=0.1)]}, "a four-bar cannot keep Stroke"),
        (None, {"kinds": ("slider-crank",), "constraints": [REGION]}, "cannot keep a region of pivot D"),
        (None, {"kinds": ("slider-crank",), "bounds": {"ground_length": (-0.04, 0.01)}}, "offset of a slider-crank"),
        (None, {"kinds": ("slider-crank",), "bounds": [0.1]}, "must be a mapping"),
        (None, {"kinds": "slider-crank", "gears": (2.0,)}, "kinds are 'slider-crank': they must be a sequence"),
        (None, {"kinds": (), "gears": (2.0,)}, "no kind of linkages is given: there are four-bar"),
        (None, {"kinds": ("slider-krank",), "gears": (2.0,)}, "did you mean slider-crank?"),
        (None, {"kinds": ("geared-five-bar",), "gears": 2.0}, "gears are 2.0: they must be a sequence"),
        (None, {"kinds": ("geared-five-bar",), "gears": (1.234,)}, "be a ratio of whole numbers"),
        (None, {"gears": (2.0,)}, "gears has no effect"),
        (None, {"bounds": {"second_crank_length": (0.1, 0.2)}}, "second_crank_length has no effect"),
        (None, {"kinds": ("slider-crank",), "bounds": {"rocker_length": (0.1, 0.2)}}, "rocker_length has no effect"),
        (syn.QuickReturn(stroke=0.1), {"pivot": syn.SliderUnknown(harmonics=1)}, "pivot has no effect"),
        (syn.QuickReturn(stroke=0.1), {"gears": (2.0,)}, "gears has no effect"),
        (syn.QuickReturn(stroke=0.1), {"guesses": [syn.Solution.from_linkage(WAY, SLIDER)]}, "guesses has no effect"),
        (syn.QuickReturn(stroke=0.1), {"constraints": syn.LargestLink(length=1.0)}, "must be a sequence"),
        (None, {"pivot": "slider"}, "pivot is 'slider'"),
        (None, {"guesses": ["best"]}, "guess 0 is 'best'"),
        (None, {"guesses": syn.Solution.from_linkage(WAY, SLIDER)}, "guesses are <Solution"),
    ],
)
def test_what_a_kind_cannot_do_is_refused(task: Any, more: dict[str, Any], message: str) -> None:
    points = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]]
    with pytest.raises((InputError, ParameterError), match=message):
        syn.synthesize(task or syn.TimedPath(points=points), search=QUICK, **more)


def test_what_is_exact_has_no_error_to_trade() -> None:
    with pytest.raises(InputError, match="over has no effect"):
        syn.trade_off(syn.QuickReturn(stroke=0.1), "size", [0.2, 0.3])
    with pytest.raises(InputError, match="constraints are FullTurn"):
        syn.trade_off(WAY, "size", [0.2, 0.3], constraints=syn.FullTurn())


class TestWhatIsMadeOfIt:
    SOLUTION = syn.Solution.from_linkage(WAY, SLIDER)

    def test_report_names_offset_stroke_and_time_ratio(self) -> None:
        text = report(self.SOLUTION)
        stroke, ratio = textbook(SLIDER)
        assert f"slider at C on a guide 40 mm from A: stroke {1e3 * stroke:.6g} mm\n" in text
        assert f"time ratio of the slider's strokes {ratio:.4g}\n" in text
        assert "rocker" not in text.partition("assembly")[2]
        assert "slider-crank, full turn" in text

    def test_a_slider_that_is_the_point_stays_it(self) -> None:
        found = syn.synthesize(syn.QuickReturn(stroke=0.0823)).best
        links, angles = {"ground_length", "crank_length", "coupler_length"}, {"ground_angle", "crank_phase"}
        assert displacements(found).keys() == {"pivot_x", "pivot_y"} | links | angles
        made = syn.round_dimensions(found).linkage
        assert made.point_is_pin
        assert made.coupler_length == pytest.approx(round(1e4 * found.linkage.coupler_length) / 1e4)

    def test_drawings_have_a_guide_and_no_rocker(self) -> None:
        drawn = syn.drawing(self.SOLUTION)
        layers = {item.layer for item in (*drawn.lines, *drawn.circles, *drawn.polylines)}
        assert {"guide", "slider", "crank", "coupler"} <= layers
        assert "rocker" not in layers
        labels = " ".join(t.text for t in syn.plates(self.SOLUTION, width=0.02, thickness=0.005, pin=0.008).texts)
        assert [name in labels for name in ("crank", "coupler", "rocker", "ground")] == [True, True, False, False]
        guide = syn.LinkageScene(self.SOLUTION).guide
        assert guide is not None
        assert np.hypot(*(guide[1] - guide[0])) == pytest.approx(textbook(SLIDER)[0], rel=1e-4)


def four_bar_and_its_five_bar() -> tuple[syn.Linkage, syn.Linkage]:
    """A four-bar, and the five-bar with equally turning cranks that traces its curve with the joint C (Roberts, Chebyshev).

    With k = (P - B)/(C - B) loop closure gives P = G + (1 - k) l2 exp(i th2) + k l4 exp(i th4), G = A + k l1.
    """
    four = syn.Linkage(
        ground_length=0.4, crank_length=0.1, coupler_length=0.3, rocker_length=0.35, point_distance=0.2, point_angle=0.7,
        ground_angle=0.3, crank_phase=0.5,
    )  # fmt: skip
    k = four.point_distance / four.coupler_length * np.exp(1j * four.point_angle)
    turned = float(np.angle(k))
    second = syn.SecondCrank(abs(1.0 - k) * 0.1, 1.0, 0.5 + float(np.angle(1.0 - k)) - turned)
    five = syn.FiveBar(
        ground_length=abs(k) * 0.4, crank_length=0.1, coupler_length=abs(k) * 0.3, rocker_length=abs(k) * 0.35,
        point_distance=abs(k) * 0.3, ground_angle=0.3 + turned, crank_phase=0.5 - turned, pivot=second,
    )  # fmt: skip
    return four, five


def five_bar(ratio: float) -> syn.FiveBar:
    return syn.FiveBar(
        pivot_x=0.1, pivot_y=0.2, ground_length=0.2, crank_length=0.06, coupler_length=0.19, rocker_length=0.16,
        point_distance=0.08, point_angle=0.6, ground_angle=0.4, crank_phase=0.8, pivot=syn.SecondCrank(0.04, ratio, 1.3),
    )  # fmt: skip


def moves(linkage: syn.Linkage, name: str) -> float:
    """Rms displacement of the coupler point at twelve rotations per unit of a dimension, by differences."""
    ends = (replace(linkage, **{name: getattr(linkage, name) + h}).path(syn.turn(12)) for h in (1e-6, -1e-6))
    return float(np.sqrt((np.subtract(*ends) ** 2).sum(axis=1).mean())) / 2e-6


@pytest.mark.parametrize(
    ("linkage", "names"),
    [(SLIDER, ()), (five_bar(0.5), ("crank_phase", "crank_length", "coupler_length"))],
    ids=["slider-crank", "geared"],
)
def test_displacements_are_limits_of_differences(linkage: syn.Linkage, names: tuple[str, ...]) -> None:
    made = syn.Solution.from_linkage(syn.TimedPath(points=linkage.path(syn.turn(12)) + 1e-3), linkage)
    found = displacements(made)
    for name in names or found:
        assert found[name] == pytest.approx(moves(linkage, name), rel=1e-5, abs=1e-9), name


class TestGearedFiveBar:
    @pytest.mark.parametrize(("ratio", "turns"), [(1.0, (1, 1)), (-2.0, (1, -2)), (0.5, (2, 1)), (-1.5, (2, -3))])
    def test_it_is_where_the_law_of_cosines_puts_it(self, ratio: float, turns: tuple[int, int]) -> None:
        linkage = five_bar(ratio)
        turned = np.exp(0.4j)
        for phi in (0.0, 1.0, 2.9, 5.5):
            b = 0.1 + 0.2j + turned * 0.06 * np.exp(1j * (turns[0] * phi + 0.8))
            d = 0.1 + 0.2j + turned * (0.2 + 0.04 * np.exp(1j * (turns[1] * phi + 1.3)))
            inner = acos((0.19**2 + abs(d - b) ** 2 - 0.16**2) / (2.0 * 0.19 * abs(d - b)))
            coupler = (d - b) / abs(d - b) * np.exp(1j * inner)
            p = b + 0.08 * np.exp(0.6j) * coupler
            assert complex(*linkage.path([phi])[0]) == pytest.approx(p, abs=1e-13)
            assert complex(*linkage.pins(phi)["C"]) == pytest.approx(b + 0.19 * coupler, abs=1e-13)
        np.testing.assert_allclose(linkage.path([0.3]), linkage.path([0.3 + 2.0 * pi]), atol=1e-13)
        low, high = linkage.transmission_range()
        bare = np.arccos(linkage.cosine_at_c(linkage.reach(np.linspace(0.0, 2.0 * pi, 20001))))
        assert (low, high) == pytest.approx((bare.min(), bare.max()), abs=1e-3)
        verdicts = syn.judge(linkage, np.array([0.0, 2.0 * pi]), closed=True)
        assert (verdicts.least_transmission, verdicts.greatest_transmission) == pytest.approx((low, high), abs=1e-3)

    def test_with_equal_gears_its_joint_traces_the_curve_of_a_four_bar(self) -> None:
        four, five = four_bar_and_its_five_bar()
        np.testing.assert_allclose(five.path(syn.turn(90)), four.path(syn.turn(90)), atol=1e-14)

    def test_with_opposite_gears_a_symmetric_one_draws_a_straight_line(self) -> None:
        """By symmetry: exact, with turning joints alone; no four-bar comes as near as what is found."""
        linkage = syn.FiveBar(
            ground_length=0.3, crank_length=0.04, coupler_length=0.3, rocker_length=0.3, point_distance=0.3, crank_phase=0.4,
            pivot=syn.SecondCrank(0.04, -1.0, pi - 0.4),
        )  # fmt: skip
        path = linkage.path(syn.turn(90))
        np.testing.assert_allclose(path[:, 0], 0.15, atol=1e-15)
        assert np.ptp(path[:, 1]) > 0.05
        task = syn.TimedPath(points=linkage.path(syn.turn(18)))
        kinds = ({"kinds": ("geared-five-bar",), "gears": (-1,)}, {"kinds": ("four-bar",)})
        found, alone = (syn.synthesize(task, search=QUICK, **kind).best for kind in kinds)
        assert 10.0 * found.error < alone.error

    @pytest.mark.parametrize("ratio", [1.0, 2.0, -0.5])
    def test_a_known_one_is_found_again(self, ratio: float) -> None:
        task = syn.TimedPath(points=five_bar(ratio).path(syn.turn(24)))
        search = syn.Search(starts=8, candidates=1 << 13, solutions=2)
        found = syn.synthesize(task, kinds=("geared-five-bar",), gears=(ratio,), search=search)
        best = found.best
        assert best.error < 1e-12
        assert best.verdicts.grashof == f"five-bar, gears {'-1/2' if ratio < 0 else int(ratio)}"
        if ratio == 1.0:
            # a four-bar's closure with a crank of its own: the same curve from other cranks
            return
        assert isinstance(best.linkage.pivot, syn.SecondCrank)
        assert best.linkage.pivot.length == pytest.approx(0.04, rel=1e-3)

    @pytest.mark.parametrize("kind", ["motion", "rocker", pytest.param("untimed", marks=pytest.mark.slow)])
    def test_other_tasks(self, kind: str) -> None:
        known, at = five_bar(2.0), syn.turn(16)
        task: Any = outline(known.path(syn.turn(120)))
        if kind == "motion":
            task = syn.Motion(points=known.path(at), angle=known.coupler_angle(at), rotation=at)
        if kind == "rocker":
            task = syn.RockerFunction(angle=known.rocker_angle(at), rotation=at)
        found = syn.synthesize(task, kinds=("geared-five-bar",), gears=(2.0,), search=QUICK)
        assert found.best.verdicts.sound
        assert found.best.evaluation.rms < {"motion": 2e-4, "rocker": 2e-3, "untimed": 1e-3}[kind]

    def test_bounds_of_the_second_crank_hold(self) -> None:
        task = syn.TimedPath(points=five_bar(2.0).path(syn.turn(24)))
        more: dict[str, Any] = {"kinds": ("geared-five-bar",), "gears": (2,), "search": QUICK}
        found = syn.synthesize(task, {"second_crank_length": ("1 cm", "2 cm")}, **more)
        for s in found.solutions:
            assert isinstance(s.linkage.pivot, syn.SecondCrank)
            assert 0.01 - 1e-9 <= s.linkage.pivot.length <= 0.02 + 1e-9
        assert found.best.error > 1e-8


@pytest.mark.parametrize(
    ("kind", "gears", "slider"),
    [("slider-crank", (1,), 0), ("slider-crank", (1,), 1), ("geared-five-bar", (2, -0.5), 0)],
)
def test_starts_of_the_scan_are_what_their_quality_says(kind: syn.Kind, gears: tuple[float, ...], slider: int) -> None:
    task = syn.TimedPath(points=SLIDER.path(syn.turn(18)) + 0.01 * np.random.default_rng(0).normal(size=(18, 2)))
    if slider:
        task = syn.SliderFunction(position=task.points[:, 0])
    normal = syn.normal_form(task)
    for limits in limits_by_kind(task, normal, None, syn.USUAL, (kind,), gears):
        for start in scan(normal, limits, seed=1, candidates=2048, starts=4):
            linkage = make_linkage(start, normal, limits.second_crank(normal.unit))
            assert linkage.kind == kind
            assert linkage.least_transmission > radians(38.0)
            error = start.quality * normal.unit**2
            assert syn.Solution.from_linkage(task, linkage).error == pytest.approx(error, rel=1e-6)


def test_a_poor_answer_says_how_much_of_the_target_is_wrong_and_what_may_do_better() -> None:
    """A circle by a circle half as large, whose point is the crank pin: three quarters of its area; a rocker at rest."""
    turned = syn.turn(720)
    circle = syn.TargetPath(points=0.2 * np.column_stack([np.cos(turned), np.sin(turned)]), closed=True)
    links = {"crank_length": 0.1, "coupler_length": 0.3, "ground_length": 0.3, "rocker_length": 0.25}
    places = {"pivot_x": 0.0, "pivot_y": 0.0, "ground_angle": 0.0, "crank_phase": 0.0, "output_angle": 0.0}
    linkage = syn.Linkage(**links, **places, point_distance=0.0, point_angle=0.0)
    poor = syn.Solution.from_linkage(syn.UntimedPath(path=circle), linkage)
    assert poor.share == pytest.approx(0.75, rel=1e-3)
    assert "75 % of the target's area" in syn.format_poor(poor)
    assert "geared five-bar" in syn.format_poor(poor)
    assert syn.format_poor(poor) in syn.assess(poor).report
    good = syn.Solution.from_linkage(syn.UntimedPath(path=circle), replace(linkage, crank_length=0.2))
    assert good.share == pytest.approx(0.0, abs=1e-4)
    assert syn.format_poor(good) == ""
    at = syn.turn(12)
    still = syn.RockerFunction(rotation=at, angle=linkage.rocker_angle(at) + np.where(np.arange(12) % 2, 0.5, -0.5))
    off = syn.Solution.from_linkage(still, linkage)
    assert off.share == pytest.approx(0.5 / np.ptp(still.angle), rel=1e-9)
    assert "swing" in syn.format_poor(off)
