"""Ensembles on a graphics processor: the kernel's code compiled for this processor, and for a device where there is one."""

import importlib.util
import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import types

from analysis import Function, Harmonics, InductionMotor, Inputs, TorsionBar, ramp, simulate_many, steps, table
from analysis.libraries import MissingLibraryError
from analysis.mechanisms import FIVE_BAR
from analysis.numerics import device, lanes
from analysis.numerics.codegen import MATRIX, evaluate
from analysis.run import load_case, on_device
from analysis.run.equations import run_functions
from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.published import TABLE_3_1
from tests.analysis.test_lanes import arguments_of, values
from tests.oracles import device as none

EXAMPLES = Path(__file__).parents[2] / "examples"

casadi = pytest.importorskip("casadi")

ARGUMENTS = types.Tuple((MATRIX, MATRIX, MATRIX))
read_arguments = device.reader(ARGUMENTS)


def apply(i, table):
    """Apply the first equation to the numbers i of two arrays."""
    a, b, out = read_arguments(table)
    evaluate(device.equations()[0], 0.0, a[i], b[i], b[i], b[i], out[i])


def on_this_processor(name: str, *arguments: np.ndarray) -> np.ndarray:
    """The function of arrays, computed by the code for devices."""
    symbols = [casadi.SX.sym("t"), *(casadi.SX.sym(letter) for letter in "abcd")]
    function = getattr(casadi, name, lambda x, y: x**y)(*symbols[1 : 1 + len(arguments)])
    code = none.Processor(device.compile_kernel(apply), [casadi.Function("f", symbols, [function])])
    a, b = (np.ascontiguousarray(x, float).reshape(-1, 1) for x in (arguments[0], arguments[-1]))
    out = np.empty_like(a)
    table = np.array(device.pack(ARGUMENTS, (a, b, out), lambda array: array.ctypes.data), dtype=np.int64)
    for i in range(len(a)):
        code.call(i, table.ctypes.data)
    return out.ravel()


@pytest.mark.skipif(lanes.width() == 1, reason="the processor has no fused multiplication of vectors")
@pytest.mark.parametrize("name", sorted(set(lanes.BOUNDS) - {"sqrt", "fabs"}))
def test_elementary_functions_have_the_bits_of_the_lanes(name: str) -> None:
    for arguments in arguments_of(name):
        near = abs(arguments[0]) <= lanes.GREATEST_ANGLE
        ours, theirs = on_this_processor(name, *arguments), values(name, *arguments)
        if name in ("sin", "cos", "tan"):
            assert np.isnan(ours[~near]).all()
            ours, theirs = ours[near], theirs[near]
        assert np.array_equal(ours, theirs)


def test_powers() -> None:
    g = np.random.default_rng(4)
    x, y = np.exp(g.uniform(-20.0, 20.0, 500)), g.uniform(-9.0, 9.0, 500)
    exact = x**y
    errors = abs(on_this_processor("pow", x, y) - exact) / np.spacing(exact)
    assert np.max(errors - (2.0 + 3.0 * abs(y * np.log(x)))) <= 0.0
    bases, powers = np.array([-2.0, -2.0, -2.0, 0.0, 0.0, -3.0, 5.0]), np.array([3.0, -2.0, 0.5, 2.0, 0.0, 0.0, -1.0])
    assert on_this_processor("pow", bases, powers) == pytest.approx([-8.0, 0.25, math.nan, 0, 1, 1, 0.2], nan_ok=True)


@pytest.fixture(autouse=True)
def fresh_solver() -> Iterator[None]:
    """No solver on a device is kept from another test."""
    on_device.solver.cache_clear()
    yield
    on_device.solver.cache_clear()


@pytest.fixture(scope="module")
def solvers() -> dict[Any, Any]:
    """Solvers for this processor in the place of a device, by their functions, which are compiled once."""
    return {}


@pytest.fixture
def without_device(monkeypatch: pytest.MonkeyPatch, solvers: dict[Any, Any]) -> None:
    """CuPy without a device: this processor runs the same kernel."""
    cuda = device.Cuda

    def make(function: Any, equations: Any) -> device.Cuda:
        key = (function, *(equation.serialize() for equation in equations))
        if key not in solvers:
            made = none.Processor(device.compile_kernel(function), equations)
            monkeypatch.setitem(sys.modules, "cupy", none.cupy(made))
            solvers[key] = cuda(function, equations)
        solver: device.Cuda = solvers[key]
        return solver

    monkeypatch.setattr(device, "Cuda", make)


def softer(**options: Any) -> Any:
    """Runs of Table 3.1 with several springs, on a device unless another is given."""
    return simulate_many(TABLE_3_1, vary=SOFTER, **{"stop_time": 0.1, "device": "cuda"} | options)


SOFTER = {"slider.stiffness": np.linspace(700.0, 1300.0, 9)}
MOTOR = InductionMotor(breakdown_torque=10.0, breakdown_slip=0.3, synchronous_speed=60.0)
FRICTION = {"slider.coulomb_friction": np.linspace(0.5, 3.0, 5)}
SPEED = ramp(40.0, 55.0, 0.1, 0.3)
FORCE = table([0.0, 0.1, 0.2, 0.4], [0.0, 20.0, -10.0, 5.0], kind="cubic")
DAMPED = [replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=damping) for damping in (8.0, 10.0, 300.0)]
CASES: dict[str, dict[str, Any]] = {
    "speed": {"vary": SOFTER, "outputs": ["slider.position", "pin.A.fx"]},
    "jump": {"inputs": Inputs(speed=steps([0.0, 0.15], [40.0, 55.0])), "vary": SOFTER},
    "ramp and harmonics": {"inputs": Inputs(speed=SPEED, force=Harmonics(5.0, [20.0], [30.0], [0.4])), "vary": SOFTER},
    "torque and table": {"inputs": Inputs(torque=0.3, force=FORCE), "vary": SOFTER},
    "torsion bar": {"inputs": Inputs(torque=TorsionBar(torque=10.0)), "vary": SOFTER},
    "motor": {"inputs": Inputs(torque=MOTOR), "vary": SOFTER},
    "held": {"inputs": Inputs(speed=SPEED, force=FORCE), "vary": SOFTER, "hold": 1e-3},
    "friction": {"inputs": Inputs(speed=43.98), "vary": FRICTION, "tolerance": 1e-11},
    "to the limit": {"parameters": DAMPED, "inputs": Inputs(speed=43.98), "stop_time": 0.6},
    "slider-crank": {"parameters": "rahman-ideal", "vary": {"rod.mass": np.linspace(0.5, 1.5, 5)}},
    "own linkage": {"vary": {"across.stiffness": np.linspace(1e5, 3e5, 5)}},
}


@pytest.mark.usefixtures("without_device")
@pytest.mark.parametrize("case", CASES)
def test_runs_are_those_of_the_processor(case: str) -> None:
    """The steps are the same, and differences are those of rounding; where friction sticks, rounding may decide on a step."""
    arguments = {"parameters": TABLE_3_1, "stop_time": 0.4, **CASES[case]}
    if case == "own linkage":
        own = load_case(EXAMPLES / "linkages" / "elastic-bearing.toml")
        arguments |= {"parameters": own.parameters, "inputs": own.inputs, "initial": own.initial}
    ours, theirs = simulate_many(device="cuda", **arguments), simulate_many(**arguments)
    assert ours.status.tolist() == theirs.status.tolist()
    assert ours.counts.tolist() == theirs.counts.tolist()
    if case == "to the limit":
        assert 3 in ours.status
    for a, b in zip(*((run.states, run.forces) if run.values is None else (run.values,) for run in (ours, theirs))):
        size = np.nanmax(abs(b), axis=(0, 1))
        allowed = 1e-8 if case == "friction" else 1e-11
        assert np.all(np.nanmax(abs(a - b), axis=(0, 1)) <= allowed * size + 1e-15)


@pytest.mark.usefixtures("without_device")
def test_runs_of_many_steps_go_on_and_those_that_cannot_start_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = softer(stop_time=0.3)
    monkeypatch.setattr(on_device, "STEPS_PER_LAUNCH", 3)
    parts = softer(stop_time=0.3, batch=2)
    assert np.array_equal(whole.states, parts.states)
    apart = replace(TABLE_3_1, rocker_length=0.01)
    some = simulate_many([TABLE_3_1, apart], stop_time=0.1, device="cuda")
    assert some.status.tolist() == [0, 3]


@pytest.mark.usefixtures("without_device")
def test_results_of_a_device_are_kept_apart(tmp_path: Path) -> None:
    for which in ("cuda", None, "cuda"):
        softer(folder=tmp_path, device=which)
    assert len(list(tmp_path.glob("*.runs"))) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"device": "opencl"}, "device is 'opencl': it must be 'cuda', or left out"),
        ({"device": "cuda", "n_jobs": 2}, "n_jobs is 2: with a device"),
        ({"device": "cuda", "inputs": Inputs(force=Function(lambda t, *x: 0.0))}, "Python functions cannot"),
    ],
)
def test_what_does_not_fit_a_device_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        softer(**options)


def failing(name: str, said: str) -> Any:
    """CuPy of which a function fails."""

    def fail(*_: object, **__: object) -> None:
        raise none.Error(said)

    made = none.cupy(None)
    setattr(made, name, fail)
    return made


@pytest.mark.parametrize(
    ("cupy", "error", "said"),
    [
        (None, MissingLibraryError, r"cupy-cuda12x.*'cuda'"),
        (none.cupy(None, available=False), LinkworkError, "no graphics processor"),
        (failing("asarray", "out of memory"), LinkworkError, r"failed \(out of memory\): .* a smaller batch"),
        (failing("RawModule", "no kernel image"), LinkworkError, r"\(no kernel image\): it must be from 2018 or later"),
    ],
)
def test_no_library_no_device_and_its_errors_are_told(monkeypatch: Any, cupy: Any, error: Any, said: str) -> None:
    monkeypatch.setitem(sys.modules, "cupy", cupy)
    with pytest.raises(error, match=said):
        softer()


def test_nvidias_assembler_takes_the_code(tmp_path: Path) -> None:
    """For the oldest devices, and for the newest that the assembler knows."""
    found = importlib.util.find_spec("nvidia.cuda_nvcc")
    if found is None or not found.submodule_search_locations:
        pytest.skip("nvidia-cuda-nvcc-cu12 is not installed")
    assembler = Path(found.submodule_search_locations[0], "bin", "ptxas")
    code = tmp_path / "kernel.ptx"
    code.write_bytes(device.compile_to_ptx(device.compile_kernel(on_device.run_thread), run_functions(FIVE_BAR)))
    assert b".extern" not in code.read_bytes()
    for architecture in (device.ARCHITECTURE, "sm_90"):
        command = [assembler, f"--gpu-name={architecture}", code, "--output-file", tmp_path / "kernel.cubin"]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


def test_a_device_has_the_bits_of_this_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    cupy = pytest.importorskip("cupy", reason="CuPy is not installed")
    if not cupy.cuda.is_available():
        pytest.skip("there is no device")
    theirs = softer(stop_time=0.4)
    on_device.solver.cache_clear()
    kernel, functions = device.compile_kernel(on_device.run_thread), run_functions(FIVE_BAR)
    monkeypatch.setitem(sys.modules, "cupy", none.cupy(none.Processor(kernel, functions)))
    assert np.array_equal(theirs.states, softer(stop_time=0.4).states)
