"""A ranking shows one of several mirror images and near copies; these are counted, and nothing is lost."""

from dataclasses import replace

import numpy as np
import pytest

import analysis.synthesis as syn
from analysis.synthesis.result.solution import group_similar
from analysis.synthesis.search.polish import distinct_answers
from analysis.synthesis.search.program import Answer, make_start
from analysis.synthesis.task.task import normal_form
from tests.linkages import scaled

SIZES = {"pivot_x": 0.1, "pivot_y": 0.05, "crank_length": 0.05, "coupler_length": 0.16, "point_distance": 0.09}
ANGLES = {"ground_angle": 0.4, "crank_phase": 1.1, "point_angle": 0.7}
FOUR_BAR = syn.Linkage(**SIZES, **ANGLES, ground_length=0.18, rocker_length=0.12, output_angle=0.0)
GEARED = syn.FiveBar(
    **SIZES, **ANGLES, ground_length=0.18, rocker_length=0.12, output_angle=0.0,
    pivot=syn.SecondCrank(0.03, ratio=-2.0, phase=0.3),
)  # fmt: skip
SLIDER = syn.SliderCrank(**SIZES, **ANGLES, ground_length=0.04, output_angle=0.0)
PHI = syn.turn(12)


def solution(linkage: syn.Linkage) -> syn.Solution:
    return syn.Solution.from_linkage(syn.TimedPath(points=FOUR_BAR.path(PHI)), linkage)


def mirrored(linkage: syn.Linkage) -> syn.Linkage:
    """Return the mirror image in the x axis, which runs backwards; its path says so."""
    angles = {name: -getattr(linkage, name) for name in ANGLES}
    pivot = linkage.pivot
    if isinstance(pivot, syn.SecondCrank):
        pivot = replace(pivot, phase=-pivot.phase)
    made = replace(linkage, **angles, pivot_y=-linkage.pivot_y, branch=-linkage.branch, pivot=pivot)
    np.testing.assert_allclose(made.path(-PHI), linkage.path(PHI) * [1.0, -1.0], atol=1e-12)
    return made


@pytest.mark.parametrize("linkage", [FOUR_BAR, GEARED, SLIDER], ids=lambda x: x.kind)
def test_mirror_images_and_near_copies_stand_behind_the_first(linkage: syn.Linkage) -> None:
    copy = replace(linkage.translate(0.2, 0.1), ground_angle=2.0, coupler_length=0.158)
    one, *others = group_similar([solution(x) for x in (linkage, mirrored(linkage), copy)])
    assert not others
    assert one.linkage is linkage
    assert syn.format_variants(one) == "1 mirror image, 1 near copy"
    # from its other side the guide has the opposite offset
    if isinstance(linkage, syn.SliderCrank):
        turned = {"ground_length": -0.04, "ground_angle": 0.4 + np.pi, "crank_phase": 1.1 - np.pi, "branch": -1}
        same = replace(linkage, **turned)
        np.testing.assert_allclose(same.path(PHI), linkage.path(PHI), atol=1e-12)
        assert syn.format_variants(group_similar([solution(x) for x in (linkage, same)])[0]) == "1 near copy"


@pytest.mark.parametrize(
    ("linkage", "change"),
    [
        (FOUR_BAR, {"branch": -1}),
        (FOUR_BAR, {"point_angle": -0.7}),
        (FOUR_BAR, {"crank_length": 0.057}),
        (scaled(FOUR_BAR, 1.3), {}),
        (SLIDER, {"ground_length": -0.04}),
        (SLIDER, {"branch": -1}),
        (GEARED, {"pivot": syn.SecondCrank(0.03, ratio=-2.0, phase=0.9)}),
        (GEARED, {"pivot": syn.SecondCrank(0.03, ratio=2.0, phase=0.3)}),
    ],
)
def test_other_linkages_are_ranked(linkage: syn.Linkage, change: dict[str, object]) -> None:
    first = {x.kind: x for x in (FOUR_BAR, SLIDER, GEARED)}[linkage.kind]
    assert len(group_similar([solution(first), solution(replace(linkage, **change))])) == 2


def test_the_ellipse_is_traced_by_one_linkage_in_four_places() -> None:
    """The target is its own mirror image in two axes."""
    phi = syn.turn(24)
    task = syn.TimedPath(points=np.column_stack([0.2 + 0.1 * np.cos(phi), 0.15 + 0.05 * np.sin(phi)]))
    found = syn.synthesize(task, search=syn.Search(starts=12, candidates=1 << 13, solutions=4))
    lengths = [sorted(getattr(s.linkage, name) for name in s.linkage.links) for s in found.solutions]
    apart = [np.abs(np.log(np.divide(a, b))).max() for k, a in enumerate(lengths) for b in lengths[:k]]
    assert min(apart, default=1.0) > 0.02
    variants = found.best.variants
    assert "mirror image" in syn.format_variants(found.best)
    assert [s.error for s in variants] == pytest.approx([found.best.error] * len(variants), rel=1e-3)
    columns = found.columns()
    assert columns["rank"] == [float(k) for k in range(1, len(found.with_variants) + 1)]
    assert columns["variant of"].count(1.0) == len(variants)
    assert len(columns["variant of"]) == len(found.with_variants) > len(found.solutions)


@pytest.mark.parametrize("name", [*SIZES, *ANGLES, "output_angle"])
def test_answers_of_slider_cranks_that_differ_in_one_number_are_two(name: str) -> None:
    """And one without an offset is the same one seen from the other side of its guide."""
    task = syn.TimedPath(points=SLIDER.path(PHI))
    normal = normal_form(task)
    slider = replace(SLIDER, ground_length=0.0)
    turned = replace(slider, ground_angle=0.4 + np.pi, crank_phase=1.1 - np.pi, branch=-1)
    np.testing.assert_allclose(turned.path(PHI), slider.path(PHI), atol=1e-12)
    other = replace(slider, **{name: getattr(slider, name) + 0.02})
    answers = [Answer.for_unjoined_links(make_start(linkage, normal)) for linkage in (slider, turned, other)]
    assert [id(one) for one in distinct_answers(answers, 3)] == [id(answers[0]), id(answers[2])]
