"""Write a described linkage as a Python package of the same form as a hand-written mechanism, and import it."""

from __future__ import annotations

import hashlib
import importlib
import re
import sys
from math import cos, degrees, hypot, inf, isfinite, pi, remainder, sin, sqrt, tau
from pathlib import Path
from traceback import extract_tb, walk_tb
from types import SimpleNamespace
from typing import Any

from linkwork import planar
from linkwork.errors import AssemblyError, LinkworkError
from linkwork.mechanism import Mechanism

from ..mechanisms import MECHANISMS, register
from ..numerics.cache import code_folder, store_file
from .description import GROUND, Description, LinkageError, is_given
from .drawing import Picture
from .dynamics import Contacts, Motion
from .equations import PoseWriter, counted_twists
from .laws import WRITTEN
from .mistakes import check_entries
from .outputs import Outputs
from .parameters import Drive, interface, length_and_mass, rotations
from .structure import Structure, analyse
from .variables import Variables
from .writing import function, indent_lines, quote

_FRICTION = ("FRICTION_RATE", "FRICTION_SPEED", "contact_forces", "jamming_margin", "lesser")

_EQUATIONS = '''"""Equations of the {name}, written from its description: one freedom, one dyad after the other.

The state is {state},
then the work dissipated and supplied. `linkwork.planar` explains the functions.
"""

from __future__ import annotations

{imports}


class Constants(NamedTuple):
    """The parameters, and constants computed from them."""

{constants}


{body}
'''

_MECHANISM = '''"""The linkage {name}: {title}. Written from its description."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, pi, radians, sin
from typing import ClassVar

from linkwork import friction, planar
from linkwork.mechanism import Channel, Drawing, Equations, Freedom, Joint, Link, Mechanism, Mode, Part, PublishedSet
from linkwork.parameters import CheckedParameters, CheckedState, Rules
from linkwork.variables import POSITION, RATE, Variable, energy_outputs, output, status_variables, tolerance_parameter

from . import equations


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(CheckedParameters):
    """SI units."""

    RULES: ClassVar[Rules] = Rules({rules})

{fields}

    def constants(self) -> equations.Constants:
        """Return the constants of the equations."""
        return equations.Constants(
{values}
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Initial(CheckedState):
    """State at the start."""

{initial}


VARIABLES = (
{variables}
    *status_variables(),
)


def check_assembly(x: tuple[float, ...], p: equations.Constants) -> None:
    """Check that the bodies can be joined at the state x."""
    planar.check_clearance(equations.places, x, p, lambda: MECHANISM.describe_state(x))


MECHANISM = Mechanism(
    name={quoted_name},
    fmu={fmu},
    title={quoted_title},
    description={quoted_title},
    notes=({notes},),
    parameters=Parameters,
    initial=Initial,
    published={{
        {quoted_name}: PublishedSet(
            Parameters(),
            Initial({started}),
            {{{driven}}},
            {source},
            origins={{
{origins}
            }},
        )
    }},
    freedoms=(
{freedoms}
    ),
    channels=(
{channels}
    ),
    variables=VARIABLES,
    position_parameters=(
{positions}
    ),
    experiment={experiment},
    modules=(friction, planar, equations),
    equations=Equations.of(equations),
    check_assembly=check_assembly,
    error_scale=equations.error_scale,
    unjoined=planar.UNJOINED,
    drawing=Drawing(
        (
{joints}
        ),
        equations.positions,
        (
{parts}
        ),
        ({paths}),
    ),
    links=(
{links}
    ),
    greatest_rotation={rotation},
    switch="{switch}",
)
'''


class Package:
    """Python package of one linkage, as source texts.

    Attributes
    ----------
    description : Description
    structure : Structure
    motion : Motion
    name : str
        Name of the linkage as a Python identifier, with a hash of the texts.
    files : dict of str to str
        Texts by file name.

    Raises
    ------
    LinkageError, ParameterError
        If the description is wrong.
    """

    def __init__(self, description: Description) -> None:
        self.description = description
        check_entries(description)
        self.structure: Structure = analyse(description)
        self.interface = interface(description, self.structure)
        counted = counted_twists(self.interface)
        self.motion = Motion(self.interface, counted)
        self.picture = Picture(self.interface)
        self.variables = Variables(self.interface, counted)
        equations = self._equations()
        self.variables.middles |= self._described_angles(equations)
        self.files = {"equations.py": equations, "__init__.py": self._mechanism()}
        digest = hashlib.sha256("\0".join(self.files.values()).encode()).hexdigest()
        self.name = f"{re.sub(r'[^a-z0-9]', '_', description.name.lower())}_{digest[:12]}"

    def mechanism(self, folder: Path | None = None) -> Mechanism:
        """Import the package, register its mechanism and return it.

        Parameters
        ----------
        folder : path, optional
            Folder in which the package is stored; by default one in the user's cache.

        Raises
        ------
        LinkageError
            If the linkage cannot be assembled or moved at its start, or another mechanism has its name, or that of its FMU.
        """
        name = self.description.name
        known = MECHANISMS.get(name)
        if known is not None and known.modules[-1].__package__ == self.name:
            return known
        if known is not None and not hasattr(sys.modules[str(known.modules[-1].__package__)], "equations"):
            raise LinkageError(f"linkage.name is {name}: it must not be that of a mechanism of Linkwork")
        for other in MECHANISMS.values():
            if other.name != name and name in other.published:
                raise LinkageError(f"linkage.name is {name}: it must not be that of a published set of {other.name}")
        place = code_folder("linkages") if folder is None else Path(folder)
        own = place / self.name
        own.mkdir(parents=True, exist_ok=True)
        for file, text in self.files.items():
            if not (own / file).is_file() or (own / file).read_text(encoding="utf-8") != text:
                store_file(own / file, text.encode())
        if str(place) not in sys.path:
            sys.path.append(str(place))
        importlib.invalidate_caches()
        made: Mechanism = importlib.import_module(self.name).MECHANISM
        for other in MECHANISMS.values():
            if other.name != name and other.fmu == made.fmu:
                of = f"its FMU would be called {made.fmu}, like that of {other.name}"
                raise LinkageError(f"linkage.name is {name}: {of}; it must have another name")
        start, module = made.published[name], made.modules[-1]
        x, p = made.state(start.initial), start.parameters.constants()
        try:
            made.check_assembly(x, p)
        except AssemblyError as error:
            signs = ", linkage.assembly" if any(dyad.has_two_assemblies for dyad in self.structure.dyads) else ""
            raise LinkageError(
                f"{error}{self._unreachable(module, x, p)}: change the start in linkage.freedoms{signs} or the lengths"
            ) from None
        places = module.places(x, p)
        self._check_lines(places)
        self._check_motion(made, x, p, places)
        self._check_twists(p, places)
        MECHANISMS.pop(name, None)
        try:
            register(made)
        except LinkworkError:
            if known is not None:
                MECHANISMS[name] = known
            raise
        return made

    # below x is the state at the start, p are the constants, and places is what the equations compute from both

    def _unreachable(self, module: Any, x: Any, p: Any) -> str:
        """Return a phrase that names two bodies that cannot be joined at the start; empty if all bodies can be joined."""
        try:
            module.places(x, p)
        except (ValueError, ArithmeticError) as error:
            lines = [at.line or "" for at in extract_tb(error.__traceback__) if at.name == "places"]
            *_, (frame, _) = walk_tb(error.__traceback__)
            found, sizes = frame.f_locals, ""
            if frame.f_code.co_name == "pin_pin_pin":
                apart, one, other = (sqrt(found[square]) for square in ("dd", "aa", "bb"))
                sizes = f", {one:.6g} m and {other:.6g} m long between pins that are {apart:.6g} m apart"
            for dyad in self.structure.dyads:
                if any(f"margin_{dyad.inner.name} =" in line for line in lines):
                    slots = self.description.slots
                    tables = ("slots" if side.body in slots else "bodies" for side in dyad.sides)
                    bodies = " and ".join(f"linkage.{t}.{side.body}" for t, side in zip(tables, dyad.sides))
                    return f", {bodies}, joined at {dyad.inner.name}{sizes}"
        return ""

    def _check_lines(self, places: Any) -> None:
        """Raise LinkageError if at the start the two pins that give a line its direction coincide."""
        for dyad in self.structure.dyads:
            if dyad.kind == "RPR":
                one, other = (getattr(places, f"at_{side.joint.name}") for side in dyad.sides)
                if hypot(one.x - other.x, one.y - other.y) <= 1e-6 * length_and_mass(self.interface)[0]:
                    name, pins = dyad.inner.name, " and ".join(side.joint.name for side in dyad.sides)
                    table = "slots" if name in self.description.slots else "slides"
                    raise LinkageError(
                        f"linkage.{table}.{name} has no direction at the start: the pins {pins} are at one place; change the "
                        "start in linkage.freedoms, linkage.assembly or the lengths"
                    )

    def _check_motion(self, made: Mechanism, x: Any, p: Any, places: Any) -> None:
        """Raise LinkageError if the accelerations at the start are not finite."""
        try:
            if all(map(isfinite, made.equations.derivative(x, made.idle_inputs(p), p))):
                return
        except (ValueError, TypeError, ArithmeticError):
            pass
        springs, module = self.description.springs.items(), made.modules[-1]
        lawless = (name for name, spring in springs if spring.law and not self._has_force(module, x, p, name))
        laws = [f"the law of linkage.springs.{name}" for name in lawless]
        for name, spring in springs:
            if spring.between:
                (one, other) = (getattr(places, f"at_{own}") for own in spring.between)
                if one.x == other.x and one.y == other.y:
                    laws.append(f"the length of linkage.springs.{name}, which has no direction at 0 m,")
        bodies = self.description.bodies.items()
        light = [name for name, body in bodies if not (body.mass or body.section)]
        light = light or [name for name, body in bodies if not (body.inertia or body.section or body.bar)]
        light = light or [name for name, body in bodies if not (body.inertia or body.section)]
        masses = f"the mass or inertia of {' or '.join(f'linkage.bodies.{name}' for name in light) or 'a body'}"
        causes = " or ".join(laws or (masses,))
        raise LinkageError(f"the accelerations at the start are not finite numbers: change {causes.removesuffix(',')}")

    def _has_force(self, module: Any, x: Any, p: Any, name: str) -> bool:
        """Return whether the law of a spring has a finite value at the start."""
        try:
            s = module.springs(module.places(x, p), x, p)
            stretch, rate = getattr(s, f"{name}_stretch"), getattr(s, f"{name}_rate")
            constants = (p,) if self.description.springs[name].constants else ()
            return isfinite(getattr(module, f"{name}_law")(stretch, rate, *constants))
        except (ValueError, TypeError, ArithmeticError):
            return False

    def _check_twists(self, p: Any, places: Any) -> None:
        """Raise LinkageError if a torsion spring is twisted by more than half a turn at the start.

        Springs between bodies whose turns the freedoms count are not checked.
        """
        for name, spring in self.description.springs.items():
            bodies = () if name in self.motion.counted else self.interface.twisted_bodies(spring)
            if not bodies or not is_given(spring.free):
                continue
            one, other = (0.0 if b == GROUND else planar.turn_angle(getattr(places, f"{b}_frame").turn) for b in bodies)
            free, angle = getattr(p, f"{name}_free_angle"), remainder(other - one, tau)
            shorter = remainder(angle - free, tau)
            # an angle may be meant in (-pi, pi] or in [0, 2 pi)
            if min(abs(angle - free), abs(angle % tau - free)) > pi + 1e-9:
                raise LinkageError(
                    f"linkage.springs.{name}.free is {degrees(free):.6g} deg, and the angle at the start "
                    f"{degrees(angle):.6g} deg: as no freedom counts whole turns, the spring is twisted the shorter way, by "
                    f"{degrees(shorter):.6g} deg; set free to {degrees(angle - shorter):.6g} deg, or make the pin a freedom"
                )

    def _described_angles(self, equations: str) -> dict[str, float]:
        """Return the angles, in the described pose, of the springs of `Interface.centred_springs` (rad), by their names."""
        names = self.motion.centred
        if not names:
            return {}
        module: dict[str, Any] = {"__name__": self.description.name}
        exec(equations, module)
        known = {
            "cos": cos,
            "sin": sin,
            "self": SimpleNamespace(**{p.field: p.value for p in self.interface.parameters}),
        }
        p = module["Constants"](**{name: eval(text, known) for name, text in self.variables.constants().items()})
        x = (*(start.value for start in self.variables.starts), 0.0, 0.0)
        try:
            springs = module["springs"](module["places"](x, p), x, p)
        except (ValueError, ArithmeticError):
            return {}
        # rounded, so that the text of the package is the same on every machine
        return {name: round(getattr(springs, f"{name}_stretch"), 6) for name in names}

    def _equations(self) -> str:
        motion = self.motion
        blocks = [*motion.inputs(), *PoseWriter(self.interface).blocks(), motion.masses()]
        blocks += motion.springs() if self.description.springs else ()
        blocks += [*motion.applied_forces(), *motion.motion(), *motion.forces()]
        blocks += Contacts(motion).blocks() if self.description.friction else ()
        # the joint forces that are outputs are known only after motion.forces()
        self.outputs = Outputs(motion)
        inputs = [
            f"{d.table or d.name}.{own}"
            for d in self.interface.drives
            for own in (d.load, *(("speed", "acceleration") if d.table else ()))
        ]
        names = [*inputs, *(p.name for p in self.interface.parameters), *self.outputs.names()]
        for name in names:
            if names.count(name) > 1:
                of = name.partition(".")[0]
                raise LinkageError(
                    f"two variables would be called {name}: {of} of linkage.freedoms, linkage.bodies, linkage.springs or the "
                    "like must have another name"
                )
        scale = _error_scale(self.interface.drives, *length_and_mass(self.interface))
        body = "\n\n\n".join([*blocks, self.outputs.function(), scale, self.picture.positions()])
        return _EQUATIONS.format(
            name=self.description.name,
            state=", ".join((*(d.coordinate for d in self.interface.drives), *(d.rate for d in self.interface.drives))),
            imports=_imports(body),
            constants=indent_lines((f"{name}: float" for name in self.variables.constants()), end=""),
            body=body,
        )

    def _mechanism(self) -> str:
        d, v = self.description, self.variables
        joints, parts = self.picture.points_and_parts()
        title = d.title or d.name
        return _MECHANISM.format(
            name=d.name,
            title=title.replace('"', "'").replace("\\", "/"),
            rules=v.rules(),
            fields=indent_lines(v.fields(), end=""),
            values=indent_lines(v.constants().values(), 12),
            initial=indent_lines((f"{start.name}: float = {start.rest!r}" for start in v.starts), end=""),
            variables=indent_lines([*v.parameters(), *v.inputs(), *self.outputs.variables()]),
            quoted_name=quote(d.name),
            quoted_title=quote(title),
            fmu=quote("".join(part[:1].upper() + part[1:] for part in re.split(r"[^A-Za-z0-9]+", d.name))),
            notes=quote(f"Source: {d.source}."),
            started=", ".join(f"{start.name}={start.value!r}" for start in v.starts),
            driven=v.commanded_rates(),
            experiment=v.experiment(),
            origins=indent_lines(v.origins(), 16),
            source=quote(d.source),
            freedoms=indent_lines(v.freedoms(), 8),
            channels=indent_lines(v.channels(), 8),
            positions=indent_lines(map(quote, v.position_parameters()), 8),
            joints=indent_lines(
                (f"Joint({quote(j.name)}, {quote(j.text)}, {self.picture.drag_argument(j)})" for j in joints), 12
            ),
            parts=indent_lines(parts, 12),
            paths="".join(f"{quote(name)}, " for name in self.picture.paths()),
            links=indent_lines(v.links(), 8),
            rotation=self._greatest_rotation(),
            switch="rough" if d.friction else "",
        )

    def _greatest_rotation(self) -> str:
        """Write the `Mechanism.greatest_rotation`, the greatest change of an angle in one step of the integrator.

        In a step the ends of a spring with a force law turn by at most 10 deg relative to each other, and a body that carries a
        dyad by at most 20 deg, because the range in which the dyad can be assembled may be narrow.
        """
        springs = []
        for spring in self.description.springs.values():
            if spring.law:
                ends = [self.motion.owner(point) for point in spring.between] or self.interface.twisted_bodies(spring)
                springs.append(ends or self.structure.joints[spring.at].bodies)
        carried = [(GROUND, side.parent) for dyad in self.structure.dyads for side in dyad.sides]
        greatest = [inf]
        for n in range(len(self.interface.drives)):
            turned = rotations(self.description, self.structure, n)
            for most, pairs in ((10.0, springs), (20.0, carried)):
                for first, second in pairs:
                    ratio = abs(turned.get(second, 0.0) - turned.get(first, 0.0))
                    greatest.append(most / max(1.0, ratio if isfinite(ratio) else 1.0))
        return f"radians({min(greatest)!r})" if min(greatest) < inf else "inf"


def _imports(body: str) -> str:
    """Return the import lines that the text of the equations needs."""
    library = [name for name, value in vars(planar).items() if getattr(value, "__module__", "") == planar.__name__]
    wanted = {"math": WRITTEN, "typing": ("NamedTuple",), "linkwork.friction": _FRICTION, "linkwork.planar": library}
    found = []
    for module, names in wanted.items():
        used = [name for name in names if re.search(rf"\b{name}\b", body)]
        if used:
            found.append(
                f"from {module} import (\n{indent_lines(used)}\n)"
                if len(used) > 4
                else f"from {module} import {', '.join(used)}"
            )
    return "\n".join(found)


def _error_scale(drives: tuple[Drive, ...], length: float, mass: float) -> str:
    """Write the function that returns, for each component of the state, the magnitude below which its error is absolute."""
    squares = " + ".join(f"x[{len(drives) + k}] * x[{len(drives) + k}]" for k, d in enumerate(drives) if d.turns)
    coordinates = ", ".join("1.0" if d.turns else repr(length) for d in drives)
    rates = ", ".join("speed" if d.turns else f"{length!r} * speed" for d in drives)
    rows = (
        f"speed = sqrt(1.0 + {squares or '0.0'})",
        f"energy = {0.5 * mass * length * length!r} * speed * speed",
        f"return ({coordinates}, {rates}, energy, energy)",
    )
    doc = "Return magnitudes below which errors are absolute, from the size, the mass and the speed at the start."
    return function("error_scale(parameters: object, x: tuple[float, ...]) -> tuple[float, ...]", doc, rows)
