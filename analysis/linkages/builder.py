"""Read a described linkage from the tables of a file, or build it by calls in Python that fill the same tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError
from linkwork.mechanism import Mechanism

from .. import files
from ..files import unknown_name
from .description import GROUND, Description
from .package import Package

LINKAGE = "linkage"


def read_description(tables: Mapping[str, Any]) -> Description:
    """Read a description from the content of the table ``[linkage]`` of a file.

    Raises
    ------
    ParameterError
        If an entry is unknown, missing or wrong; the message gives its place in the file.
    """
    return files.read(Description, tables, LINKAGE)


def has_linkage(tables: Mapping[str, Any]) -> bool:
    """Return whether the tables of a file describe a linkage, or name the file that does."""
    own = tables.get(LINKAGE)
    return isinstance(own, str) or (isinstance(own, Mapping) and "bodies" in own)


def with_linkage(tables: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Compile the linkage of a case; return the case's tables with the linkage replaced by the name of its published set.

    Tables without a linkage are returned unchanged. If the case names a file for its linkage, the other tables of this file
    apply as well, except its title and tuning, unless the case overrides them: see `_merge_tables`. ``folder`` is the folder
    of the case.

    Raises
    ------
    InputError
        If the file named in the tables describes no linkage, or the tables name a published set as well.
    LinkageError, ParameterError
        If the description is wrong.
    """
    if LINKAGE in tables and not isinstance(tables[LINKAGE], str | Mapping):
        raise ParameterError(LINKAGE, tables[LINKAGE], "be the name of a file, or a table that describes a linkage")
    if not has_linkage(tables):
        return tables
    own = tables[LINKAGE]
    named = _named_files(folder / own) if isinstance(own, str) else []
    made: dict[str, Any] = {}
    for path, below in reversed(named):
        made = _merge_tables(made, _with_absolute_files(_without_linkage(below, "title", "tune"), path.parent))
    rest = _without_linkage(tables)
    return {"published": _package(named[-1][1] if named else tables).mechanism().name, **_merge_tables(made, rest)}


def _without_linkage(tables: Mapping[str, Any], *others: str) -> dict[str, Any]:
    """Return the tables without the linkage and the entries ``others``; raise InputError if a published set is named, too."""
    if "published" in tables:
        raise InputError(f"a case has one mechanism: leave out linkage, or published = {tables['published']!r}")
    return {name: value for name, value in tables.items() if name not in (LINKAGE, *others)}


def _named_files(path: Path) -> list[tuple[Path, Mapping[str, Any]]]:
    """Return the chain of files that begins at ``path``, each with its tables.

    Each file names the next one as the file of its linkage; the last file describes the linkage.
    """
    found: list[tuple[Path, Mapping[str, Any]]] = []
    while True:
        if any(path.resolve() == known.resolve() for known, _ in found):
            raise InputError(
                f"{path} names itself as the file of its linkage: one of these files must have a table [linkage]"
            )
        tables = files.read_tables(path)
        if not has_linkage(tables):
            raise InputError(f"{path} describes no linkage: it must have a table [linkage] with bodies")
        found.append((path, tables))
        if not isinstance(tables[LINKAGE], str):
            return found
        path = path.parent / tables[LINKAGE]


def _with_absolute_files(table: Any, folder: Path) -> Any:
    """Return a table in which the names of files, relative to ``folder``, are absolute paths."""
    if not isinstance(table, Mapping):
        return table
    return {
        name: str((folder / value).resolve())
        if name == "file" and isinstance(value, str)
        else _with_absolute_files(value, folder)
        for name, value in table.items()
    }


def _merge_tables(base: Mapping[str, Any], tables: Mapping[str, Any], *, top: bool = True) -> dict[str, Any]:
    """Return ``base`` overridden by ``tables``, entry by entry; the tables of runs and drives are replaced as a whole."""
    merged = {**base, **tables}
    for name, table in tables.items():
        whole = top and (name in ("run", "drive") or name.endswith("Drive"))
        if not whole and isinstance(table, Mapping) and isinstance(below := base.get(name), Mapping):
            merged[name] = _merge_tables(below, table, top=False)
    return merged


def _package(tables: Mapping[str, Any]) -> Package:
    """Return the package of the linkage in the tables of a file; if it has no title, it gets that of the file."""
    title = {"title": tables["title"]} if "title" in tables else {}
    return Package(read_description({**title, **tables[LINKAGE]}))


def load_linkage(path: str | Path) -> Mechanism:
    """Compile the linkage that a file describes, or that another file named in it describes; see `docs/linkages.md`.

    Raises
    ------
    InputError, LinkageError, ParameterError
    """
    return load_package(path).mechanism()


def load_package(path: str | Path) -> Package:
    """Return the package of the linkage that a file describes, or that another file named in it describes.

    Raises
    ------
    InputError, LinkageError, ParameterError
    """
    return _package(_named_files(Path(path))[-1][1])


#: A number in SI, or a text with a unit such as "50 mm".
Amount = float | str
#: Coordinates x, y; the whole number 0 means that a coordinate is always zero and is no parameter.
Place = Sequence[Amount] | NDArray[np.float64]


class Builder:
    """Builder of the description of a linkage, with one method for each kind of entry of a linkage file.

    For instance, `body` adds a body, as a table ``[linkage.bodies.<name>]`` does. Amounts are numbers in SI or texts with a
    unit, such as ``"50 mm"``. An omitted argument has the same default as in a file. Each method that adds an entry returns the
    builder, and raises InputError if there is an entry of this kind with the same name.

    Examples
    --------
    >>> bar = linkage("example-pendulum", ground={"A": (0, 0)}, gravity=9.81)
    >>> bar.body("rod", bar=("A", "B"), length="0.5 m", mass="1 kg").freedom("swing", "A", driven=False)
    <linkage example-pendulum: rod>
    >>> bar.mechanism().output_names[:2]
    ('swing.angle', 'swing.speed')
    """

    def __init__(self, name: str, ground: Mapping[str, Place], **entries: Any) -> None:
        self.tables: dict[str, Any] = {"name": name, "ground": _as_data(ground), "bodies": {}, **_without_none(entries)}

    def __repr__(self) -> str:
        return f"<linkage {self.tables['name']}: {', '.join(self.tables['bodies']) or 'no bodies yet'}>"

    def _add(self, table: str, name: str, **entries: Any) -> Builder:
        named = self.tables.setdefault(table, {})
        if name in named:
            raise InputError(f"{self!r} already has {table}.{name}: choose another name")
        named[name] = _without_none(entries)
        return self

    def body(
        self,
        name: str,
        *,
        bar: Sequence[str] | None = None,
        length: Amount | None = None,
        points: Mapping[str, Place] | None = None,
        mass: Amount | None = None,
        cog: Place | None = None,
        inertia: Amount | None = None,
        section: Mapping[str, Any] | None = None,
    ) -> Builder:
        """Add a moving body; two bodies with a point of the same name are pinned together at that point.

        Parameters
        ----------
        name : str
        bar : (str, str), optional
            Two points: the first is the body's origin, the second lies at ``length`` along its x axis.
        length : optional
            Length of the bar (m).
        points : mapping of str to (x, y), optional
            Further points, or all points of a body that is not a bar (m).
        mass, cog, inertia : optional
            Mass (kg), centre of mass (m), and moment of inertia about the centre of mass (kg.m2). By default the centre of
            mass is the middle of the bar, or the origin of a body that is not a bar.
        section : mapping, optional
            Cross-section from which mass, centre of mass and inertia are computed: a ``material`` and a ``kind``, which is
            ``"bar"`` with ``width`` and ``thickness``, ``"rod"`` with ``diameter``, ``"tube"`` with ``outer`` and ``inner``, or
            ``"plate"`` with ``thickness`` and ``corners``. All but a plate may have an ``overhang`` beyond each pin.
        """
        return self._add(
            "bodies", name, bar=bar, length=length, points=points, mass=mass, cog=cog, inertia=inertia, section=section
        )

    def pin(self, name: str, **places: Place) -> Builder:
        """Pin bodies together, and to the ground, at a point of each.

        Parameters
        ----------
        name : str
            Name of the joint and of the points.
        **places : (x, y)
            Coordinates of the point in the frame of each body, by the body's name, or ``ground`` (m).

        Raises
        ------
        InputError
            If there is no such body yet.

        Examples
        --------
        >>> swing = linkage("example-pin", ground={}).body("rod", points={"end": (0.5, 0)}, mass=1.0, inertia=0.1)
        >>> swing.pin("A", ground=(0, 0), rod=(0, 0)).freedom("swing", "A", driven=False).mechanism().name
        'example-pin'
        """
        for body, place in places.items():
            if body != GROUND and body not in self.tables["bodies"]:
                raise unknown_name(body, (GROUND, *self.tables["bodies"]), f"body {body}, named in the pin {name}")
            own = self.tables["bodies"].get(body)
            points = self.tables["ground"] if own is None else own.setdefault("points", {})
            points[name] = _as_data(place)
        return self

    def slide(
        self, name: str, *, body: str, through: str, on: str | None = None, direction: Amount | None = None
    ) -> Builder:
        """Add a block that slides along a line of another body without rotating relative to it.

        Parameters
        ----------
        name : str
            Name of the joint.
        body : str
            The block: its origin is on the line, and its x axis along it.
        through : str
            A point of the guiding body on the line; positions are measured from it.
        on : str, optional
            The guiding body, by default the ground.
        direction : optional
            Direction of the line in the guiding body (rad).
        """
        return self._add("slides", name, body=body, on=on, through=through, direction=direction)

    def slot(self, name: str, *, pin: str, on: str, through: str, direction: Amount | None = None) -> Builder:
        """Add a straight slot in the body ``on``, in which the ``pin`` of another body slides.

        The centre line of the slot passes through the point ``through`` of ``on``, in a ``direction`` (rad) relative to ``on``.
        """
        return self._add("slots", name, pin=pin, on=on, through=through, direction=direction)

    def gear(self, name: str, *, bodies: Sequence[str], ratio: Amount, phase: Amount | None = None) -> Builder:
        """Add a pair of gears, each pinned to the same third body.

        Parameters
        ----------
        name : str
        bodies : (str, str)
        ratio : float
            Speed of the second gear divided by that of the first, relative to the third body; negative for external gears.
        phase : optional
            Angle of the second gear when the angle of the first is zero, both relative to the third body (rad).
        """
        return self._add("gears", name, bodies=bodies, ratio=ratio, phase=phase)

    def rack(self, name: str, *, gear: str, rack: str, radius: Amount, offset: Amount | None = None) -> Builder:
        """Add a toothed rack, which slides on the body to which its ``gear`` is pinned.

        ``radius`` is the pitch radius of the gear (m): the travel of the rack per radian of the gear, both relative to that
        body; it may be negative. ``offset`` is the position of the rack when the angle of the gear is zero (m).
        """
        return self._add("racks", name, gear=gear, rack=rack, radius=radius, offset=offset)

    def spring(
        self,
        name: str,
        *,
        between: Sequence[str] | None = None,
        at: str | None = None,
        bodies: Sequence[str] | None = None,
        stiffness: Amount | None = None,
        damping: Amount | None = None,
        free: Amount | None = None,
        friction: Amount | None = None,
        law: str | Sequence[Sequence[Amount]] | None = None,
        constants: Mapping[str, Amount] | None = None,
        driven: bool | None = None,
    ) -> Builder:
        """Add a spring with damper, dry friction and force law: between two points, at a joint, or between two bodies.

        Give one of ``between``, ``at`` and ``bodies``.

        Parameters
        ----------
        name : str
        between : (str, str), optional
            Two points.
        at : str, optional
            A pin or a slide.
        bodies : (str, str), optional
            Two bodies, which need not be joined. The rotation of the second relative to the first twists the spring. Whole
            turns count if the angles of both follow from the freedoms alone, such as those of cranks and gears; otherwise the
            twist is at most half a turn in either direction.
        stiffness, damping : optional
            Stiffness and damping in N/m and N.s/m; about a pin or between two bodies in N.m/rad and N.m.s/rad.
        free : optional
            Length, position (m) or angle (rad) at which the spring exerts no force.
        friction : optional
            Level of Coulomb friction (N, N.m), smooth about rest.
        law : str or sequence of (x, force), optional
            A further force that opposes the stretch: a formula in the stretch x and its rate v, such as ``"a*x**3 + 4*v"``, or
            a table of stretch and force (SI), interpolated linearly. The work of this force counts as dissipated.
        constants : mapping, optional
            Constants of the law, by their names in the formula; they become parameters of the mechanism.
        driven : bool, optional
            Whether an input adds a force that lengthens the spring, as a cylinder does, or a torque that twists it, as a motor
            does. A driven spring may also be at a joint whose coordinate is not a freedom.
        """
        return self._add(
            "springs", name, between=between, at=at, bodies=bodies, stiffness=stiffness, damping=damping, free=free,
            friction=friction, law=law, constants=constants, driven=driven,
        )  # fmt: skip

    def freedom(
        self,
        name: str,
        joint: str,
        *,
        start: Amount | None = None,
        speed: Amount | None = None,
        driven: bool | None = None,
    ) -> Builder:
        """Add a degree of freedom: the angle of a pin, or the position of a slide.

        Parameters
        ----------
        name : str
        joint : str
            A pin, whose coordinate is the angle of its second body relative to the first; or a slide, whose coordinate is the
            position of the block.
        start : optional
            Initial angle or position (rad, m).
        speed : optional
            Commanded rate (rad/s, m/s), at the start and as long as no input changes it. The whole number 0 means that no rate
            is commanded; "0 rpm" commands rest. For a freedom that is not driven: its initial rate.
        driven : bool, optional
            Whether its rate can be commanded. By default this is true only of the first freedom that has a speed; if none
            has one, of the first freedom.
        """
        return self._add("freedoms", name, joint=joint, start=start, speed=speed, driven=driven)

    def drive(
        self,
        name: str,
        joint: str | None = None,
        *,
        between: Sequence[str] | None = None,
        speed: Amount | None = None,
        start: Amount | None = None,
    ) -> Builder:
        """Drive a joint, whose coordinate becomes a freedom, or press two points apart by a force, as a cylinder does.

        Give either ``joint`` or ``between``.

        Parameters
        ----------
        name : str
            Name of the freedom, or of the cylinder.
        joint : str, optional
            A pin or a slide: its ``speed`` is commanded (rad/s, m/s); if no speed is given, its torque or force is an input.
        between : (str, str), optional
            Two points; the force between them is an input.
        speed, start : optional
            Commanded rate and initial coordinate of the joint; see `freedom`.

        Raises
        ------
        InputError
            If both a joint and points are given, or neither.
        """
        if (joint is None) == (between is None):
            raise InputError(
                f"the drive {name} has the joint {joint} and the points {between}: it must have one of these"
            )
        if joint is not None:
            return self.freedom(name, joint, start=start, speed=speed, driven=True)
        return self.spring(name, between=between, driven=True)

    def mechanism(self) -> Mechanism:
        """Compile the linkage and return its mechanism; every analysis then accepts the name of the linkage as a published set.

        Raises
        ------
        LinkageError, ParameterError
        """
        return Package(read_description(self.tables)).mechanism()


def linkage(
    name: str,
    ground: Mapping[str, Place],
    *,
    title: str | None = None,
    source: str | None = None,
    gravity: Amount | None = None,
    gravity_direction: Amount | None = None,
    assembly: Mapping[str, int] | None = None,
    friction: Mapping[str, Amount] | None = None,
    loads: Sequence[str | Mapping[str, str]] | None = None,
    torques: Sequence[str] | None = None,
) -> Builder:
    """Begin the description of a planar linkage.

    Parameters
    ----------
    name : str
        Letters, digits and hyphens.
    ground : mapping of str to (x, y)
        Points of the ground: numbers in metres, texts with a unit, or 0 for a coordinate that is always zero.
    title, source : str, optional
        Title, and source of the data.
    gravity, gravity_direction : optional
        Acceleration of gravity (m/s2), by default none, and its direction (rad), by default downwards.
    assembly : mapping of str to int, optional
        Assembly of each dyad, +1 or -1, by the name of the joint between its two bodies; +1 by default.
    friction : mapping, optional
        Coulomb friction proportional to the joint force, by the name of the joint: for a pin the friction radius (m), which is
        coefficient times pin radius; for a slide or a slot the coefficient.
    loads : sequence, optional
        Points on which forces can act; ``{"point": "P", "frame": "body"}`` for a force in the axes of the body.
    torques : sequence of str, optional
        Bodies on which torques can act.

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
    return Builder(
        name, ground, title=title, source=source, gravity=gravity, gravity_direction=gravity_direction, assembly=assembly,
        friction=friction, loads=loads, torques=torques,
    )  # fmt: skip


def _without_none(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries that are not None, converted to the data types of a file."""
    return {key: _as_data(value) for key, value in entries.items() if value is not None}


def _as_data(value: Any) -> Any:
    """Convert mappings to dicts, and sequences and arrays to lists, as a file has them."""
    if isinstance(value, Mapping):
        return {key: _as_data(inner) for key, inner in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [_as_data(inner) for inner in value] if isinstance(value, (list, tuple)) else value
