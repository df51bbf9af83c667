"""Records: none can be changed or given an attribute of another name, and most take their fields by name alone."""

import importlib
import pkgutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from types import ModuleType
from typing import Any

import pytest

import linkwork
from analysis import files, run

#: What is filled as work goes on.
CHANGED = {"Writing", "Run"}
#: What has one field that matters, or two that are always given; kinds of entries, signals and what is made inside.
BY_PLACE = {
    *("Quantity", "Whole", "Choice", "Many", "Range", "Table", "Kinds", "Piecewise", "Harmonics", "Function"),
    *("Encoded", "Occurrence", "Start"),
}  # fmt: skip


def modules(package: ModuleType) -> Iterator[ModuleType]:
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        yield importlib.import_module(found.name)


RECORDS = {
    f"{record.__module__}.{record.__name__}": record
    for package in (linkwork, files, run)
    for module in modules(package)
    for record in vars(module).values()
    if isinstance(record, type) and is_dataclass(record) and record.__module__ == module.__name__
}


@pytest.mark.parametrize("record", RECORDS.values(), ids=RECORDS)
def test_a_record_is_closed(record: Any) -> None:
    changed, by_place = record.__name__ in CHANGED, record.__name__ in CHANGED | BY_PLACE
    assert record.__dataclass_params__.frozen is not changed
    # two keep a dictionary, for what they compute once
    assert ("__slots__" in vars(record)) is (record.__name__ not in ("Mechanism", "Encoded"))
    assert any(field.kw_only for field in fields(record)) is not by_place
