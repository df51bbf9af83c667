"""An FMU that does not run does not count as built."""

import zipfile
from pathlib import Path

import pytest

from analysis.export import BuildError, run_trial


def test_what_does_not_run_is_no_build(natives: dict[str, Path], tmp_path: Path) -> None:
    good = natives["FiveBarSlider-native"]
    run_trial(good)
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(good) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            target.writestr(name, b"no library" if name.endswith((".so", ".dll", ".dylib")) else source.read(name))
    with pytest.raises(BuildError, match=r"broken\.fmu was built but does not run as it should:\n(.|\n)*Error"):
        run_trial(broken)
