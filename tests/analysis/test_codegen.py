"""Machine code of the equations, kernels that call it, and the cache that keeps kernels for the next process."""

import errno
import io
import math
import os
import pickle
import stat
import subprocess
import sys
import tempfile
import zlib
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import float64, int64, njit

from analysis.mechanisms import FIVE_BAR, MECHANISMS, SLIDER_CRANK
from analysis.numerics import codegen
from analysis.numerics.cache import _warn_shared, code_folder
from analysis.numerics.codegen import VECTOR, Kernel, MachineCode, evaluate, fingerprint, inner, kernel
from analysis.numerics.symbolic import ELEMENTARY
from analysis.numerics.vectors import weighted_rows
from analysis.run import compiled, machine, simulate, sources
from analysis.run.equations import CLEARANCE, DERIVATIVE, JUMP, OUTPUTS
from analysis.run.prepared import compute_outputs
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from tests import slider_cranks, strategies
from tests.conftest import UNCHECKED
from tests.fmu.runner import run_in_process

casadi = pytest.importorskip("casadi")

ROOT = Path(__file__).parents[2]


def call(mechanism: Mechanism, which: int, size: int, x: Any, modes: Any, u: Any, p: Any) -> np.ndarray:
    """A function of the equations at one state."""
    out = np.empty((1, size))
    address, parameters = machine(mechanism).addresses[which], np.array([*p, 0.3])
    compiled.rows(address, 1, np.array(modes), parameters, np.array([x]), np.array([u]), out)
    return out[0]


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("name", MECHANISMS)
def test_machine_code_has_the_values_of_the_plain_functions(name: str, seed: int) -> None:
    mechanism, equations = MECHANISMS[name], MECHANISMS[name].equations
    generator = np.random.default_rng(seed)
    if mechanism in (FIVE_BAR, SLIDER_CRANK):
        case: Any = (strategies if mechanism is FIVE_BAR else slider_cranks).seeded(seed)
        p, x = case.parameters.constants(), tuple(map(float, case.state))
    else:
        known = next(iter(mechanism.published.values()))
        p, rates = known.parameters.constants(), 1.0 + generator.normal(size=mechanism.size)
        x = tuple((np.array(mechanism.state(known.initial)) + 1e-3 * rates).tolist())
    u = tuple(generator.normal(size=len(mechanism.channels)).tolist())
    for modes in np.ndindex(*[len(mode.values) for mode in mechanism.modes]):
        flags = tuple(map(float, modes))
        i = equations.apply_inputs(flags, u, p)
        plain = {
            DERIVATIVE: equations.derivative(x, i, p),
            OUTPUTS: equations.outputs(x, i, 0.3, p),
            CLEARANCE: (equations.clearance(x, i, p),),
            JUMP: equations.jump(x, i, u, p),
        }
        for which, values in plain.items():
            ours = call(mechanism, which, len(values), x, flags, u, p)
            size = max(1.0, max(map(abs, values)))
            assert ours == pytest.approx(values, rel=1e-11, abs=1e-13 * size)
        # in lanes, a full vector and part of one
        states, forces = np.tile(x, (11, 1)), np.tile(u, (11, 1))
        ours = compute_outputs(mechanism, np.array(flags), np.array([*p, 0.3]), states, forces)
        assert (ours == ours[0]).all()
        size = max(1.0, max(map(abs, plain[OUTPUTS])))
        assert ours[0] == pytest.approx(plain[OUTPUTS], rel=1e-11, abs=1e-13 * size)


def test_configuration_that_does_not_exist_is_nan() -> None:
    case = strategies.seeded(1)
    x = (case.state[0], 100.0, *case.state[2:])
    rates = call(FIVE_BAR, DERIVATIVE, 6, x, (0.0,), (0.0,) * 6, case.parameters.constants())
    assert np.isnan(rates[2:4]).all()


def test_equations_have_one_fingerprint_and_each_their_own() -> None:
    assert machine(FIVE_BAR).fingerprint != machine(SLIDER_CRANK).fingerprint


def function_of(expression: Any) -> Any:
    symbols = [casadi.SX.sym("t"), *(casadi.SX.sym(name, 2) for name in "abcd")]
    return casadi.Function("f", symbols, [casadi.densify(casadi.SX(expression(*symbols)))])


@kernel(float64(int64, float64, VECTOR), purpose="a test")
def value_at(address: Any, t: Any, a: Any) -> Any:
    """First output of a function."""
    out = np.empty(4)
    evaluate(address, t, a, a, a, a, out)
    return out[0]


@pytest.mark.parametrize(
    ("expression", "plain"),
    [
        (lambda t, a, *_: a[0] + t, lambda t, a: a[0] + t),
        (lambda t, a, *_: (a[0] - a[1]) / (a[0] * t), lambda t, a: (a[0] - a[1]) / (a[0] * t)),
        (lambda t, a, *_: casadi.sin(a[0]) * casadi.cos(a[1]), lambda t, a: np.sin(a[0]) * np.cos(a[1])),
        (lambda t, a, *_: casadi.atan2(a[0], a[1]), lambda t, a: np.arctan2(a[0], a[1])),
        (lambda t, a, *_: casadi.tanh(a[0]) + casadi.sqrt(a[0]), lambda t, a: np.tanh(a[0]) + np.sqrt(a[0])),
        (lambda t, a, *_: casadi.fabs(-a[0] * a[0]) + 2 * a[1], lambda t, a: a[0] ** 2 + 2 * a[1]),
        (lambda t, a, *_: 1 / a[0] - 3.5, lambda t, a: 1 / a[0] - 3.5),
    ],
)
def test_every_operation(expression: Any, plain: Any) -> None:
    a = np.array([0.7, 1.9])
    code = MachineCode([function_of(expression)])
    assert value_at(code.addresses["f"], 0.4, a) == pytest.approx(plain(0.4, a), rel=1e-15)


@pytest.mark.parametrize("name", ELEMENTARY)
def test_what_equations_may_call_and_its_derivatives(name: str) -> None:
    """Values are those of the standard library; derivatives those of CasADi's own interpreter."""
    function, a = getattr(casadi, name, lambda x, y: x**y), np.array([0.7, 1.9])
    arguments = 2 if name in ("atan2", "hypot", "pow") else 1

    def derivatives(order: int) -> Any:
        def expression(t: Any, x: Any, *_: Any) -> Any:
            f = function(*casadi.vertsplit(x)[:arguments])
            for _ in range(order):
                f = casadi.gradient(f, x)[0]
            return f

        return function_of(expression)

    value = value_at(MachineCode([derivatives(0)]).addresses["f"], 0.0, a)
    assert value == pytest.approx(getattr(math, name)(*a[:arguments]), rel=4e-16)
    for order in (1, 2):
        traced = derivatives(order)
        found = value_at(MachineCode([traced]).addresses["f"], 0.0, a)
        assert found == pytest.approx(float(traced(0.0, a, a, a, a)), rel=4e-15, abs=1e-15)


def test_matrices_are_written_column_by_column() -> None:
    symbols = [casadi.SX.sym("t"), *(casadi.SX.sym(name, 2) for name in "abcd")]
    matrix = casadi.vertcat(casadi.horzcat(1.0, 2.0), casadi.horzcat(3.0, 4.0)) * symbols[1][0]
    code = MachineCode([casadi.Function("f", symbols, [casadi.densify(matrix)])])
    out = np.empty((1, 4))
    one = np.ones(2)
    compiled.rows(code.addresses["f"], 1, one, one, np.array([[2.0, 0.0]]), np.array([[0.0, 0.0]]), out)
    assert out[0].tolist() == [2.0, 6.0, 4.0, 8.0]


def test_a_sparse_output_and_an_operation_without_counterpart_are_refused() -> None:
    symbols = [casadi.SX.sym("t"), *(casadi.SX.sym(name, 2) for name in "abcd")]
    with pytest.raises(LinkworkError, match="structural zeros"):
        MachineCode([casadi.Function("f", symbols, [casadi.jacobian(symbols[1], symbols[1])])])
    with pytest.raises(LinkworkError, match="OP_ERF"):
        MachineCode([casadi.Function("f", symbols, [casadi.erf(symbols[0])])])


# --- The cache


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for compiled code, and one for temporary files beside it."""
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    return tmp_path / "cache"


def flipped(content: bytes, share: float) -> bytes:
    """Return bytes of which one bit, at a share of their length, is another."""
    changed = bytearray(content)
    changed[int(share * len(content))] ^= 4
    return bytes(changed)


def _compile_and_run() -> dict[str, Any]:
    from time import perf_counter

    begun = perf_counter()
    from pathlib import Path

    from analysis import Inputs, simulate, simulate_many
    from analysis.numerics import codegen
    from analysis.run import compiled, lanes, sources
    from linkwork.five_bar.published import TABLE_3_1

    codegen.CARRIED = Path("nothing is carried")
    run = simulate(TABLE_3_1, Inputs(speed=44.0), stop_time=0.1)
    simulate_many([TABLE_3_1], Inputs(speed=44.0), stop_time=0.1)
    used = (compiled.run, lanes.run_in_lanes, compiled.channels_of_many, compiled.rows, sources.channels)
    kernels = [k.compiled.stats for k in used]
    return {
        "seconds": perf_counter() - begun,
        "hits": sum(sum(stats.cache_hits.values()) for stats in kernels),
        "misses": sum(sum(stats.cache_misses.values()) for stats in kernels),
        "position": float(run["slider.position"][-1]),
    }


@pytest.mark.slow
def test_second_process_finds_the_code_of_the_first(cache: Path) -> None:
    first = run_in_process(_compile_and_run, timeout=180.0)
    second = run_in_process(_compile_and_run)
    assert (first["hits"], first["misses"]) == (0, 5)
    assert (second["hits"], second["misses"]) == (5, 0)
    assert second["seconds"] < 0.5 * first["seconds"]
    assert second["position"] == first["position"]
    assert len(list(cache.glob("numba-*"))) == 5
    assert any(cache.rglob("*.nbi"))


@pytest.mark.usefixtures("cache")
def test_each_compilation_says_once_what_it_is_for(monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.setattr(codegen._Announcer, "said", set())

    @inner
    def helper(x: Any) -> Any:
        return 2.0 * x

    @kernel(float64(float64), purpose="an example")
    def example(x: Any) -> Any:
        return helper(x) + 1.0

    @kernel(float64(float64), purpose="an example")
    def another(x: Any) -> Any:
        return helper(x) + 2.0

    assert example(2.0) == 5.0
    assert example(3.0) == 7.0
    assert another(2.0) == 6.0
    assert capsys.readouterr().err == "linkwork: compiling an example, once on this machine ...\n"
    # machine code is of the kernels alone, which have the helper in them
    (part,) = helper.overloads.values()
    assert part.library.get_pointer_to_function(part.fndesc.llvm_func_name) == 0


def test_fingerprint_follows_every_function_and_constant_that_is_compiled() -> None:
    def with_helper(factor: float, source: str = "x * FACTOR") -> Any:
        space: dict[str, Any] = {"FACTOR": factor, "inner": inner}
        exec(f"@inner\ndef helper(x):\n    return {source}\ndef f(x):\n    return helper(x)\n", space)
        return space["f"]

    same = {fingerprint(with_helper(2.0)) for _ in range(3)}
    assert len(same) == 1
    others = {fingerprint(with_helper(3.0)), fingerprint(with_helper(2.0, "x + FACTOR"))}
    assert len(same | others) == 3


def test_folder_that_cannot_be_written_to_falls_back_to_a_temporary_one(cache: Path, monkeypatch: Any) -> None:
    cache.touch()
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(cache / "below a file"))
    folder = code_folder("a")
    assert folder.is_dir()
    assert folder.is_relative_to(tempfile.tempdir or "")
    # the same again for the next process
    assert code_folder("a") == folder


@inner
def _helper(x: Any) -> Any:
    return x + 1.0


def _example(x: Any) -> Any:
    a = np.empty(3)
    a[:] = _helper(x)
    return a.sum() + np.sin(x)


def _made(function: Any = _example) -> Kernel:
    return Kernel(function, (float64(float64),), "an example")


@pytest.fixture
def carried(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The code for any processor of a kernel; the cache is empty, and compilations are announced."""
    monkeypatch.setattr(codegen, "CARRIED", tmp_path / "carried")
    monkeypatch.setattr(codegen._Announcer, "said", set())
    path = _made().carry()
    assert path == _made().carried_path
    return path


def test_code_for_any_processor_is_used_without_compiling(carried: Path, capsys: Any) -> None:
    assert _made()(0.7) == 3.0 * 1.7 + math.sin(0.7)
    assert any((carried.parents[1] / "cache").rglob("*.nbc"))
    carried.unlink()
    assert _made()(0.7) == 3.0 * 1.7 + math.sin(0.7)  # from the cache
    assert capsys.readouterr().err == ""
    assert _made(_doubled)(0.7) == 1.4
    assert "compiling an example" in capsys.readouterr().err


@pytest.mark.parametrize("harm", [0.0, 0.5, 0.9999, "another LLVM"])
def test_code_for_any_processor_that_cannot_be_read_is_not_used(carried: Path, harm: Any, capsys: Any) -> None:
    content = carried.read_bytes()
    if isinstance(harm, float):
        carried.write_bytes(flipped(content, harm))
    else:
        name, code, *rest = pickle.loads(zlib.decompress(content[:-32]))
        content = zlib.compress(pickle.dumps((name, code[: len(code) // 2], *rest)))
        carried.write_bytes(content + sha256(content).digest())
    with pytest.warns(RuntimeWarning, match=f"{carried} is not used"):
        assert _made()(0.7) == 3.0 * 1.7 + math.sin(0.7)
    assert "compiling an example" in capsys.readouterr().err


def test_an_unchecked_call_is_that_of_the_machine_code() -> None:
    kernel = _made()
    unchecked = UNCHECKED.__get__(kernel)
    assert unchecked(0.7) == kernel(0.7)
    with pytest.raises(TypeError, match="No matching definition"):
        kernel("0.7")
    # Numba takes 26 us to find it, so that it is not asked again
    kernel._compiled = None
    assert UNCHECKED.__get__(kernel) is unchecked


def test_weighted_sums_of_rows_are_added_in_the_order_of_their_weights() -> None:
    table = [[], [(2, -1.25), (0, 0.1), (1, 7.0)], [(1, 3.3)]]
    combine = weighted_rows(table)

    @njit(error_model="numpy")
    def both(n, x, rows, h, out, without_x):
        combine(n, x, rows, h, out)
        combine(n, None, rows, h, without_x)

    generator = np.random.default_rng(1)
    for columns in (1, 2, 3, 6):
        rows, x = generator.normal(size=(3, columns)), generator.normal(size=columns)
        out, without_x = np.full((2, columns), 9.0)
        both(0, x, rows, 0.3, out, without_x)
        assert (np.array([out, without_x]) == 9.0).all(), "the sum number 0 is empty"
        for n in (1, 2):
            both(n, x, rows, 0.3, out, without_x)
            total = sum(weight * rows[row] for row, weight in table[n])
            assert (np.array([out, without_x]) == [x + 0.3 * total, 0.3 * total]).all()


def test_an_installation_carries_every_kernel() -> None:
    script = (ROOT / "packaging" / "kernels.py").read_text(encoding="utf-8")
    for path in (ROOT / "analysis").rglob("*.py"):
        if "\n@kernel(" in path.read_text(encoding="utf-8"):
            assert f'"{".".join(path.relative_to(ROOT).with_suffix("").parts)}",\n' in script


@pytest.mark.slow
def test_code_for_any_processor_gives_the_same_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernels = (compiled.run, compiled.rows, sources.channels)

    def run(cache: str) -> tuple[str, int]:
        """Return a number of a run on an empty cache, and how many of its kernels were not compiled."""
        monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / cache))
        for one in kernels:
            monkeypatch.setattr(one, "_compiled", None)
        position = simulate("table-3.1", stop_time=0.5)["slider.position"][-1]
        return float(position).hex(), sum(bool(one.compiled.stats.cache_hits) for one in kernels)

    monkeypatch.setattr(codegen, "CARRIED", tmp_path / "carried")
    here, found = run("compiled here")
    assert found == 0
    for one in kernels:
        one.carry()
    assert run("carried") == (here, 3)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("harm", ["cut", "empty", "junk", 0.0, 0.4, 0.7, 0.9999])
def test_damaged_machine_code_is_compiled_again(cache: Path, suffix: str, harm: str | float) -> None:
    """The file is cut, emptied, replaced, or has one bit flipped at a share of its length."""
    assert _made(_doubled)(2.0) == 4.0
    (path,) = cache.rglob(f"*.{suffix}")
    content = path.read_bytes()
    if isinstance(harm, float):
        path.write_bytes(flipped(content, harm))
    else:
        path.write_bytes({"cut": content[: len(content) // 2], "empty": b"", "junk": b"junk" * 99}[harm])
    with pytest.warns(RuntimeWarning, match="is damaged .* it is compiled again"):
        assert _made(_doubled)(2.0) == 4.0
    assert _made(_doubled)(3.0) == 6.0  # from the cache, without a warning


def test_processes_that_find_the_same_damaged_code_all_go_on(tmp_path: Path) -> None:
    (tmp_path / "doubled.py").write_text(_DOUBLED, encoding="utf-8")
    variables = {**os.environ, "LINKWORK_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, str(tmp_path / "doubled.py")]
    subprocess.run(command, env=variables, check=True, timeout=100)
    for path in (tmp_path / "cache").rglob("*.nbi"):
        path.write_bytes(b"junk")
    processes = [subprocess.Popen(command, env=variables, stdout=subprocess.PIPE) for _ in range(4)]
    assert [process.communicate(timeout=100)[0] for process in processes] == [b"4.0\n"] * 4


_DOUBLED = """
from numba import float64
from analysis.numerics.codegen import Kernel
def doubled(x): return 2 * x
print(Kernel(doubled, (float64(float64),), "a test")(2.0))
"""


def test_machine_code_of_functions_is_kept_and_checked(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []

    def noted(self: Any, *arguments: Any) -> None:
        written.append("")
        original(self, *arguments)

    original = codegen.Writer.__init__
    monkeypatch.setattr(codegen.Writer, "__init__", noted)

    def value(factor: float) -> float:
        code = MachineCode([function_of(lambda t, a, *_: factor * a[0])])
        return float(value_at(code.addresses["f"], 0.0, np.array([0.5, 0.0])))

    assert (value(3.0), value(3.0), len(written)) == (1.5, 1.5, 1)
    assert (value(4.0), len(written)) == (2.0, 2)
    for path in (cache / "llvm").iterdir():
        path.write_bytes(flipped(path.read_bytes(), 0.5))
    assert (value(3.0), value(4.0), value(3.0), len(written)) == (1.5, 2.0, 1.5, 4)


@pytest.mark.usefixtures("cache")
def test_what_cannot_be_compiled_is_an_error_all_the_same() -> None:
    with pytest.raises(Exception, match=r"Cannot unify|No implementation"):
        _ = _made(_mistyped).compiled


def _mistyped(x):
    return x + "x"


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
@pytest.mark.parametrize(
    ("place", "mode", "trusted"),
    [
        ("above", 0o700, True),
        ("above", 0o755, True),
        ("above", 0o777, False),
        ("above", 0o1777, True),  # as /tmp: what is in it belongs to who made it
        ("root", 0o777, False),
        ("root", 0o1777, True),
        ("root", 0o773, False),
        ("folder", 0o777, False),
        ("folder", 0o1777, False),
        ("folder", 0o702, False),
    ],
)
def test_code_is_kept_only_where_nobody_else_can_write(cache, monkeypatch, capsys, place, mode, trusted) -> None:
    root = cache / "root"
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(root))
    folder = code_folder("kept")
    assert folder == root / "kept"
    {"above": root.parent, "root": root, "folder": folder}[place].chmod(mode)
    _warn_shared.cache_clear()
    again, more = code_folder("kept"), code_folder("kept")
    assert (again == folder) == trusted
    assert again == more
    said = capsys.readouterr().err
    assert said.count(f"linkwork: others can write to {root}") == (not trusted)


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root gives files away")
@pytest.mark.parametrize("what", ["folder", "file", "above"])
def test_code_of_another_user_is_not_loaded(cache: Path, monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    root = cache / "root"
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(root))
    folder = code_folder("kept")
    (folder / "planted.nbi").touch()
    assert code_folder("kept") == folder
    os.chown({"folder": folder, "file": folder / "planted.nbi", "above": root.parent}[what], 12345, 0)
    assert code_folder("kept") != folder


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
def test_temporary_folder_that_others_can_write_to_is_not_trusted(cache: Path) -> None:
    cache.touch()
    shared = code_folder("b").parent
    assert not stat.S_IMODE(shared.stat().st_mode) & 0o022
    shared.chmod(0o777)
    other = code_folder("b")
    assert other.is_dir()
    assert not other.is_relative_to(shared)


@pytest.mark.usefixtures("cache")
def test_on_a_full_disk_code_is_compiled_and_not_kept(monkeypatch: Any, capsys: Any) -> None:
    plain = Kernel._compile

    def full(self: Kernel, folder: Path | None) -> Any:
        if folder is not None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return plain(self, folder)

    monkeypatch.setattr(Kernel, "_compile", full)
    assert kernel(float64(float64), purpose="a test")(_doubled)(2.0) == 4.0
    assert "No space left on device: compiled code is not kept" in capsys.readouterr().err


def test_a_folder_on_a_full_disk_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(io.BytesIO):
        def write(self, content: Any) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    made = tempfile.TemporaryFile
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "full"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda dir: Full() if "full" in Path(dir).parts else made(dir=dir))
    assert "full" not in code_folder("kept").relative_to(tmp_path).parts


def _doubled(x):
    return 2.0 * x
