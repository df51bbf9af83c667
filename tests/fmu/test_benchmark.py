"""The benchmark of the FMUs runs."""

from pathlib import Path

import pytest

import benchmarks.fmu

from .runner import run_in_process


def short_benchmark(root: str) -> str:
    """The benchmark's output with a few steps of each."""
    import contextlib
    import io
    import sys

    sys.path.insert(0, root)
    import benchmarks.fmu

    benchmarks.fmu.STEPS, benchmarks.fmu.REPEATS = 5, 1
    with contextlib.redirect_stdout(io.StringIO()) as output:
        benchmarks.fmu.main()
    return output.getvalue()


@pytest.mark.slow
def test_benchmark() -> None:
    root = Path(benchmarks.fmu.__file__).resolve().parents[1]
    output = run_in_process(short_benchmark, root, options=(), timeout=300.0)
    for what in ("through FMPy", "native FMU, FMI 3.0", "bare right-hand sides", "times less than the Python FMU"):
        assert what in output
