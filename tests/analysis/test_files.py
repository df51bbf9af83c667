"""Quantities with units, the reader of tables, CSV files and arrays."""

import csv
import doctest
import os
import re
import signal
import threading
import time
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis import files
from analysis.files import Many, Quantity, Table, entry, load_array, read, read_record, tables, text, write_csv
from analysis.units import quantity, with_unit
from linkwork.errors import InputError, Interrupted, MissingParameterError, ParameterError, UnknownNameError


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("15.35 cm", "m", 0.1535),
        ("420 rpm", "rad/s", 14 * pi),
        ("1e6 dyn/cm", "N/m", 1000.0),
        ("3e4 dyn*s/cm", "N.s/m", 30.0),
        ("30 deg", "rad", pi / 6),
        ("981 cm/s^2", "m/s2", 9.81),
        ("1e8 dyn*cm", "N.m", 10.0),
        ("0.01", "1", 0.01),
        ("3 kg.m2", "kg.m2", 3.0),
        ("9.81 m/s2", "m/s2", 9.81),
        ("5mm", "m", 5e-3),
        (".5 m s-1", "m/s", 0.5),
        ("2 N / (m)", "N/m", 2.0),
        ("30°", "rad", pi / 6),
        ("1 µm", "m", 1e-6),
        ("200 U/min", "rad/s", 20.0 * pi / 3.0),
        ("200 1/min", "rad/s", 20.0 * pi / 3.0),
        ("200 r/min", "rad/s", 20.0 * pi / 3.0),
        ("200 min-1", "rad/s", 20.0 * pi / 3.0),
        ("20 Nmm", "N.m", 0.02),
        ("3 Nms/rad", "N.m.s/rad", 3.0),
        ("3 Ns/mm", "N.s/m", 3000.0),
        ("3 kgm2", "kg.m2", 3.0),
        ("3 kgcm²", "kg.m2", 3e-4),
        (0.25, "m", 0.25),
        (3, "1", 3.0),
        (np.float32(0.25), "m", 0.25),
    ],
)
def test_quantities_in_their_units(text, unit, value):
    assert quantity(text, unit, "x") == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("15 kg", "m"),
        ("abc", "m"),
        ("", "m"),
        ([1.0], "m"),
        (True, "m"),
        ("1 furlongg", "m"),
        (None, "m"),
        ("inf m", "m"),
        ("0N0", "N"),
    ],
)
def test_a_quantity_of_another_kind_is_refused_by_name(text, unit):
    with pytest.raises(ParameterError, match=r"crank\.length"):
        quantity(text, unit, "crank.length")


@pytest.mark.parametrize(
    ("text", "unit", "right"), [("2 Kg", "kg", "kg"), ("9 rots", "rad/s", "rpm"), ("2 g", "m", "mm")]
)
def test_a_wrong_unit_is_answered_with_right_ones(text, unit, right):
    with pytest.raises(ParameterError, match=rf"such as .*\b{right}\b"):
        quantity(text, unit, "x")


@pytest.mark.parametrize(
    "text",
    [
        "1,5 mm", "1 000 mm", "1'000 mm", "1 500 mm", "1.5.2 mm", "1 m; 2", "1 m 2", "9**9**9 m", "10**100000000 m",
        "1 m**9**9**9", "1 m**99", "7" * 5000, "7" * 5000 + " m", "(" * 5000, "-" * 50_000 + "1 m", "1_0 m", "nan m",
        "inf m", "0x10 m", "1e99999 m", "1 (m)", "2*3 m", "m", "", "1 + 1 m", "1 m" + "*m" * 200, "1 m.",
        "\ufeff1 m", "1 m\n2", "\u0661 m",
    ],
)  # fmt: skip
def test_what_is_no_number_and_unit_is_refused(text):
    with pytest.raises(ParameterError, match="parameter x is") as caught:
        quantity(text, "m", "x")
    assert len(str(caught.value)) < 500


@given(st.text(alphabet="0123456789.,'eE+-*/^() \tmsNradgk%°_;", max_size=24))
def test_no_rubbish_is_read_as_a_quantity(text):
    """What is read starts with a number as Python reads it, and what follows has no number but exponents of one digit."""
    try:
        value = quantity(text, "m", "x")
    except ParameterError:
        return
    number = re.match(r"\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?", text)
    rest = text[number.end() :]
    assert re.fullmatch(r"[^\d]*(?:[^\W\d_°]\s*(?:\*\*|\^)?\s*-?\d[^\d]*)*", rest)
    assert value == pytest.approx(float(number[0]) * quantity("1" + rest, "m", "x"), rel=1e-12)


def test_hertz_is_refused_for_a_speed_because_it_is_ambiguous():
    with pytest.raises(ParameterError, match="2 pi"):
        quantity("7 Hz", "rad/s", "drive.speed")


def test_a_number_without_a_unit_may_be_in_one():
    assert quantity(20, "m", "x", bare="mm") == 0.02
    assert quantity("2 cm", "m", "x", bare="mm") == 0.02
    assert quantity(with_unit(0.1 + 0.2, "N.s/m"), "N.s/m", "x") == 0.1 + 0.2


# The reader


@dataclass(frozen=True, slots=True, kw_only=True)
class Pin:
    at: tuple[float, float] = entry(Many(Quantity("m", bare="mm"), length=2))
    fixed: bool = entry(files.flag, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    length: float = entry(Quantity("m", above=0.0))
    play: float = entry(Quantity("m", least=0.0), 0.0)
    begin: float = entry(Quantity("rad", least=-1.0, below=7.0), 0.0, key="from")
    holes: int = entry(files.Whole(1), 2)
    material: str = entry(files.Choice(("steel", "brass")), "steel")
    tilt: tuple[float, float] = entry(files.Range(Quantity("rad")), (0.0, 0.0))
    pins: tuple[Pin, ...] = entry(Many(Table(Pin), least=1, single=True), ())
    end: Any = entry(files.Kinds({"round": Table(dict, {"radius": Quantity("m")}), "flat": Table(dict)}), None)
    name: str = entry(text, "")


def test_a_table_becomes_a_dataclass():
    table = {
        "length": "2 cm",
        "from": "180 deg",
        "material": "brass",
        "tilt": 0.5,
        "pins": {"at": [1, "2 m"]},
        "end": {"kind": "round", "radius": 1},
        "name": 7,
    }
    end = {"radius": 1.0}
    pins = (Pin(at=(0.001, 2.0)),)
    made = Bar(length=0.02, begin=pi, material="brass", tilt=(0.5, 0.5), pins=pins, end=end, name="7")
    assert read(Bar, table, "bar") == made
    assert read(Bar, {"holes": 3}, "bar", base=made).holes == 3
    assert files.entry_names(Bar)[:3] == ("length", "play", "from")


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        (3, ParameterError, "bar is 3: it must be a table"),
        ({"lenght": 1}, UnknownNameError, r"no bar\.lenght; did you mean bar\.length\?"),
        ({"length": 0}, ParameterError, r"bar\.length is 0: it must be greater than zero"),
        ({"play": -1}, ParameterError, r"bar\.play is -1: it must be zero or greater"),
        ({"length": None}, ParameterError, "have a value, or be left out"),
        ({"from": 8}, ParameterError, "be -1 rad or greater and less than 7 rad"),
        ({"holes": 1.5}, ParameterError, "be a whole number"),
        ({"holes": 0}, ParameterError, "be at least 1"),
        ({"holes": 10**300}, ParameterError, "be at most 2147483647"),
        ({"material": "stele"}, UnknownNameError, r"no bar\.material 'stele'; did you mean steel"),
        ({"material": 3}, ParameterError, "be one of steel, brass"),
        ({"tilt": [1, 2, 3]}, ParameterError, "one value, or two"),
        ({"tilt": [2, 1]}, ParameterError, "be in order"),
        ({"pins": []}, ParameterError, "have at least 1"),
        ({"pins": [{"at": 3}]}, ParameterError, r"bar\.pins\[0\]\.at is 3: it must be a list of 2"),
        ({"pins": {}}, MissingParameterError, r"bar\.pins\.at is missing"),
        ({"pins": {"at": [0, 0], "fixed": "yes"}}, ParameterError, "be true or false"),
        ({"end": {}}, MissingParameterError, r"bar\.end\.kind is missing"),
        ({"end": {"kind": "flat", "radius": 1}}, UnknownNameError, r"bar\.end\.radius"),
        ({"name": []}, ParameterError, "be a text"),
    ],
)
def test_what_a_table_may_not_hold_is_refused_by_name(change, error, said):
    table = {"length": 1} | change if isinstance(change, dict) else change
    with pytest.raises(error, match=said):
        read(Bar, table, "bar")


def test_the_example_of_the_reader():
    assert doctest.testmod(files.reader).failed == 0


def test_values_are_replaced_at_any_depth():
    data = {"drive": {"speed": 1, "torque": {"kind": "ramp", "end": 2}}, "force": 3}
    kept = {"drive": {"speed": 1, "torque": {"kind": "ramp", "end": 4}}, "force": 3}
    assert files.override(data, {"drive.torque.end": 4}) == kept
    with pytest.raises(ParameterError, match="force is 3: it must be a table"):
        files.override(data, {"force.x": 4})


# Tables of numbers


@pytest.mark.parametrize("harm", ["flipped", "cut", "longer", "junk", "empty", "of another library"])
def test_a_damaged_array_is_not_there(tmp_path, harm):
    path = files.save_array(tmp_path / "x.npy", [[1.0, 2.0]])
    content = path.read_bytes()
    flipped = bytearray(content)
    flipped[-40] ^= 1  # in a number
    if harm == "of another library":
        np.save(path, np.array([1.0, 2.0]))
    else:
        harms = {"flipped": flipped, "cut": content[:-9], "longer": content + b" ", "junk": b"x" * 50, "empty": b""}
        path.write_bytes(harms[harm])
    with pytest.warns(RuntimeWarning, match=r"x\.npy is damaged: what was in it is computed again"):
        assert load_array(path) is None


@pytest.fixture
def ctrl_c():
    """Python's own answer to Ctrl-C, also where the tests run in the background of a shell that ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_large_csv_is_announced_and_ctrl_c_stops_it_within_a_second(tmp_path, capsys, ctrl_c):
    column = np.sin(np.arange(1_000_000))
    size = write_csv(tmp_path / "x.csv", {"x": column[::1000]}).stat().st_size * 28_000
    (tmp_path / "x.csv").unlink()
    began = []

    def interrupt():
        began.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.5, interrupt)
    timer.start()
    with pytest.raises(Interrupted, match=r"interrupted: .*x\.csv was not written"):
        write_csv(tmp_path / "x.csv", {f"{k}": column for k in range(28)})
    assert time.perf_counter() - began[0] < 5.0
    assert not list(tmp_path.iterdir())
    said = re.search(r"linkwork: writing .*x\.csv, about (\d+) MB; Ctrl-C stops it", capsys.readouterr().err)
    assert said
    assert int(said[1]) == pytest.approx(size / 1e6, rel=0.02)


def test_a_file_that_was_there_stays_where_writing_is_interrupted(tmp_path, monkeypatch):
    def interrupted(*words):
        raise KeyboardInterrupt

    write_csv(tmp_path / "x.csv", {"a": [1.0]})
    monkeypatch.setattr(tables, "_BLOCK", 0)
    monkeypatch.setattr(tables, "LARGE", 1)
    monkeypatch.setattr(tables, "_progress_bar", interrupted)
    with pytest.raises(Interrupted):
        write_csv(tmp_path / "x.csv", {"a": [1.0, 2.0]})
    assert (tmp_path / "x.csv").read_text() == "a\n1\n"
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]


@pytest.mark.parametrize("text", ["", "t\n", "t,x\n", "t,x\n\n# 1,2\n"])
def test_an_empty_csv_is_refused_in_a_sentence(tmp_path, text):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(InputError, match=r"x\.csv has no numbers: it must have rows of numbers"):
        read_record(tmp_path / "x.csv", ("t",))


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("crank.angle [rad]", "crank.angle [rad]"),
        ("=1+1", "'=1+1"),
        ("+1+1", "'+1+1"),
        ("-1+1", "'-1+1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1+1", '"\'\t=1+1"'),
        ("\r=1+1", "' =1+1"),
        ("\n =1+1", "'  =1+1"),
        ("=", "'="),
        ("-1.5e3", "-1.5e3"),
        ("+2", "+2"),
        (" -2", " -2"),
        ("a=1-b", "a=1-b"),
        ("fx, fy", '"fx, fy"'),
        ("x;=1+1", '"x;=1+1"'),
        ("x\t=1+1", '"x\t=1+1"'),
        ('the "best"', '"the ""best"""'),
        ('=HYPERLINK("x","y")', '"\'=HYPERLINK(""x"",""y"")"'),
        ("two\nlines\rof\r\ntext", "two lines of text"),
    ],
)
def test_a_cell_is_harmless_in_a_spreadsheet(text, written):
    assert tables.cell(text) == written


@given(st.text())
def test_no_text_becomes_a_formula_or_more_than_a_cell(content):
    rows = list(csv.reader([tables.cell(content), tables.cell("=" + content)]))
    for (cell,) in [row or [""] for row in rows]:
        assert not cell.lstrip().startswith(tuple("=+-@")) or float(cell) is not None
    assert rows[1][0].startswith("'=")


def test_blocks_make_the_same_file_as_one(tmp_path, monkeypatch):
    columns = {"a": np.arange(10) / 3.0, "b": [np.nan, np.inf, -np.inf, *range(7)]}
    whole = write_csv(tmp_path / "x.csv", columns).read_bytes()
    monkeypatch.setattr(tables, "_BLOCK", 7)
    assert write_csv(tmp_path / "y.csv", columns).read_bytes() == whole
    table = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "z.csv", table, delimiter=",", header="a,b", comments="", fmt="%.17g")
    assert (tmp_path / "z.csv").read_bytes() == whole


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_columns_are_between_what_the_first_line_has(tmp_path, mark):
    (tmp_path / "x.csv").write_text(f't{mark}u [m]{mark}note\n0{mark}1{mark}a\n2{mark}3{mark}"b;c,d\te"\n')
    assert np.column_stack(read_record(tmp_path / "x.csv", ["u", None])[1]).tolist() == [[1.0, 1.0], [3.0, 3.0]]
    assert read_record(tmp_path / "x.csv", ["t"])[1][0].tolist() == [0.0, 2.0]


def test_csv_columns_of_different_length_are_refused(tmp_path):
    with pytest.raises(InputError, match="differ in length"):
        write_csv(tmp_path / "x.csv", {"a": [1.0], "b": [1.0, 2.0]})


def test_csv_and_arrays_are_read_back(tmp_path):
    path = write_csv(tmp_path / "x.csv", {"a [m]": [0.1, 2.0], "fx, fy": [1.0, 1 / 3]})
    assert np.column_stack(read_record(path, (None, None))[1]).tolist() == [[0.1, 1.0], [2.0, 1 / 3]]
    assert float(files.read_rows(path)[1]["fx, fy"]) == 1 / 3
    assert np.array_equal(load_array(files.save_array(tmp_path / "deep" / "x.npy", [[1.0, 2.0]])), [[1.0, 2.0]])
    assert load_array(tmp_path / "none.npy") is load_array(tmp_path) is None
    with pytest.raises(InputError, match="cannot be read"):
        files.read_rows(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("text", "units", "columns"),
    [
        ("t [ms],x [mm] # rig 2\n0,1\n2,3\n", ["ms", "mm"], [[0.0, 2.0], [1.0, 3.0]]),
        ("# t [ms], x [mm]\n0;1,5\n2;3\n", ["ms", "mm"], [[0.0, 2.0], [1.5, 3.0]]),
        ("0,1 # slow, then fast; hot\n2,3\n", ["", ""], [[0.0, 2.0], [1.0, 3.0]]),
        ("t;x\n0;1 # slow; hot\n2;3\n", ["", ""], [[0.0, 2.0], [1.0, 3.0]]),
        ("drive #1 [s];torque\n0;1\n", ["s", ""], [[0.0], [1.0]]),
        ("t[0],x[1]\n0,1\n", ["", ""], [[0.0], [1.0]]),
        ("t,x,\r\n0,1,\r\n2,3,\r\n,,\r\n", ["", ""], [[0.0, 2.0], [1.0, 3.0]]),
        (";\n0;1\n2;3;late\n", ["", ""], [[0.0, 2.0], [1.0, 3.0]]),
        ("t,x\nms,mm\n0,1\n2,3\n", ["ms", "mm"], [[0.0, 2.0], [1.0, 3.0]]),
        ("\ufeff t ; x ;\n [ms] ; (mm) ;\n\n 0 ; 1,5 ;\n 2 ; 3 ;\n", ["ms", "mm"], [[0.0, 2.0], [1.5, 3.0]]),
        ("t [ms],x\n-,mm\n0,1\n2,3\n", ["ms", "mm"], [[0.0, 2.0], [1.0, 3.0]]),
        ("sep=;\nt [s];x\n0,5;1\n2;3\n", ["s", ""], [[0.5, 2.0], [1.0, 3.0]]),
        ('"SEP=,"\n"t","x"\n"ms","mm"\n0,1\n2,3\n', ["ms", "mm"], [[0.0, 2.0], [1.0, 3.0]]),
    ],
)
def test_columns_of_tables_as_people_write_them(tmp_path, text, units, columns):
    (tmp_path / "x.csv").write_text(text, newline="", encoding="utf-8")
    found, numbers = read_record(tmp_path / "x.csv")
    assert found == units
    assert [column.tolist() for column in numbers] == columns


def test_blanks_around_the_name_of_a_column_do_not_count(tmp_path):
    (tmp_path / "x.csv").write_text(" t , x [mm] \n0,1\n2,3\n")
    assert read_record(tmp_path / "x.csv", (" t", "x "))[0] == ["", "mm"]


@pytest.mark.parametrize(
    ("text", "names", "said"),
    [
        ("0,0\n0,5,1,5\n", None, "line 2: 4 cells in a table of 2 columns; numbers with a decimal comma need"),
        ("t,x\n0,0\n0,5,1\n", ("t", "x"), "line 3: 3 cells in a table of 2 columns"),
        ("0,1\n2,3\n", ("t", "x"), "has no headings, and so no column 't'"),
        ("t [s],x [mm]\ns,cm\n0,1\n", None, "line 2: the unit 'cm' is below a heading with the unit 'mm'"),
        ("t,x\nnan,nan\n0,1\n", None, "line 2, column 1: 'nan' is not a finite number"),
        ("t,x\n0,1\n0.1,high\n", ("t", "x"), "line 3, column 2: 'high' is not a finite number"),
        ("t,x\n0,1\n0.1\n", ("t", "x"), "line 3, column 2: '' is not a finite number"),
        ("t\n0\n1\n", (None, None), "line 2, column 2: '' is not a finite number"),
        ("t x\n0 1\n2 3\n", None, "line 2, column 1: '0 1' .*; between the cells there must be commas"),
        ("0 1\n2 3\n", None, "line 1, column 1: '0 1' is not"),
        ("1 000;2\n3;4\n", None, "line 1, column 1: '1 000' is not"),
        ("\u22121,2\n3,4\n", None, "line 1, column 1: '\u22121' is not"),
        ("Device 5\nt,x\n0,1\n2,3\n", None, "what is above the headings a # at its beginning"),
        (f'# "{"1" * 200_000}",x\n0,1\n', None, "cannot be read: field larger"),
    ],
)
def test_columns_that_are_none(tmp_path, text, names, said):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_record(tmp_path / "x.csv", names)


@pytest.mark.parametrize("head", ["", "t,x # seconds\n", "# t,x\n"])
def test_columns_need_no_header_line_and_may_have_comments(tmp_path, head):
    (tmp_path / "x.csv").write_text(f"{head}0,1 # start\n\n# later\n2,3\n")
    assert np.column_stack(read_record(tmp_path / "x.csv", (None, None))[1]).tolist() == [[0.0, 1.0], [2.0, 3.0]]


def test_a_cell_of_any_length_is_a_sentence(tmp_path):
    for quote, said in (("", r"line 2, column 1: '1{40}' is not"), ('"', "cannot be read: field larger")):
        (tmp_path / "x.csv").write_text(f"t\n{quote}{'1' * 200_000}{quote}\n")
        with pytest.raises(InputError, match=rf"x\.csv,? {said}"):
            read_record(tmp_path / "x.csv", ("t",))


def test_an_unknown_name_of_any_length_is_cut_in_the_message() -> None:
    assert len(str(files.unknown_name("9" * 20_000, ["size"], f"trade_off.over {'9' * 20_000!r}"))) < 1_000
