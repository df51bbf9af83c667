"""Report, for `linkwork resonance`, which parameters move the special points of a response most."""

from __future__ import annotations

from collections.abc import Iterator
from math import nan
from pathlib import Path
from typing import Any

from linkwork.errors import LinkworkError

from .common import note, say, show_table
from .driven import swing_unit

#: Greatest number of parameters that are printed for each point.
_NAMED = 4


def report_sensitivity(response: Any, factor: float, unit: str, path: str) -> list[Path]:
    """Print the parameters that move each special point and its amplitude most; write all elasticities to a table.

    The parameter of the response is printed in ``unit``; ``factor`` is the factor from SI to it. The table at ``path`` has one
    row for each special point, in the order in which the points are printed. Return its path, or no path if no special point
    has a gradient.
    """
    from ..files import write_csv
    from ..periodic import gradient_names, parameter_value, special_gradient

    family = response.family
    operation = family.parameters, family.drive
    # elasticities of a parameter that is zero are zero
    names = [
        name for name in gradient_names(*operation) if name != family.vary and parameter_value(*operation, name) != 0.0
    ]
    orbit = response.branches[0].orbits[0]
    alone = len(orbit.swings) == 1
    rows, shown = [], []
    for word, point in _response_points(response):
        try:
            found = special_gradient(family, point, names)
        except LinkworkError as error:
            note(f"the {word} at {family.format_value(point.parameter)} has no gradient: {error}")
            continue
        place, amplitude = found.place, found.amplitude
        number = getattr(point, "coordinate", 0)
        what, size, length = swing_unit(orbit, number)
        at, high = factor * place.value, size * amplitude.value
        sizes = [high] if alone else [float(number + 1), amplitude.value]
        rows.append([at, *sizes, *_elasticities(place), *_elasticities(amplitude)])
        of_text = f"{high:.3f}" if alone else f"{high:.4g} {length} of {what}"
        shown.append((word, f"{at:.2f}", _movers_text(place), of_text, _movers_text(amplitude)))
    if not rows:
        say("no special point has a gradient that would show what moves it")
        return []
    what, _, length = swing_unit(orbit)
    last = (f"amplitude [{length}]", f"amplitude of {what} there") if alone else ("amplitude", "the amplitude there")
    headings = ["", f"at [{unit}]", f"its place: {family.name}", *last]
    title = "parameters that move it most: percent per percent of the parameter"
    show_table(title, headings, shown)
    first = [f"amplitude of {what} [{length}]"] if alone else ["number of the free coordinate [1]", "amplitude [SI]"]
    headings = [f"at [{unit}]", *first]
    headings += [f"{quantity} by {name} [%/%]" for quantity in ("place", "amplitude") for name in names]
    return [write_csv(path, dict(zip(headings, zip(*rows))))]


def _response_points(response: Any) -> Iterator[tuple[str, Any]]:
    extrema = [("maximum", e) for e in response.maxima()] + [("minimum", e) for e in response.minima()]
    special = [(s.kind.value, s) for branch in response.branches for s in branch.special]
    yield from sorted(extrema + special, key=lambda entry: entry[1].parameter)


def _elasticities(gradient: Any) -> list[float]:
    """Return the elasticities; NaN for a quantity that is 0, such as the amplitude of a pendulum that hangs still."""
    return list(gradient.elasticities.values()) if gradient.value else [nan] * len(gradient.names)


def _movers_text(gradient: Any) -> str:
    if not gradient.value:
        return ""
    shares = gradient.elasticities
    return "\n".join(f"{name} {shares[name]:+.3g}" for name in gradient.movers(_NAMED))
