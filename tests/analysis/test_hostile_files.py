"""Files that are damaged, endless or meant to harm: a sentence, and nothing left behind, lost or executed."""

import errno
import gzip
import json
import os
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from analysis import cosimulate, files, simulate
from analysis.cli.common import WRONG, print_error, say, show_table
from analysis.figures.style import Figure
from analysis.files import attribute_files, check_fmu, read_points, read_record, read_rows, read_tables, write_text
from analysis.run import CASES, CosimulationError, load_case, read_case
from linkwork.errors import InputError, ParameterError
from linkwork.five_bar.published import TABLE_3_1

from .conftest import copied

# Where files end


def read_two_columns(path):
    return [column.tolist() for column in read_record(path, (None, None))[1]]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("x.json", "[" * 100_000, "deeper than 50"),
        ("x.json", '{"a":' * 60 + "1" + "}" * 60, "deeper than 50"),
        ("x.toml", "a = " + "[" * 5000 + "]" * 5000, "deeper than 50"),
        ("x.toml", ".".join("a" * 300) + " = 1", "deeper than 50"),
        ("x.toml", "a = " + "9" * 5000, "not valid TOML"),
        ("x.json", '{"a": ' + "9" * 5000 + "}", "not valid JSON"),
        ("x.toml", f"a = {2**1024}", "a is a whole number of more than 1024 bits"),
        ("x.json", json.dumps({"a": [{"title": "x" * 20_000}]}), "title has 20000 characters: 10000 are the most"),
        ("x.json", json.dumps({"a" * 300: 1}), "has 300 characters: 200 are the most"),
        ("x.json", '{"a": "\\ud800"}', "half a character"),
    ],
    ids=range(10),
)
def test_tables_have_bounds(tmp_path, name, content, said):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=said) as error:
        read_tables(tmp_path / name)
    assert len(str(error.value)) < 1000


@pytest.mark.parametrize("kind", ["size", "unpacked size"])
def test_large_files_are_refused_until_the_limit_is_raised(tmp_path, monkeypatch, kind):
    content = b"t,x\n" + b"1,2\n" * 500_000
    path = tmp_path / ("x.csv" if kind == "size" else "x.csv.gz")
    path.write_bytes(content if kind == "size" else gzip.compress(content))
    monkeypatch.setenv("LINKWORK_MAX_FILE_MB", "1")
    with pytest.raises(InputError, match=r"more than 1 MB of text: give LINKWORK_MAX_FILE_MB a greater number"):
        read_two_columns(path)
    monkeypatch.setenv("LINKWORK_MAX_FILE_MB", "3")
    assert len(read_record(path, ("t",))[1][0]) == 500_000
    monkeypatch.setenv("LINKWORK_MAX_FILE_MB", "much")
    with pytest.raises(InputError, match="LINKWORK_MAX_FILE_MB is 'much': it must be a whole number"):
        read_two_columns(path)


@pytest.mark.skipif(os.name == "nt", reason="devices and pipes have no paths there")
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
@pytest.mark.parametrize("reader", [read_two_columns, read_rows, read_points, read_tables, check_fmu])
def test_what_may_never_end_is_not_read(tmp_path, kind, reader):
    path = tmp_path / ("x.toml" if reader is read_tables else "x.csv")
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("/dev/zero")
    with pytest.raises(InputError, match=f"is a {kind}: it must be a file"):
        reader(path)


@pytest.mark.parametrize("harm", ["cut", "flipped", "junk"])
def test_a_damaged_gz_is_a_sentence(tmp_path, harm):
    content = gzip.compress(b"t,x\n0,1\n1,2\n" + bytes(range(48, 58)) * 100)
    flipped = content[:30] + bytes([content[30] ^ 255]) + content[31:]
    path = tmp_path / "x.csv.gz"
    path.write_bytes({"cut": content[:-9], "flipped": flipped, "junk": b"no gzip"}[harm])
    with pytest.raises(InputError, match=r"x\.csv\.gz cannot be read: it is not a whole gzip file"):
        read_two_columns(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_every_text_reader_takes_a_byte_order_mark(tmp_path, encoding):
    def written(name, text):
        (tmp_path / name).write_bytes(text.encode(encoding))
        return tmp_path / name

    assert read_two_columns(written("x.csv", "t,x\n3,4\n")) == [[3.0], [4.0]]
    assert read_rows(written("x.csv", "a,b\r\n3,4\r\n")) == [{"a": "3", "b": "4"}]
    assert read_points(written("x.csv", "0,0\n3,4\n"))[0].tolist() == [[0, 0], [3, 4]]
    assert read_tables(written("x.toml", 'a = "ö"')) == read_tables(written("x.json", '{"a": "ö"}')) == {"a": "ö"}
    svg = '<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0L10 5"/></svg>'
    assert len(read_points(written("x.svg", svg))[0]) == 2


# Drawings

_USES = "".join(f'<g id="a{k + 1}">{f"""<use href="#a{k}"/>""" * 10}</g>' for k in range(9))


@pytest.mark.parametrize(
    ("attributes", "inside", "said"),
    [
        ("", '<g id="a"><use href="#a"/></g>', "a use of itself"),
        ("", '<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>', "a use of itself"),
        ("", f'<path id="a0" d="M0 0L1 1"/>{_USES}', "more than 100000 elements"),
        ("", "<g>" * 2000 + '<path d="M0 0L1 1"/>' + "</g>" * 2000, "deeper than 100"),
        ("", '<path d="M0 0A1e300 1e300 0 0 1 10 10"/>', "a curve without an extent"),
        ("", '<path d="M0 0A1e-300 1e-300 0 0 1 10 10"/>', "not valid SVG"),
        ('viewBox="0 0 nan 1" width="1mm" height="1mm"', '<path d="M0 0L1 1"/>', "viewBox|without an extent"),
        ('viewBox="0 0 1e400 1" width="1mm" height="1mm"', '<path d="M0 0L1 1"/>', "cannot be read|viewBox"),
        ('viewBox="0 0 1 1" width="0mm" height="0mm"', '<path d="M0 0L1 1"/>', "'0mm' wide or high"),
        ("", '<path transform="scale(0)" d="M0 0L1 1"/>', "without an extent"),
        ("", '<g transform="scale(nan)"><path d="M0 0L1 1"/></g>', "'nan' is neither a transformation"),
        ("", '<path transform="scale(1e308) scale(1e308)" d="M0 0L1 1"/>', "without an extent"),
        ("", '<path d="M0 0L0 0"/>', "without an extent"),
        ("", '<path d="M0 0L1e308 -1e308"/>', "beyond 1e"),
    ],
    ids=range(14),
)
def test_drawings_that_explode_or_vanish(tmp_path, attributes, inside, said):
    path = tmp_path / "x.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{inside}</svg>')
    with pytest.raises(InputError, match=said):
        read_points(path)


@pytest.mark.parametrize("transform", ["translate(1e2,-3.5e-1)rotate(30deg)", "matrix(1 0 0 1 5 5) skewX(1)", ""])
def test_transformations_of_the_standard_are_read(tmp_path, transform):
    path = tmp_path / "x.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg"><path transform="{transform}" d="M0 0L96 48"/></svg>')
    assert len(read_points(path)[0]) == 2


def test_a_use_of_a_use_is_drawn(tmp_path):
    path = tmp_path / "x.svg"
    inside = '<defs><path id="a" d="M0 0L96 48"/></defs><g id="b"><use href="#a"/></g>'
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{inside}</svg>')
    assert read_points(path)[0][-1].tolist() == pytest.approx([0.0254, -0.0127])


# Cases


def test_a_run_of_too_many_samples_is_refused(monkeypatch):
    for times in ({"stop_time": 1.0, "step": 1e-13}, {"stop_time": 1e300}, {"stop_time": 1e300, "step": 1e-13}):
        with pytest.raises(InputError, match=r"at most 20000000 are allowed, .* LINKWORK_MAX_SAMPLES"):
            simulate(TABLE_3_1, **times)
    monkeypatch.setenv("LINKWORK_MAX_SAMPLES", "10")
    with pytest.raises(InputError, match=r"has 11 samples: at most 10"):
        simulate(TABLE_3_1, stop_time=0.011)


@pytest.mark.parametrize(
    ("force", "said"),
    [
        ({"kind": "harmonics", "amplitudes": [1], "frequencies": [1], "phases": 3}, r"force\.phases is 3"),
        ({"kind": "table", "file": "a\0b"}, "cannot be read: embedded null"),
        ({"kind": "table", "times": [0, 1e-320], "values": [0, 1e308], "interpolation": "cubic"}, "force cannot"),
    ],
)
def test_signals_that_are_none(tmp_path, force, said):
    with pytest.raises(InputError if "phases" not in said else ParameterError, match=said):
        read_case({"published": "table-3.1", "force": force}, folder=tmp_path)


@pytest.mark.parametrize("value", ["-" * 50_000, "(" * 5000, int("9" * 4000), 16**5000, ["x" * 10_000]], ids=range(5))
def test_errors_do_not_repeat_megabytes(tmp_path, value):
    (tmp_path / "x.toml").write_text('published = "table-3.1"')
    with pytest.raises(ParameterError, match=r"slider\.stiffness is") as error:
        load_case(tmp_path / "x.toml", {"slider.stiffness": value})
    assert len(str(error.value)) < 1000


def test_a_whole_number_of_1024_bits_is_read(tmp_path):
    (tmp_path / "x.toml").write_text(f"a = {2**1024 - 1}")
    assert read_tables(tmp_path / "x.toml") == {"a": 2**1024 - 1}


# FMUs


def bomb(path: Path) -> Path:
    """An archive of a megabyte that unpacks to a gigabyte."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
        with archive.open("resources/zeros", "w", force_zip64=True) as member:
            for _ in range(1000):
                member.write(bytes(1_000_000))
    return path


def test_an_fmu_is_unpacked_up_to_a_limit_and_leaves_no_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "unpacked"))
    (tmp_path / "unpacked").mkdir()
    path = bomb(tmp_path / "bomb.fmu")
    monkeypatch.setenv("LINKWORK_MAX_FMU_MB", "900")
    with pytest.raises(CosimulationError, match=r"has 1000 MB unpacked, and at most 900 MB .* LINKWORK_MAX_FMU_MB"):
        cosimulate(path, TABLE_3_1, stop_time=1.0)
    monkeypatch.setenv("LINKWORK_MAX_FMU_MB", "1100")
    check_fmu(path)
    monkeypatch.setenv("LINKWORK_MAX_FMU_MEMBERS", "1")
    with pytest.raises(InputError, match=r"has 2 members, and at most 1 .* LINKWORK_MAX_FMU_MEMBERS"):
        check_fmu(path)
    assert not list((tmp_path / "unpacked").iterdir())


def test_a_description_is_a_sixteenth_of_an_fmu_at_most(tmp_path, monkeypatch):
    path = tmp_path / "wordy.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", bytes(15_500_000))
    monkeypatch.setenv("LINKWORK_MAX_FMU_MB", "256")
    check_fmu(path)
    monkeypatch.setenv("LINKWORK_MAX_FMU_MB", "240")
    with pytest.raises(InputError, match=r"has 16 MB of modelDescription\.xml, and at most 15 MB"):
        check_fmu(path)


@pytest.mark.parametrize("name", ["../x", "a/../../x", "/x", "C:x", "a\\..\\x"])
def test_members_of_an_fmu_stay_in_its_folder(tmp_path, name):
    with zipfile.ZipFile(tmp_path / "x.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
        member = zipfile.ZipInfo("x")
        member.filename = name
        archive.writestr(member, "x")
    with pytest.raises(InputError, match="would be unpacked outside of its folder"):
        check_fmu(tmp_path / "x.fmu")


@pytest.mark.fmu
def test_an_fmu_that_fails_at_the_start_leaves_no_folder(tmp_path, monkeypatch, fmu):
    (tmp_path / "unpacked").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "unpacked"))
    broken = tmp_path / "broken.fmu"
    copied(fmu, broken, lambda name, content: b"no library" if name.startswith("binaries") else content)
    case, here = CASES["speed-jump"], Path.cwd()
    with pytest.raises(CosimulationError):
        cosimulate(broken, case.parameters, case.inputs, stop_time=0.1)
    assert Path.cwd() == here
    assert not list((tmp_path / "unpacked").iterdir())


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04" + bytes(100)])
def test_what_is_no_fmu_is_a_sentence(tmp_path, linkwork, content):
    (tmp_path / "x.fmu").write_bytes(content)
    result = linkwork("info x.fmu", code=1)
    assert "x.fmu is not an FMU" in result.stderr


# A full disk


class Full:
    """Writing fails after some bytes, as on a full disk."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def write(*words: object, **options: object) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(Path, "write_bytes", write)
        monkeypatch.setattr(np, "savetxt", write)
        monkeypatch.setattr(Figure, "savefig", write)


@pytest.mark.parametrize(
    "write",
    [
        lambda path: write_text(path, "x"),
        lambda path: files.save_array(path, [1.0]),
        lambda path: files.save_figure(Figure(), path),
    ],
)
def test_a_full_disk_names_the_file_and_leaves_what_was_there(tmp_path, monkeypatch, write):
    path = tmp_path / "x.png"
    path.write_bytes(b"before")
    Full(monkeypatch)
    with pytest.raises(files.WritingError, match=r"x\.png cannot be written: No space left on device"):
        write(path)
    assert [p.name for p in tmp_path.iterdir()] == ["x.png"]
    assert path.read_bytes() == b"before"


def test_a_part_of_a_file_does_not_stay(tmp_path):
    with pytest.raises(UnicodeEncodeError), files.paths.write_completely(tmp_path / "x") as part:
        part.write_text("half \ud800", encoding="utf-8")
    assert not list(tmp_path.iterdir())


# What is written


def test_a_command_writes_over_its_own_files_and_no_others(tmp_path):
    def write(command, text, **options):
        with attribute_files(command, **options) as writing:
            return write_text(tmp_path / "x.txt", text).name, writing.notes

    assert write("run", "1") == ("x.txt", [])
    assert write("run", "2") == ("x.txt", [])
    name, (note,) = write("check", "3")
    assert name == "x-2.txt"
    assert (
        "was changed since 'linkwork check' wrote it, or is not its file, and is kept: the new file is x-2.txt" in note
    )
    (tmp_path / "x.txt").write_text("changed by hand")
    assert write("run", "4")[0] == "x-3.txt"
    assert write("check", "5")[0] == "x-2.txt"
    there = {path.name: path.read_text() for path in tmp_path.glob("x*")}
    assert there == {"x.txt": "changed by hand", "x-2.txt": "5", "x-3.txt": "4"}
    assert write("run", "6", force=True) == ("x.txt", [])
    assert write("run", "7") == ("x.txt", [])
    # in Python a path means what it says
    assert write_text(tmp_path / "x-2.txt", "8").read_text() == "8"


def test_a_file_of_a_command_is_not_lost_to_the_new_name_of_another(tmp_path):
    (tmp_path / "x.txt").write_text("kept")
    for _ in range(2):
        with attribute_files("exact") as writing:
            names = [write_text(tmp_path / name, name).name for name in ("x.txt", "x-2.txt", "x.txt", "x-3.txt")]
        assert names == ["x-2.txt", "x-2-2.txt", "x-2.txt", "x-3.txt"]
        (note,) = writing.notes
        assert note.startswith("2 files were changed since 'linkwork exact' wrote them, or are not its files, and are")
        assert "the new files are x-2.txt, x-2-2.txt; --force" in note
    # whichever is written first
    with attribute_files("check"):
        assert [write_text(tmp_path / name, name).name for name in ("x-4.txt", "x.txt")] == ["x-4.txt", "x-5.txt"]


def test_a_link_to_another_file_is_not_written_through(tmp_path):
    (tmp_path / "precious").write_text("kept")
    (tmp_path / "x.txt").symlink_to(tmp_path / "precious")
    (tmp_path / "y.txt").symlink_to(tmp_path / "not there")
    with attribute_files("run"):
        assert write_text(tmp_path / "x.txt", "1").name == "x-2.txt"
        assert write_text(tmp_path / "y.txt", "1").name == "y-2.txt"
    assert (tmp_path / "precious").read_text() == "kept"


def test_the_option_force(tmp_path, linkwork):
    words = ("run", "--published", "table-3.1", "--stop-time", "2 ms", "--no-plot")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "table-3.1.csv").write_text("measured for a week")
    result = linkwork(*words)
    assert "wrote out/table-3.1-2.csv" in result.stdout
    assert "table-3.1.csv was changed since 'linkwork run' wrote it" in " ".join(result.stderr.split())
    assert (tmp_path / "out" / "table-3.1.csv").read_text() == "measured for a week"
    for force in (("--force",), ()):
        result = linkwork(*words, *force)
        assert "wrote out/table-3.1.csv" in result.stdout
        assert not result.stderr
    assert len(read_record(tmp_path / "out" / "table-3.1.csv", ("time",))[1][0]) > 1
    assert files.outputs.RECORD in os.listdir(tmp_path / "out")


# Messages


def test_texts_are_printed_as_they_were_typed(capsys):
    text = ":smile: [bold]x[/bold] [/nothing] \\[ $x^$"
    print_error(text)
    say(text)
    show_table(text, ("a",), [(text,)])
    said = capsys.readouterr()
    assert said.err.count(text) == 1
    assert said.out.count(text) == 3


def test_a_terminal_is_given_no_orders(capsys):
    say("\x1b[2J\x07\rhidden\u202eäß")
    assert capsys.readouterr().out == "\\x1b[2J\\x07\\rhidden\\u202eäß\n"


def test_a_title_with_broken_mathematics_is_drawn(tmp_path):
    figure = Figure()
    figure.suptitle("costs $x^ and $5")
    assert files.save_figure(figure, tmp_path / "x.png").stat().st_size > 1000


@pytest.mark.fmu
@pytest.mark.parametrize("name", ["crank.angle", "solver.message"])
@pytest.mark.parametrize("command", [("info",), ("probe", "--calls", "1"), ("verify",), ("check", "--fmu")])
def test_a_variable_without_a_name_is_a_sentence(tmp_path, linkwork, fmu, name, command):
    named = f'<ScalarVariable name="{name}"'.encode()
    copied(fmu, tmp_path / "nameless.fmu", lambda _, content: content.replace(named, b"<ScalarVariable"))
    result = linkwork(*command, "nameless.fmu", code=WRONG)
    assert "nameless.fmu is not an FMU" in result.stderr
    assert "name" in result.stderr.replace("nameless", "")


def test_names_of_files_need_not_be_utf_8(tmp_path, linkwork):
    odd = os.fsdecode(b"bad\xff")
    (tmp_path / f"{odd}.toml").write_text('published = "table-3.1"\nrun.stop_time = 0.01\n')
    for _ in range(2):  # the second time it knows its own files again, and writes over them
        linkwork("run", f"{odd}.toml", "--no-plot")
    assert [path.name for path in (tmp_path / "out").glob("*.csv")] == [f"{odd}.csv"]
    assert write_text(tmp_path / "note.md", odd).read_text() == "bad\\udcff"
