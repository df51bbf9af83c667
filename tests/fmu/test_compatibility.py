"""What is published with an FMU, in the form that fmi-standard.org asks for."""

import csv
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from zipfile import ZipFile

import pytest

from analysis.export import KINDS, BuildError, publish
from build_fmu import FMUS

from .described import read_scalars
from .models import Model


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    """Each kind of FMU."""
    return str(request.param)


@pytest.fixture
def built(fmus: dict[str, Path], natives: dict[str, Path], model: Model, kind: str) -> Path:
    """The FMU of a model and kind."""
    return fmus[model.name] if kind == "python" else natives[f"{model.name}-{kind}"]


def read(path: Path) -> tuple[list[str], list[list[float]]]:
    text = path.read_text(encoding="utf-8")
    head = text.splitlines()[0]
    assert head == ",".join(f'"{name.strip(chr(34))}"' for name in head.split(",")), "names are quoted"
    assert len(text) < 1_000_000
    names, *rows = csv.reader(text.splitlines())
    assert names[0] == "time"
    numbers = [[float(cell) for cell in row] for row in rows]
    assert all(a[0] < b[0] for a, b in pairwise(numbers))
    return names, numbers


def test_published_files(built: Path, model: Model, kind: str, tmp_path: Path) -> None:
    place = publish(FMUS[model.name], KINDS[kind], built, tmp_path)
    name = built.stem
    assert {path.name for path in place.iterdir()} == {
        f"{name}.fmu", f"{name}_in.csv", f"{name}_ref.csv", f"{name}_ref.opt", "Readme.txt",
    }  # fmt: skip
    assert place == tmp_path / name
    with ZipFile(place / f"{name}.fmu") as archive:
        scalars = {s.name: s for s in read_scalars(archive.read("modelDescription.xml"))}
    options = dict(line.split(", ") for line in (place / f"{name}_ref.opt").read_text().splitlines())
    assert set(options) >= {"StartTime", "StopTime", "StepSize", "RelTol"}
    start, stop = float(options["StartTime"]), float(options["StopTime"])
    assert (start, stop) == FMUS[model.name].experiment[:2]

    names, rows = read(place / f"{name}_in.csv")
    inputs = [s.name for s in scalars.values() if s.attributes.get("causality") == "input"]
    assert names[1:] == inputs
    assert [row[0] for row in rows] == [start, stop]
    assert rows[0][1:] == rows[1][1:] == [float(scalars[n].attributes["start"]) for n in inputs]

    names, rows = read(place / f"{name}_ref.csv")
    assert len(names) <= 10
    assert {scalars[n].attributes["causality"] for n in names[1:]} == {"output"}
    assert (rows[0][0], rows[-1][0]) == (start, pytest.approx(stop, abs=1e-12))
    assert rows[0][1:] == pytest.approx([float(scalars[n].attributes["start"]) for n in names[1:]], rel=1e-9, abs=1e-12)

    text = (place / "Readme.txt").read_text()
    assert "FMPy 0." in text
    assert ("adjoint" in text) is (kind == "native-fmi3")
    assert ("model exchange" in text.splitlines()[2]) is (kind != "python")


def test_fmpy_has_to_come_to_the_same(natives: dict[str, Path], tmp_path: Path) -> None:
    # the reference of another experiment: what is published with an FMU that does something else is refused
    mechanism = FMUS["FiveBarSlider"]
    variables = tuple(v._replace(start=v.start * 1.001) if v.name == "drive.speed" else v for v in mechanism.variables)
    other = replace(mechanism, variables=variables)
    with pytest.raises(BuildError, match="is not that of the reference"):
        publish(other, KINDS["native"], natives["FiveBarSlider-native"], tmp_path)
