"""The FMUs under test, and the marks that run a test on each of them with cases of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

#: Paths below the source root, each with a text to replace in the file and what to put there.
Changes = dict[str, tuple[str, str]]


class Model(NamedTuple):
    """What a test has to know of an FMU to be the same for all of them.

    ``plant`` names its package, ``force`` is an input that drives the first or the second freedom
    where a torque drives the crank, ``too_much`` a value of it that ends in the limit of assembly within a tenth of a
    second. ``free`` are values that leave both freedoms to forces, ``equation`` is a change of one constant in its
    equations of motion, which shows in torque drive.
    """

    name: str
    plant: str
    force: str
    too_much: float
    free: dict[str, float]
    equation: Changes

    @property
    def slave(self) -> str:
        """Name of the slave's module."""
        return f"{self.plant}_slave"


MODELS = {
    model.name: model
    for model in (
        Model(
            "FiveBarSlider",
            "five_bar",
            "slider.force",
            1e5,
            {"drive.mode": 0},
            # the coupler's coupling into the crank's inertia, 2 q3
            {"linkwork/five_bar/dynamics.py": ("g3 * q3 - w3 * w3 * n3", "g3 * q3 - 1.01 * w3 * w3 * n3")},
        ),
        Model(
            "SliderCrank",
            "slider_crank",
            "axial.force",
            1e5,
            {"drive.mode": 0, "axial.mode": 0},
            # the rod's coupling of the pins' velocities into the crank's inertia
            {"linkwork/slider_crank/dynamics.py": ("k.kth * (2.0 * p.m23", "k.kth * (2.02 * p.m23")},
        ),
    )
}


#: Every way to drive each.
MODES = {
    "FiveBarSlider": {"torque": {"drive.mode": 0}, "speed": {"drive.mode": 1}},
    "SliderCrank": {f"{d}-{a}": {"drive.mode": d, "axial.mode": a} for d in (0, 1) for a in (0, 1, 2)},
}


def each(cases: Mapping[str, Mapping[str, Any]], *names: str) -> pytest.MarkDecorator:
    """Parametrise a test over the cases of each model, by model and by the name of the case.

    The arguments ``names`` (by default ``case``) take the value of a case, one of them all of it.
    """
    names = names or ("case",)
    rows, labels = [], []
    for model in MODELS:
        for label, value in cases[model].items():
            rows.append((model, *(value if len(names) > 1 else (value,))))
            labels.append(f"{model}-{label}")
    return pytest.mark.parametrize(("model", *names), rows, ids=labels, indirect=["model"])
