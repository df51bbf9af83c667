"""The slave class by itself, without the wrapper: what it says to the one who holds it."""

from typing import Any

import pytest

from build_fmu import FMUS
from linkwork.errors import ParameterError
from slave import LinkworkSlave

from .models import Model

SLAVES = {name: type(name, (LinkworkSlave,), {"mechanism": mechanism}) for name, mechanism in FMUS.items()}


@pytest.fixture
def kind(model: Model) -> type[LinkworkSlave]:
    """The class of the slave under test."""
    return SLAVES[model.name]


@pytest.fixture
def slave(kind: type[LinkworkSlave]) -> LinkworkSlave:
    """A slave that is initialised."""
    new = kind(instance_name="slave")
    new.setup_experiment(0.0, None, None)
    new.enter_initialization_mode()
    new.exit_initialization_mode()
    return new


def value(slave: LinkworkSlave, name: str) -> Any:
    reference = [v.name for v in slave.variables].index(name)
    kind = slave.variables[reference].kind
    return getattr(slave, f"get_{kind.lower()}")([reference])[0]


@pytest.mark.parametrize(
    "error", [RuntimeError("something"), ZeroDivisionError(), KeyError("x"), RecursionError(), MemoryError()], ids=repr
)
def test_no_exception_escapes_from_a_step(
    slave: LinkworkSlave, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(time: float, step: float) -> None:
        raise error

    assert slave.do_step(0.0, 1e-3)
    before = value(slave, "slider.position")
    monkeypatch.setattr(slave._plant, "step", fail)
    assert slave.do_step(1e-3, 1e-3) is False
    assert value(slave, "solver.status") == 9
    assert value(slave, "solver.message") == f"internal error at t = 0.001 s: {error!r}"
    assert value(slave, "slider.position") == before
    monkeypatch.undo()
    assert slave.do_step(1e-3, 1e-3)
    assert value(slave, "solver.status") == 0
    assert value(slave, "solver.message") == ""


def test_no_exception_escapes_from_a_read(slave: LinkworkSlave, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise RuntimeError("something")

    before = value(slave, "slider.position")
    slave.do_step(0.0, 1e-3)
    monkeypatch.setattr(slave._plant, "outputs", fail)
    assert value(slave, "slider.position") == before
    assert value(slave, "solver.status") == 9
    assert "something" in value(slave, "solver.message")


def test_bad_parameter_is_raised_by_the_initialisation_alone(kind: type[LinkworkSlave]) -> None:
    slave = kind(instance_name="slave")
    reference = [v.name for v in slave.variables].index("crank.length")
    slave.set_real([reference], [-1.0])
    slave.setup_experiment(0.0, None, None)
    slave.enter_initialization_mode()
    assert value(slave, "solver.status") == 6
    assert slave.log_queue == []
    with pytest.raises(ParameterError, match=r"crank\.length is -1\.0"):
        slave.exit_initialization_mode()
    assert len(slave.log_queue) == 1
    # put right, it goes on as if nothing had been
    slave.set_real([reference], [0.05])
    slave.exit_initialization_mode()
    assert value(slave, "solver.status") == 0
    assert slave.do_step(0.0, 1e-3)


def test_master_tolerance_outside_the_range_is_brought_into_it(kind: type[LinkworkSlave]) -> None:
    for given, taken in [(None, 1e-9), (1e-3, 1e-9), (1e-11, 1e-11), (0.0, 1e-13), (-1.0, 1e-13)]:
        slave = kind(instance_name="slave")
        slave.setup_experiment(0.0, None, given)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        assert slave._get_fmu_state()["plant"]["tolerance"] == taken


def test_a_tunable_parameter_acts_from_the_next_step_on(slave: LinkworkSlave) -> None:
    at = [v.name for v in slave.variables].index("slider.stiffness")
    assert slave.do_step(0.0, 1e-2)
    before = value(slave, "slider.acceleration")
    slave.set_real([at], [1e5])
    assert value(slave, "slider.stiffness") == 1e5
    assert value(slave, "energy.residual") == pytest.approx(0.0, abs=1e-6)
    assert (
        value(slave, "slider.acceleration") != before or slave.mechanism.fmu == "SliderCrank"
    )  # where both are commanded
    with pytest.raises(ParameterError, match=r"slider\.stiffness is -1"):
        slave.set_real([at], [-1.0])
    assert value(slave, "slider.stiffness") == 1e5
    assert slave.do_step(1e-2, 1e-2)
    assert value(slave, "energy.residual") == pytest.approx(0.0, abs=1e-5)
