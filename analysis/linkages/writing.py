"""Write pieces of Python source: literals, lists, records and functions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping


def quoted(text: str) -> str:
    """Return a text as a Python string literal."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'


def listed(texts: Iterable[str], indent: int = 4, end: str = ",") -> str:
    """Return indented lines with the same ending."""
    return "\n".join(f"{' ' * indent}{text}{end}" for text in texts)


def tupled(texts: Iterable[str]) -> str:
    """Return the source of a tuple that is not empty."""
    return f"({', '.join(texts)},)"


def record(name: str, doc: str, fields: Mapping[str, str]) -> str:
    """Return the source of a NamedTuple with typed fields."""
    return f'class {name}(NamedTuple):\n    """{doc}"""\n\n{listed((f"{n}: {kind}" for n, kind in fields.items()), end="")}'


def function(signature: str, doc: str, rows: Iterable[str]) -> str:
    """Return the source of a function with this signature, docstring and body."""
    return f'def {signature}:\n    """{doc}"""\n{listed(rows, end="")}'
