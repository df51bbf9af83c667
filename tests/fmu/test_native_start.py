"""What native FMUs compute at the start is traced of the mechanism's own functions, or the build says what cannot be traced."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from analysis.export.equations_c import functions
from linkwork.errors import LinkworkError

from ..mechanisms import pendulum


def branching(self: Any) -> pendulum.Constants:
    return pendulum.Constants(max(self.pendulum_inertia, 1.0) if self.pendulum_inertia > 0.05 else 1.0, 0.0, 1.0)


def of_another(self: Any) -> pendulum.Constants:
    return pendulum.Constants(float(repr(self.pendulum_inertia)[:1] == "0"), 0.0, 1.0)


@pytest.mark.parametrize("constants", [branching, of_another])
def test_constants_that_cannot_be_traced(constants: Callable[[Any], Any]) -> None:
    kind: Any = type("Parameters", (pendulum.Parameters,), {"constants": constants, "__module__": __name__})
    known = pendulum.MECHANISM.published["pendulum-demo"]
    changed = known._replace(parameters=kind(pendulum_inertia=0.1, pendulum_weight=2.0))
    mechanism = replace(pendulum.MECHANISM, parameters=kind, published={"changed": changed})
    with pytest.raises(LinkworkError, match=r"start of pendulum.*constants, RULES and error_scale must be arithmetic"):
        functions(mechanism)
