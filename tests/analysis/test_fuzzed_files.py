"""Every reader with rubbish: it returns something or raises one sentence, soon, and never another exception."""

import copy
import json
import time
import tomllib
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.files import check_fmu, load_array, read_points, read_record, read_rows, read_tables, save_array
from analysis.run import load_case, load_parameters
from analysis.slider.cases import linkage_from_csv, load_slider_case
from analysis.synthesis import load_synthesis_case
from linkwork.errors import LinkworkError

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
#: Seconds in which a reader answers, on a busy machine; the files here are small.
SOON = 20.0
RUBBISH = (
    *("", "0", "-", "nan", "inf", "1e999", "9**9**9", "9" * 5000, "[" * 3000, "-" * 3000, "{", "<use", "$x^", "[bold]"),
    *(
        "1 m",
        "1,5 mm",
        "=1+1",
        ":smile:",
        "\x00",
        "\x1b[2J",
        "\ufeff",
        "\ud7ff",
        "''",
        '"',
        "#",
        "\n",
        ";",
        "..",
        "a.b.c",
    ),
)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.sampled_from([0, -1, 1e-320, 1e300, -1e308, 10**400, 2**63, float("nan"), float("inf"), [], {}, [[[]]]]),
    st.sampled_from(RUBBISH),
    st.recursive(
        st.one_of(st.integers(), st.floats(), st.text(max_size=8)),
        lambda inner: st.one_of(
            st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(("kind", "file", "x")), inner)
        ),
        max_leaves=6,
    ),
)


def answer(read: Callable[[], Any]) -> None:
    """Whatever a reader is given: a result or one of our errors, of bounded length, in time."""
    began, sentence = time.perf_counter(), "it could be read"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            read()
    except LinkworkError as error:
        sentence = str(error)
    assert 10 < len(sentence) < 10_000
    assert time.perf_counter() - began < SOON


def bounded(examples: int) -> Any:
    """Some examples each time, whatever they take."""
    unchecked = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
    return settings(max_examples=examples, suppress_health_check=unchecked)


READERS: dict[str, Callable[[Path], Any]] = {
    "x.csv": partial(read_record, names=(None, None)),
    "rows.csv": read_rows,
    "curve.csv": read_points,
    "curve.svg": read_points,
    "linkage.csv": linkage_from_csv,
    "x.csv.gz": partial(read_record, names=(None, None)),
    "x.toml": read_tables,
    "x.json": read_tables,
    "run.toml": load_case,
    "run.json": load_case,
    "parameters.toml": load_parameters,
    "synthesis.toml": load_synthesis_case,
    "slider.toml": load_slider_case,
    "x.row": load_array,
    "x.fmu": check_fmu,
}


def good(name: str, folder: Path) -> bytes:
    """A file as it should be."""
    kinds = {"curve.svg": "hand-drawn.svg", "run.toml": "run-up.toml", "synthesis.toml": "ellipse.toml"}
    kinds |= {"x.toml": "torsion-bar.toml", "slider.toml": "slider-motion.toml", "parameters.toml": "slider-crank.toml"}
    if name in kinds:
        return (EXAMPLES / kinds[name]).read_bytes()
    if name.endswith(".json"):
        return json.dumps(tomllib.loads((EXAMPLES / "torsion-bar.toml").read_text(encoding="utf-8"))).encode()
    if name == "x.row":
        return save_array(folder / "good.row", [[1.0, 2.0]]).read_bytes()
    if name == "x.fmu":
        with zipfile.ZipFile(folder / "good.fmu", "w") as archive:
            archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
        return (folder / "good.fmu").read_bytes()
    return (b"x [mm],y [mm]" if name == "curve.csv" else b"time [s],value [m]") + b"\n0,1\n1,2.5\n2,3\n"


@pytest.mark.parametrize("name", READERS)
@bounded(40)
@given(data=st.data())
def test_bytes_changed_cut_and_put_in_between(tmp_path, name, data):
    content = bytearray(good(name, tmp_path))
    edit = st.tuples(st.integers(0, len(content)), st.integers(0, 60), st.sampled_from(RUBBISH))
    edits = data.draw(st.lists(edit, max_size=4))
    for at, cut, put in edits:
        content[at : at + cut] = put.encode()
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content)))]
    path = tmp_path / name
    path.write_bytes(content)
    answer(lambda: READERS[name](path))


@pytest.mark.parametrize("name", READERS)
@bounded(25)
@given(content=st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_anything_at_all(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    answer(lambda: READERS[name](path))


def places(table: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The ways to all entries of nested tables and lists."""
    entries = table.items() if isinstance(table, Mapping) else enumerate(table) if isinstance(table, list) else ()
    for key, value in entries:
        yield (*way, key)
        yield from places(value, (*way, key))


CASES = [
    (path.name, load)
    for path in sorted(EXAMPLES.glob("*.toml"))
    for load in (load_case, load_synthesis_case, load_slider_case, load_parameters)
]


@pytest.mark.parametrize(("name", "load"), CASES, ids=[f"{name}-{load.__name__}" for name, load in CASES])
@bounded(15)
@given(data=st.data())
def test_entries_of_other_types_and_sizes(tmp_path, name, load, data):
    tables = tomllib.loads((EXAMPLES / name).read_text(encoding="utf-8"))
    for way in data.draw(st.lists(st.sampled_from(list(places(tables))), min_size=1, max_size=3)):
        table = tables
        try:
            for key in way[:-1]:
                table = table[key]
            table[way[-1]] = copy.deepcopy(data.draw(VALUES))
        except (KeyError, IndexError, TypeError):
            continue  # of a place that an earlier change took away
    path = tmp_path / "x.json"
    path.write_text(json.dumps(tables), encoding="utf-8")
    for drawn in EXAMPLES.glob("*.svg"):
        (tmp_path / drawn.name).write_bytes(drawn.read_bytes())
    answer(lambda: load(path))


def test_the_fuzz_reads_what_is_right(tmp_path):
    for name, reader in READERS.items():
        (tmp_path / name).write_bytes(good(name, tmp_path))
        if name not in ("linkage.csv", "x.csv.gz", "parameters.toml"):
            reader(tmp_path / name)
