"""Write pieces of Python source: literals, lists, records and functions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping


def quote(text: str) -> str:
    """Return a text as a Python string literal."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'


def indent_lines(texts: Iterable[str], indent: int = 4, end: str = ",") -> str:
    """Return the texts as lines, each indented and followed by ``end``."""
    return "\n".join(f"{' ' * indent}{text}{end}" for text in texts)


def tuple_source(texts: Iterable[str]) -> str:
    """Return the source of a tuple that is not empty."""
    return f"({', '.join(texts)},)"


def record(name: str, doc: str, fields: Mapping[str, str]) -> str:
    """Return the source of a NamedTuple with typed fields."""
    rows = indent_lines((f"{n}: {kind}" for n, kind in fields.items()), end="")
    return f'class {name}(NamedTuple):\n    """{doc}"""\n\n{rows}'


def function(signature: str, doc: str, rows: Iterable[str]) -> str:
    """Return the source of a function with this signature, docstring and body."""
    return f'def {signature}:\n    """{doc}"""\n{indent_lines(rows, end="")}'
