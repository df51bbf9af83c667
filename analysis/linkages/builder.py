"""Ways to a described linkage: the tables of a file, or calls in Python that fill the same tables."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism

from .. import files
from .description import Description
from .package import Package

LINKAGE = "linkage"


def described(tables: Mapping[str, Any]) -> Description:
    """Read a description from the tables of a file below ``[linkage]``.

    Raises
    ------
    ParameterError
        With the place in the file of the first entry that is unknown, missing or wrong.
    """
    return files.read(Description, tables, LINKAGE)


def described_in(tables: Mapping[str, Any]) -> bool:
    """Return whether the tables of a file describe a linkage, or name the file that does."""
    own = tables.get(LINKAGE)
    return isinstance(own, str) or (isinstance(own, Mapping) and "bodies" in own)


def with_linkage(tables: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Return the tables of a case with the linkage that they describe compiled, and its name as their published set.

    Raises
    ------
    InputError
        If the file that they name describes no linkage.
    LinkageError, ParameterError
        If the description is wrong.
    """
    if not described_in(tables):
        return tables
    own = tables[LINKAGE]
    made = (load_package(folder / own) if isinstance(own, str) else _package(tables)).mechanism()
    return {"published": made.name, **{name: value for name, value in tables.items() if name != LINKAGE}}


def _package(tables: Mapping[str, Any]) -> Package:
    """Return the package of the linkage in the tables of a file, whose title is its own where it has no other."""
    title = {"title": tables["title"]} if "title" in tables else {}
    return Package(described({**title, **tables[LINKAGE]}))


def load_linkage(path: str | Path) -> Mechanism:
    """Compile the linkage that a file describes, or names the file of; see `docs/linkages.md`.

    Raises
    ------
    InputError, LinkageError, ParameterError
    """
    return load_package(path).mechanism()


def load_package(path: str | Path) -> Package:
    """Return the package of the linkage that a file describes, or names the file of.

    Raises
    ------
    InputError, LinkageError, ParameterError
    """
    tables = files.read_tables(path)
    if isinstance(tables.get(LINKAGE), str):
        path = Path(path).parent / tables[LINKAGE]
        tables = files.read_tables(path)
    if not isinstance(tables.get(LINKAGE), Mapping) or not described_in(tables):
        raise InputError(f"{path} describes no linkage: it must have a table [linkage] with bodies")
    return _package(tables)


class Builder:
    """A description in the making: each method adds an entry of the table of that name, as a file has it.

    Examples
    --------
    >>> bar = linkage("example-pendulum", ground={"A": (0, 0)}, gravity=9.81)
    >>> bar.body("rod", bar=("A", "B"), length="0.5 m", mass="1 kg").freedom("swing", "A", driven=False)
    <linkage example-pendulum: rod>
    >>> bar.mechanism().output_names[:2]
    ('swing.angle', 'swing.speed')
    """

    def __init__(self, name: str, ground: Mapping[str, Any], **entries: Any) -> None:
        self.tables: dict[str, Any] = {"name": name, "ground": _plain(ground), "bodies": {}, **_plain(entries)}

    def __repr__(self) -> str:
        return f"<linkage {self.tables['name']}: {', '.join(self.tables['bodies']) or 'no bodies yet'}>"

    def _add(self, table: str, name: str, entries: Mapping[str, Any]) -> Builder:
        self.tables.setdefault(table, {})[name] = _plain(entries)
        return self

    def body(self, name: str, **entries: Any) -> Builder:
        """Add a moving body: ``bar`` and ``length`` or ``points``, and ``mass``, ``cog``, ``inertia`` or ``section``."""
        return self._add("bodies", name, entries)

    def slide(self, name: str, **entries: Any) -> Builder:
        """Add a slide: ``body``, ``on``, ``through``, ``direction``."""
        return self._add("slides", name, entries)

    def slot(self, name: str, **entries: Any) -> Builder:
        """Add a pin in a slot: ``pin``, ``on``, ``through``, ``direction``."""
        return self._add("slots", name, entries)

    def gear(self, name: str, **entries: Any) -> Builder:
        """Add a pair of gears: ``bodies``, ``ratio``, ``phase``."""
        return self._add("gears", name, entries)

    def rack(self, name: str, **entries: Any) -> Builder:
        """Add a toothed rack: ``gear``, ``rack``, ``radius``, ``offset``."""
        return self._add("racks", name, entries)

    def spring(self, name: str, **entries: Any) -> Builder:
        """Add a spring with damper and friction: ``at`` or ``between``, ``stiffness``, ``free``, ``damping``, ``friction``."""
        return self._add("springs", name, entries)

    def freedom(self, name: str, joint: str, **entries: Any) -> Builder:
        """Add a freedom: the coordinate of a joint, with ``start``, ``speed``, ``driven``."""
        return self._add("freedoms", name, {"joint": joint, **entries})

    def mechanism(self) -> Mechanism:
        """Compile the linkage; its name is that of a published set, too, so that every function takes it.

        Raises
        ------
        LinkageError, ParameterError
        """
        return Package(described(self.tables)).mechanism()


def linkage(name: str, ground: Mapping[str, Any], **entries: Any) -> Builder:
    """Begin the description of a planar linkage.

    Parameters
    ----------
    name : str
    ground : mapping of str to (x, y)
        Points of the ground: numbers in metres, texts with a unit, or 0 for what is always zero.
    **entries
        Further entries of `Description`, such as ``gravity``, ``loads`` and ``assembly``.

    Examples
    --------
    >>> from analysis import linkage, simulate
    >>> bar = linkage("example-swing", ground={"A": (0, 0)}, gravity=9.81)
    >>> bar = bar.body("rod", bar=("A", "B"), length="0.5 m", mass="1 kg", inertia="0.02 kg*m^2")
    >>> made = bar.freedom("swing", "A", driven=False).mechanism()
    >>> run = simulate("example-swing", stop_time=1.0)
    >>> bool(abs(run["energy.residual"]).max() < 1e-6)
    True
    """
    return Builder(name, ground, **entries)


def _plain(value: Any) -> Any:
    """Return mappings and sequences as a file has them."""
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, (list, tuple)) else value
