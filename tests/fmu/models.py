"""List the FMUs under test, and parametrise tests with cases for each of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

#: Changes of source files: by path below the source root, the text to replace and its replacement.
Changes = dict[str, tuple[str, str]]


class Model(NamedTuple):
    """Data of an FMU under test, with which one test can run on every FMU.

    ``plant`` is the name of its package. ``force`` is an input that drives one of its freedoms while a torque drives the crank;
    with the value ``too_much`` it reaches the limit of assembly within a tenth of a second. ``free`` are values that leave both
    freedoms to forces. ``equation`` is a change of one constant in its equations of motion that has an effect in torque drive.
    """

    name: str
    plant: str
    force: str
    too_much: float
    free: dict[str, float]
    equation: Changes

    @property
    def slave(self) -> str:
        """Return the name of the slave's module."""
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
            # a term of the crank's inertia that couples crank and coupler, 2 q3
            {"linkwork/five_bar/dynamics.py": ("g3 * q3 - w3 * w3 * n3", "g3 * q3 - 1.01 * w3 * w3 * n3")},
        ),
        Model(
            "SliderCrank",
            "slider_crank",
            "axial.force",
            1e5,
            {"drive.mode": 0, "axial.mode": 0},
            # a term of the crank's inertia in which the rod couples the velocities of the pins
            {"linkwork/slider_crank/dynamics.py": ("k.kth * (2.0 * p.m23", "k.kth * (2.02 * p.m23")},
        ),
    )
}


#: All modes of each FMU, by name.
MODES = {
    "FiveBarSlider": {"torque": {"drive.mode": 0}, "speed": {"drive.mode": 1}},
    "SliderCrank": {f"{d}-{a}": {"drive.mode": d, "axial.mode": a} for d in (0, 1) for a in (0, 1, 2)},
}


def each(cases: Mapping[str, Mapping[str, Any]], *names: str) -> pytest.MarkDecorator:
    """Parametrise a test over the cases of each model; the name of a test has the model and the case.

    The arguments ``names`` (by default ``case``) take the values of a case; a single argument takes the whole case.
    """
    names = names or ("case",)
    rows, labels = [], []
    for model in MODELS:
        for label, value in cases[model].items():
            rows.append((model, *(value if len(names) > 1 else (value,))))
            labels.append(f"{model}-{label}")
    return pytest.mark.parametrize(("model", *names), rows, ids=labels, indirect=["model"])
