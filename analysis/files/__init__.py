"""Reading and writing files: tables of numbers, curves, drawings, and TOML or JSON with units; knows no mechanism."""

from __future__ import annotations

from .curves import read_points
from .drawings import Circle, Drawing, Line, Polyline, Text, save_drawing, save_figure, to_dxf, to_svg
from .reader import (
    Choice,
    Kinds,
    Many,
    Quantity,
    Range,
    Reader,
    Table,
    Whole,
    as_it_is,
    check_names,
    entry,
    flag,
    names_of,
    read,
    table_of,
    text,
    unknown_name,
)
from .structured import flattened, overridden, read_tables, write_tables
from .tables import load_array, read_csv, read_rows, save_array, write_csv

__all__ = [
    "Choice",
    "Circle",
    "Drawing",
    "Kinds",
    "Line",
    "Many",
    "Polyline",
    "Quantity",
    "Range",
    "Reader",
    "Table",
    "Text",
    "Whole",
    "as_it_is",
    "check_names",
    "entry",
    "flag",
    "flattened",
    "load_array",
    "names_of",
    "overridden",
    "read",
    "read_csv",
    "read_points",
    "read_rows",
    "read_tables",
    "save_array",
    "save_drawing",
    "save_figure",
    "table_of",
    "text",
    "to_dxf",
    "to_svg",
    "unknown_name",
    "write_csv",
    "write_tables",
]
