"""The table of masters that follow a commanded speed is what runs of them find."""

import os
from pathlib import Path

import pytest

from benchmarks.commanded import RESULTS, ROWS, measure_master
from benchmarks.tables import read

from .test_masters import SLOW, need

pytestmark = [pytest.mark.slow, pytest.mark.fmu]


@pytest.mark.long
@pytest.mark.parametrize("master", dict.fromkeys(row.master for row in ROWS))
def test_the_table_of_commanded_speeds_is_what_a_run_finds(tmp_path: Path, master: str) -> None:
    name = master.lower().strip("`")
    if name != "cosimulate":
        need(name)
    if name in SLOW and not os.environ.get("LINKWORK_ALL_MASTERS"):
        pytest.skip("it takes a minute: LINKWORK_ALL_MASTERS runs it")
    assert measure_master(master, tmp_path) == [row for row in read(RESULTS) if row["master"] == master]


def test_every_master_has_its_rows() -> None:
    assert [(row["master"], row["interface"]) for row in read(RESULTS)] == [(row.master, row.interface) for row in ROWS]
