"""The same bytes for everyone: builds by two users, the bill of materials, and building again from an FMU's own sources."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from analysis import cli
from analysis.export import BuildError, rebuild
from analysis.export.bill import BILL
from analysis.numerics.cache import cache_root, lock_folder
from tests.scripts import linkwork

ROOT = Path(__file__).parents[2]


def built_by(user: Path, platforms: str, **variables: str) -> dict[str, bytes]:
    """Build the FMUs of a mechanism as another user would: other folders, another time zone, language, mask, hash seed.

    Of what is in the cache a user has only what Zig compiles for its own use.
    """
    (user / "tmp").mkdir(parents=True)
    for kept in cache_root().glob("zig-*/"):
        with lock_folder(kept):
            shutil.copytree(kept, user / "cache" / kept.name)
    changed = {"HOME": str(user), "TMPDIR": str(user / "tmp"), "LINKWORK_CACHE_DIR": str(user / "cache")}
    command = [sys.executable, str(ROOT / "build_fmu.py"), "SliderCrank", "--dest", str(user / "fmus")]
    done = subprocess.run(
        [*command, "--platforms", platforms], cwd=user, env={**os.environ, **changed, **variables},
        umask=int(variables["MASK"], 8), capture_output=True, text=True, timeout=500, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return {path.name: path.read_bytes() for path in (user / "fmus").iterdir()}


@pytest.mark.slow
def test_two_users_build_the_same_bytes_for_all_platforms(tmp_path: Path) -> None:
    one = built_by(tmp_path / "one", "all", MASK="022", TZ="UTC", PYTHONHASHSEED="1")
    others = {"MASK": "077", "TZ": "Asia/Kolkata", "PYTHONHASHSEED": "2", "LC_ALL": "C", "USER": "b"}
    other = built_by(tmp_path / "another user" / "deeper", "all", **others)
    assert set(one) == {"SliderCrank.fmu", "SliderCrank-native.fmu", "SliderCrank-native-fmi3.fmu"}
    sums = [{name: hashlib.sha256(text).hexdigest() for name, text in built.items()} for built in (one, other)]
    assert sums[0] == sums[1]
    for path in sorted((tmp_path / "one" / "fmus").iterdir()):
        parts = list(rebuild(path))
        assert all(part.same for part in parts), parts
        # the files; then a library for each folder of platforms, or two of PythonFMU, two guards and modules
        assert len(parts) == 1 + {"SliderCrank.fmu": 5, "SliderCrank-native.fmu": 4}.get(path.name, 5)


def test_bill_of_materials(natives: dict[str, Path], fmus: dict[str, Path]) -> None:
    for path, made_by in ((natives["SliderCrank-native"], "ziglang"), (fmus["SliderCrank"], "pythonfmu")):
        with ZipFile(path) as archive:
            bill = json.loads(archive.read(BILL))
            files = {
                name: hashlib.sha256(archive.read(name)).hexdigest() for name in archive.namelist() if name != BILL
            }
        assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
        assert files == {c["name"]: c["hashes"][0]["content"] for c in bill["components"] if c["type"] == "file"}
        references = [c["bom-ref"] for c in bill["components"]]
        assert len(set(references)) == len(references)
        assert set(bill["dependencies"][0]["dependsOn"]) < set(references)
        assert made_by in {tool["name"] for tool in bill["metadata"]["tools"]["components"]}


def test_the_icon_is_where_each_version_of_the_standard_looks(natives: dict[str, Path]) -> None:
    for name, icon in (("SliderCrank-native", "model.png"), ("SliderCrank-native-fmi3", "terminalsAndIcons/icon.png")):
        with ZipFile(natives[name]) as archive:
            assert archive.read(icon).startswith(b"\x89PNG")


def altered(fmu: Path, target: Path, place: str, content: bytes, *, listed: bool) -> Path:
    """Copy an FMU with one other file, whose hash its bill of materials states or does not."""
    with ZipFile(fmu) as source:
        files = {name: source.read(name) for name in source.namelist()} | {place: content}
    if listed:
        bill = json.loads(files[BILL])
        for component in bill["components"]:
            if component["name"] == place:
                component["hashes"][0]["content"] = hashlib.sha256(content).hexdigest()
        files[BILL] = json.dumps(bill).encode()
    with ZipFile(target, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return target


@pytest.mark.parametrize("listed", [True, False])
def test_a_library_that_is_not_of_its_sources_is_found(natives: dict[str, Path], tmp_path: Path, listed: bool) -> None:
    fmu = natives["SliderCrank-native"]
    with ZipFile(fmu) as archive:
        place = next(name for name in archive.namelist() if name.startswith("binaries/"))
        content = bytearray(archive.read(place))
    content[len(content) // 2] ^= 1
    wrong = altered(fmu, tmp_path / "wrong.fmu", place, bytes(content), listed=listed)
    parts = list(rebuild(wrong))
    assert [part.same for part in parts] == [listed, False]
    assert parts[1].what == place
    result = linkwork("verify --rebuild", wrong, code=cli.CHECK_FAILED)
    assert place.rpartition("/")[2][:12] in result.output


def test_only_an_fmu_with_a_bill_can_be_built_again(tmp_path: Path) -> None:
    with ZipFile(tmp_path / "other.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
    with pytest.raises(BuildError, match=BILL):
        list(rebuild(tmp_path / "other.fmu"))
