"""Masses of links: compute them from the ``section`` of a link, and tell where the masses of a case come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import atan2, hypot, isclose
from typing import Any, NamedTuple

from linkwork.errors import ParameterError
from linkwork.mechanism import Link, Mechanism, PublishedSet
from linkwork.parameters import field_name

from ..files import Kinds, Quantity, unknown_name
from ..linkages import SECTIONS, LinkBody, format_millimetres
from ..mechanisms import Parameters, find_mechanism
from ..sections import Section
from .arguments import takes_published


class Mass(NamedTuple):
    """A mass of a case, and where it comes from.

    Attributes
    ----------
    name : str
        Name of the FMI parameter.
    value : float
        Mass (kg).
    origin : str
        Where the value comes from, such as ``"of table-3.1"``.
    stale : str
        Text that names the values kept from the published set although the link has another length than in the set; else empty.
    """

    name: str
    value: float
    origin: str
    stale: str = ""


def _values(
    link: Link, units: Mapping[str, str], made: LinkBody, length: float, mass: float | None
) -> dict[str, float]:
    """Return mass, moment of inertia and centre of mass of a link with the body ``made`` (SI), by parameter names.

    ``mass`` is the weighed mass; None if the mass follows from the body.
    """
    own, (x, y), inertia = made.properties(length)
    if mass is not None:  # weighed: the shape, and so the radius of gyration, is that of the section
        own, inertia = mass, inertia * mass / own
    if link.about_pin:
        inertia += own * (x * x + y * y)
    if len(link.centre) == 1:
        if abs(y) > 1e-9 * length:
            wanted = "have its centre of mass on the line of the pins"
            raise ParameterError(f"{link.name}.section", f"a plate whose centre is {y:g} m off", wanted)
        centre: tuple[float, ...] = (x,)
    elif units[link.centre[1]] == "rad":
        centre = (hypot(x, y), atan2(y, x))
    else:
        centre = (x, y)
    return {link.mass: own, link.inertia: inertia, **dict(zip(link.centre, centre))}


@takes_published()
def with_sections(parameters: Parameters, **sections: Section) -> Parameters:
    """Return parameters with masses, centres of mass and moments of inertia of links computed from their sections.

    Parameters
    ----------
    parameters : parameters of a mechanism
        The lengths of the links are kept.
    **sections
        Sections by link, such as ``coupler=Bar("20 mm", "5 mm", "steel")``; see `analysis.sections`.

    Raises
    ------
    UnknownNameError
        If the mechanism has no such link.
    """
    mechanism = find_mechanism(parameters)
    links = {link.name: link for link in mechanism.links}
    units = {v.name: v.unit for v in mechanism.mechanism_variables.values()}
    for name, section in sections.items():
        if name not in links:
            raise unknown_name(name, links, f"link {name!r} of the {mechanism.name}")
        length = getattr(parameters, field_name(links[name].length))
        values = _values(links[name], units, LinkBody(section, ""), length, None)
        parameters = replace(parameters, **{field_name(key): value for key, value in values.items()})
    return parameters


def _section_entries(link: Link, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a link's section from ``flat``, a file's values by dotted name; empty if it has no section."""
    head = f"{link.name}.section"
    if head in flat:
        raise ParameterError(head, flat[head], f"be a table with a kind, of {', '.join(SECTIONS)}")
    return {name.removeprefix(f"{head}."): value for name, value in flat.items() if name.startswith(f"{head}.")}


def resolve_sections(mechanism: Mechanism, flat: Mapping[str, Any], base: Parameters | None) -> dict[str, Any]:
    """Return the values of a file, by dotted name, with sections of links replaced by masses, centres and inertias.

    A mass given in addition to a section is taken as weighed: centre and radius of gyration are still those of the section.
    ParameterError is raised if a section is wrong, or a centre or an inertia is given in addition to a section.
    """
    result = dict(flat)
    units = {v.name: v.unit for v in mechanism.mechanism_variables.values()}
    for link in mechanism.links:
        table = _section_entries(link, flat)
        if not table:
            continue
        head = f"{link.name}.section"
        for name in (link.inertia, *link.centre):
            if name in flat:
                raise ParameterError(name, flat[name], f"not come together with {head}, from which it follows")
        made = Kinds(SECTIONS)(table, head)
        result = {name: value for name, value in result.items() if not name.startswith(f"{head}.")}
        if link.length in flat:
            length = Quantity("m", above=0.0)(flat[link.length], link.length)
        elif base is not None:
            length = getattr(base, field_name(link.length))
        else:
            continue  # the reader of the parameters asks for the length
        mass = Quantity("kg", above=0.0)(flat[link.mass], link.mass) if link.mass in flat else None
        result |= _values(link, units, made, length, mass)
    return result


def mass_origins(
    parameters: Parameters, flat: Mapping[str, Any], known: PublishedSet | None = None, source: str = ""
) -> tuple[Mass, ...]:
    """Return the masses of a case, each with the origin of its value.

    Parameters
    ----------
    parameters : parameters of a mechanism
    flat : mapping
        Values that the case gives, by dotted name, before `resolve_sections`.
    known : PublishedSet, optional
        Published set from which the case takes its other values.
    source : str
        Name of this set.
    """
    mechanism = find_mechanism(parameters)
    links = {link.mass: link for link in mechanism.links}
    base = None if known is None else known.parameters
    get = partial(getattr, parameters)
    found = []
    for name, variable in mechanism.mechanism_variables.items():
        if variable.unit != "kg":
            continue
        link, stale = links.get(name), ""
        table = {} if link is None else _section_entries(link, flat)
        if table:
            origin = Kinds(SECTIONS)(table, name).origin(name in flat)
        elif name in flat:
            origin = "as given"
        elif known is None:
            origin = "zero where nothing is given"
        else:
            origin = known.origins.get(name, f"of {source}")
        if link is not None and base is not None and not table:
            length, own = get(field_name(link.length)), getattr(base, field_name(link.length))
            kept = [n for n in (link.mass, *link.centre[:1], link.inertia) if n not in flat]
            if kept and not isclose(length, own):
                now, then = format_millimetres(length), format_millimetres(own)
                verb = "stays" if len(kept) == 1 else "stay"
                stale = f"{link.length} is {now} where {source} has {then}, whose {', '.join(kept)} {verb}"
        found.append(Mass(name, get(field_name(name)), origin, stale))
    return tuple(found)


def trace_masses(parameters: Parameters) -> tuple[Mass, ...]:
    """Return the masses of a mechanism, each with the origin of its value.

    Values equal to those in the most similar published set are attributed to this set; all others count as given. If only
    zeros are equal, all masses count as given.

    Raises
    ------
    InputError
        If the parameters are not those of a mechanism.
    """
    mechanism = find_mechanism(parameters)
    own = {name: getattr(parameters, field_name(name)) for name in mechanism.mechanism_variables}

    def others(known: PublishedSet) -> dict[str, Any]:
        return {name: value for name, value in own.items() if value != getattr(known.parameters, field_name(name))}

    source, known = min(mechanism.published.items(), key=lambda item: len(others(item[1])))
    changed = others(known)
    masses = [name for name, variable in mechanism.mechanism_variables.items() if variable.unit == "kg"]
    if not any(own[name] for name in masses if name not in changed):  # equal zeros prove nothing
        changed = own
    return mass_origins(parameters, changed, known, source)


def describe_masses(masses: tuple[Mass, ...]) -> tuple[str, list[str]]:
    """Return a sentence with all masses and their origins, and a warning for each mass that is ``stale``.

    >>> describe_masses((Mass("crank.mass", 0.1, "as given"), Mass("slider.mass", 0.6, "as given")))[0]
    'masses: crank.mass 0.1 kg, slider.mass 0.6 kg (as given)'
    """
    by_origin: dict[str, list[str]] = {}
    for mass in masses:
        by_origin.setdefault(mass.origin, []).append(f"{mass.name} {mass.value:.4g} kg")
    sentence = "masses: " + "; ".join(f"{', '.join(names)} ({origin})" for origin, names in by_origin.items())
    warnings = [f"{mass.stale}: give them, or {mass.name.rpartition('.')[0]}.section" for mass in masses if mass.stale]
    return sentence, warnings
