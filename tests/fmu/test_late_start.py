"""FMUs of every kind whose run begins at 1e9 s: that from zero, as well as times are resolved there."""

from pathlib import Path
from typing import Any

import pytest

from analysis.mechanisms import MECHANISMS
from benchmarks.long_runs import FREE

from .runner import run_in_process

ROOT = Path(__file__).parents[2]


def late_runs(root: str, files: list[str], mechanism: str, step: float) -> list[Any]:
    """Differences of the crank's angle and the slider's position that a late start makes; of native FMUs both interfaces."""
    import sys

    sys.path.insert(0, root)
    from benchmarks.long_runs import compare_late_fmu

    found = [compare_late_fmu(file, mechanism, step) for file in files]
    return found + [compare_late_fmu(file, mechanism, step, "model-exchange") for file in files[1:]]


@pytest.mark.parametrize("mechanism", FREE)
@pytest.mark.parametrize("step", [2.0**-10, 1e-3])
def test_a_run_at_a_late_time_is_the_run_at_zero(
    fmus: dict[str, Path], natives: dict[str, Path], mechanism: str, step: float
) -> None:
    name = MECHANISMS[mechanism].fmu
    files = [fmus[name], *(natives[f"{name}-{kind}"] for kind in ("native", "native-fmi3"))]
    found = run_in_process(late_runs, ROOT, [str(file) for file in files], mechanism, step)
    assert len(found) == 5
    # times of whole 1/1024 s are exact; of others each end is rounded by half of 1.2e-7 s
    late = 0.0 if step == 2.0**-10 else 1.2e-7
    for angle, position in found:
        assert angle <= late * 1.2 * FREE[mechanism][2]
        assert position <= late * 2.0
        # the plant sees the late times
        assert (angle > 0.0) is (late > 0.0)
