"""Mechanisms for the tests that are not from the two theses; each is one folder, registered by one line."""

from __future__ import annotations

from dataclasses import make_dataclass
from types import ModuleType
from typing import Any

from linkwork.mechanism import Equations, Freedom, Mechanism, PublishedSet
from linkwork.parameters import CheckedState


def make_initial(module: str, *names: str) -> Any:
    """Make the class ``Initial`` of a module: the state at the start, with coordinates and rates of these names."""
    fields = [(name, float, 0.0) for name in names]
    kind = make_dataclass("Initial", fields, bases=(CheckedState,), frozen=True, slots=True, kw_only=True)
    kind.__module__ = module
    return kind


def make_mechanism(
    equations: ModuleType, demo: tuple[str, Any, Any, dict[str, float]], freedoms: tuple[Freedom, ...], **parts: Any
) -> Mechanism:
    """Make a mechanism from its equations and the name, parameters, start and inputs of its published set."""
    name, parameters, initial, inputs = demo
    return Mechanism(
        parameters=type(parameters),
        initial=type(initial),
        published={name: PublishedSet(parameters, initial, inputs, "made up for the tests")},
        freedoms=freedoms,
        position_parameters=tuple(f"initial.{freedom.initial[0]}" for freedom in freedoms),
        experiment=(0.0, 1.0, 1e-3, 1e-9),
        modules=(equations,),
        equations=Equations.of(equations),
        check_assembly=lambda parameters, x: None,
        error_scale=equations.error_scale,
        **parts,
    )
