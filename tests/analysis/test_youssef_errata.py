"""Slips in Youssef's text and programs that no study needs, each with its size; docs/youssef.md lists them."""

from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest

from analysis.numerics.fourier import FourierSeries
from analysis.studies.youssef.chapter_6 import PROBLEMS
from analysis.studies.youssef.linearised import datum, with_crank
from analysis.synthesis import evaluate
from analysis.youssef import Variant, hill_regions, slider_equation
from analysis.youssef.printed_coefficients import DATUM, listed, ratios
from analysis.youssef.printed_coefficients import printed as as_printed
from linkwork.five_bar.published import TABLE_3_1, chapter_4
from tests import published
from tests.oracles.five_bar import assemble

TURN = np.linspace(0.0, 2.0 * pi, 64, endpoint=False)


def test_closure_as_printed_lacks_the_ground_link() -> None:
    """(2.1), as the scan has it, at the start of Table 3.1; with l1, as in (2.10), it closes."""
    _, th3, th4, u = assemble(TABLE_3_1, 0.0, 0.0)
    links = (TABLE_3_1.crank_length, TABLE_3_1.coupler_length, -TABLE_3_1.rocker_length)
    printed = sum(length * np.exp(1j * angle) for length, angle in zip(links, (0.0, th3, th4))) - u
    assert printed / published.CM == pytest.approx(published.TABLES["table-3.1"].lengths_cm[0], abs=1e-9)


def test_refinement_of_the_programs_accepts_negative_corrections() -> None:
    """Appendices 1 (L8257 to L8262) and 2 (L8600 to L8605) compare a correction itself, not its size, with 1.1e-10."""

    def last(corrections: list[float]) -> float:
        found = 0.0
        for correction in corrections:
            if abs(correction) > 1e-10:
                found = correction
        return found

    def greatest(corrections: list[float]) -> float:
        found = 1e-10
        for correction in corrections:
            if correction > found:
                found = correction
        return found

    for compared in (last, greatest):
        assert not compared([0.0, 1e-3]) < 1.1e-10
        assert compared([0.0, -1e-3]) < 1.1e-10


def test_programs_halve_the_inertias_harmonics() -> None:
    """Label 17 of appendices 2 to 4, with a short crank, about its own datum."""
    p = with_crank(1e-3)
    parts, equation = listed(ratios(p), datum(1e-3)), slider_equation(p, 1.0, variant=Variant.FIRST_ORDER)
    right = equation.mass
    mass, spring = parts.inertia, parts.spring
    for name in ("cos", "sin"):
        first = (getattr(mass, name)[1] - mass.mean / spring.mean * getattr(spring, name)[1]) / spring.mean
        assert first / getattr(right, name)[1] == pytest.approx(0.5, abs=5e-3)
        # U and V are not halved
        force = getattr(parts.force, name)[1] / spring.mean
        assert force / getattr(equation.force, name)[1] == pytest.approx(1.0, abs=5e-3)
    # the terms in S2 of C, AA, G1 and G2 are half of those of (4.21)
    p, still = (ratios(chapter_4(1.0))._replace(sigma2=x) for x in (published.SIGMA2, 0.0))
    for name in ("inertia", "damper", "spring"):
        half, whole = (getattr(of(p), name)(TURN) - getattr(of(still), name)(TURN) for of in (listed, as_printed))
        assert half == pytest.approx(0.5 * whole, abs=1e-15)


def test_stiffness_of_the_programs_has_another_first_harmonic() -> None:
    """H2, D and E of appendices 2 to 4, over the mean of the spring's factor; it alone makes the first region too wide."""
    short = with_crank(1e-5)
    parts, right = listed(ratios(short)), slider_equation(short, 1.0, variant=Variant.FIRST_ORDER).stiffness
    found = np.array([parts.stiffness.cos[1], parts.stiffness.sin[1]]) / parts.spring.mean
    assert found * 1e5 == pytest.approx([0.0646, 0.0994], abs=5.1e-5)
    assert [right.cos[1] * 1e5, right.sin[1] * 1e5] == pytest.approx([0.0444, -0.0770], abs=5.1e-5)
    equation, parts = slider_equation(chapter_4(1.0), 1.0), listed(ratios(chapter_4(1.0)))
    other = FourierSeries.from_samples(parts.stiffness(TURN) / parts.spring(TURN), 8)
    wide, whole = (hill_regions(e.homogeneous(), 1)[1].width for e in (replace(equation, stiffness=other), equation))
    assert wide / whole == pytest.approx(4.7, abs=0.05)


def test_datum_of_the_programs_is_a_degree_off() -> None:
    assert np.degrees(datum(published.SIGMA2).crank) == pytest.approx(148.08, abs=0.005)
    assert np.degrees(DATUM.crank) == 149.0
    # (4.6) with alpha4 rounded to whole degrees gives their other angles
    crank, coupler, _ = np.degrees(datum(published.SIGMA2, DATUM.rocker))
    assert (crank, coupler) == pytest.approx((148.57, 57.13), abs=0.006)


def test_sum_of_squares_as_printed_leaves_out_the_mounting_of_the_coupler() -> None:
    """(6.17) with r cos(a2 + th3), where appendix 5 (L9202) has a1 + a2: of the printed ellipse (a)."""
    x0, y0, _, l2, _, _, r, a1, th20, a2 = published.CHAPTER_6["ellipse-a"]
    linkage = PROBLEMS["ellipse-a"].printed
    sums = {}
    for mounting in (0.0, radians(a1)):
        total = 0.0
        for n in range(72):
            crank = radians(5.0 * n + th20)
            _, coupler, _, _ = assemble(
                replace(
                    TABLE_3_1,
                    ground_length=linkage.ground_length,
                    crank_length=linkage.crank_length,
                    coupler_length=linkage.coupler_length,
                    rocker_length=linkage.rocker_length,
                ),
                crank,
                0.0,
            )
            x = x0 + l2 * cos(crank + radians(a1)) + r * cos(radians(a2) + coupler + mounting)
            y = y0 + l2 * sin(crank + radians(a1)) + r * sin(radians(a2) + coupler + mounting)
            total += (20.0 + 10.0 * cos(radians(5.0 * n)) - x) ** 2 + (15.0 + 5.0 * sin(radians(5.0 * n)) - y) ** 2
        sums[mounting] = total
    printed, right = sums.values()
    assert right == pytest.approx(published.CHAPTER_6_ERRORS["ellipse-a"].true, abs=5e-3)
    assert printed == pytest.approx(601565.0, abs=0.5)


@pytest.mark.parametrize("problem", published.CHAPTER_6_READ)
def test_misprinted_linkages(problem: str) -> None:
    """As printed they miss the path by far more than the thesis says; mended by one sign or digit they do not."""
    p = PROBLEMS[problem]
    printed, mended = (p.convert(evaluate(p.task, linkage).error) for linkage in (p.printed, p.linkage))
    assert mended == pytest.approx(published.CHAPTER_6_ERRORS[problem].true, rel=0.01)
    assert printed > 3.0 * mended
