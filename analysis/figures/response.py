"""Plot branches of periodic motions over a parameter: amplitude, harmonics, errors of approximations, torque, forces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from shapely import LineString, distance
from shapely import points as make_points

from ..display import format_turns
from ..mechanisms import find_mechanism
from ..numerics.peaks import peaks
from ..periodic import (
    FORCE,
    TOLERANCE,
    AvoidedRange,
    Branch,
    Crossing,
    Family,
    FoldJump,
    Response,
    Risk,
    SpecialPoint,
    Stability,
    fold_jumps,
)
from ..units import display_scale
from ..youssef import Approximations
from .curves import Arrow, Curve, Label, Panel, Picture, Shade, drawn, register_picture
from .style import COLOURS, LINE, THIN, name_in_words

#: Line styles of the approximations, and of motions by their stability.
_LINES: tuple[Any, ...] = ("-.", ":", (0, (5, 1)))
_STABLE = {Stability.STABLE: "-", Stability.MARGINAL: ":", Stability.UNSTABLE: "--"}
#: Width of a figure and height of an ordinary panel (inches); heights of the first and second panel relative to it.
_SIZE, _MAIN, _HARMONICS = (7.6, 1.75), 2.4, 1.15

#: Greatest number of points of a branch at which approximations are compared with it; number of further points of their curves.
_COMPARED, _BESIDE = 240, 60
#: Distance (points) from another curve up to which a curve counts as hidden.
_HIDDEN = 1.5 * LINE
#: Relative error (%) that counts as zero; harmonic, relative to the greatest one, that counts as zero.
_NONE, _SMALL = 1e-3, 2e-5
#: Distance, as a share of the ranges of a panel, up to which a point lies on a line.
_ON = 2e-3
#: Least prominence of a peak that gets a text, relative to the height of the axis.
_STANDS_OUT = 0.005
#: Crossings closer than this share of the axis have one common text.
_CASCADE = 0.01
#: Number of letters along a branch.
_LETTERS = 7
#: Letters closer than this along both axes (points) overlap.
_LETTER = 11.0

FloatArray: TypeAlias = NDArray[np.float64]

#: Markers and short names of the points at which a multiplier crosses the unit circle.
_MARKERS = {
    Crossing.FOLD: ("s", "fold"),
    Crossing.BRANCH_POINT: ("o", "branch point"),
    Crossing.PERIOD_DOUBLING: ("D", "doubling"),
    Crossing.TORUS: ("^", "torus"),
}
_RISKS = tuple(Risk)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scale:
    """Units and names with which parameter and amplitude are shown.

    ``factor`` converts the parameter from SI to its display ``unit``. ``scale`` converts the amplitude from SI to its display
    unit ``shown``; ``what`` is the short name of the amplitude, ``name`` the long name, ``column`` the name
    in the columns of a branch.
    """

    family: Family
    factor: float
    unit: str
    scale: float
    shown: str
    what: str
    name: str
    column: str

    @property
    def axis(self) -> str:
        name = name_in_words(self.family.name)
        return f"{name} [{self.unit}]" if self.unit else name

    def place(self, value: float) -> str:
        """Return a value of the parameter in its display unit as text, to four digits; values from 1000 on as whole numbers."""
        number = self.factor * value
        return f"{number:.0f} {self.unit}" if abs(number) >= 1e3 else f"{number:.4g} {self.unit}".rstrip()

    def size(self, value: float) -> str:
        """Return an amplitude in its display unit as text, without the unit."""
        return f"{self.scale * value:.4g}"


def describe_branches(
    branches: Sequence[Branch],
    *,
    title: str = "",
    rpm: bool = True,
    beside: Callable[[FloatArray], Mapping[str, FloatArray]] | None = None,
    avoid: Sequence[AvoidedRange] = (),
    caution: str = "",
) -> Picture:
    """Plot amplitude, harmonics, crank torque and pin force along branches, stable parts solid, unstable ones dashed.

    At folds an arrow leads to the motion that the machine jumps to. A panel shows the relative errors of the approximations.
    An approximation that cannot be told apart from the true motion is drawn in this panel only.

    Parameters
    ----------
    branches : sequence of Branch
        Branches of one family.
    title : str
    rpm : bool
        Whether a speed in rad/s is drawn in rpm.
    beside : callable, optional
        ``beside(values)`` receives values of the parameter, shape (k,), and returns the amplitudes of each approximation in
        metres, shape (k,), by its name. The errors are relative to the stable motions with a period of one crank turn.
    avoid : sequence of AvoidedRange
        Ranges of the parameter to shade.
    caution : str
        Line above the legend on limits of the shaded ranges.
    """
    family, (what, si) = branches[0].family, branches[0].orbits[0].swing
    unit, factor = display_scale(family.unit) if rpm or family.unit != "rad/s" else (family.unit, 1.0)
    shown, scale = display_scale(si)
    outputs = (v for v in find_mechanism(family.parameters).variables if v.causality == "output")
    name = next((name_in_words(v.name) for v in outputs if v.symbol == what), name_in_words(what))
    look = _Scale(
        family=family, factor=factor, unit=unit, scale=scale, shown=shown, what=what, name=name, column=f"{what} [{si}]"
    )
    others = [] if beside is None else _evaluate_approximations(branches, beside)
    shades = [
        Shade(low=factor * a.low, high=factor * a.high, label=f"avoid: {a.risk.value}", number=_RISKS.index(a.risk))
        for a in avoid
    ]
    bare = [Shade(low=shade.low, high=shade.high, label="", number=shade.number) for shade in shades]
    amplitudes = replace(_amplitudes(branches, look, others, shades), legend=caution)
    panels = [amplitudes, *_other_amplitudes(branches, look, bare)]
    heights = [_MAIN, *[1.0] * (len(panels) - 1), _HARMONICS]
    panels.append(_harmonics(branches, look, bare))
    if others:
        panels.append(_errors(others, look, bare))
    panels += _loads(branches, look, bare)
    heights += [1.0] * (len(panels) - len(heights))
    return Picture(parts=panels, title=title, size=_SIZE, heights=heights)


plot_branches = drawn(describe_branches)


def _amplitudes(
    branches: Sequence[Branch], look: _Scale, others: Sequence[_Approximation], shades: Sequence[Shade]
) -> Panel:
    """Return the panel of the amplitude along all branches, with special points, jumps, and visible approximations."""
    # the scale is that of the true motion, as linear approximations have unbounded resonances
    top = 1.15 * max(look.scale * float(branch.amplitude.max()) for branch in branches)
    found = fold_jumps(branches)
    curves = _branch_curves(
        enumerate(branches), look, lambda branch: look.scale * branch.amplitude, hover=_hover_values
    )
    for branch in branches:
        if branch.periods > 1:
            colour = COLOURS[(branch.periods.bit_length() - 1) % len(COLOURS)]
            x, y = look.factor * branch.parameter, look.scale * branch.amplitude
            curves.append(_letters(x, y, str(branch.crank_turns), colour=colour))
    curves += _visible_approximations(others, branches, look, top)
    curves += _special_points(branches, look, found)
    labels = [label for branch in branches if branch.periods == 1 for label in _peaks(branch, look, top)]
    labels += [
        Label(x=look.factor * jump.parameter, y=look.scale * jump.before, text=_jump(jump, look)) for jump in found
    ]
    labels += _crossings(branches, look, top)
    short = "" if name_in_words(look.what) == look.name else f" {look.what}"
    return Panel(
        x_label=look.axis,
        y_label=f"amplitude of {look.name}{short} [{look.shown}]",
        curves=[*_legend_entries(branches), *curves],
        y_range=(0.0, top),
        legend_at="above",
        shades=shades,
        labels=labels,
        arrows=[
            Arrow(x=look.factor * jump.parameter, begin=look.scale * jump.before, end=look.scale * after)
            for jump in found
            for after in jump.after
        ],
    )


def _other_amplitudes(branches: Sequence[Branch], look: _Scale, shades: Sequence[Shade]) -> list[Panel]:
    """Return the panels of the amplitudes of the other free coordinates, if there are any."""
    panels = []
    for number, (what, si) in enumerate(branches[0].orbits[0].swings[1:], start=1):
        unit, scale = display_scale(si)
        curves = _branch_curves(enumerate(branches), look, lambda b, n=number, s=scale: s * b.amplitudes[:, n])  # type: ignore[misc]
        panels.append(
            Panel(
                x_label=look.axis, y_label=f"amplitude\nof {name_in_words(what)} [{unit}]", curves=curves, shades=shades
            )
        )
    return panels


def _jump(jump: FoldJump, look: _Scale) -> str:
    """Return the text at a fold: on which side of the fold the motion exists, and to which amplitude the machine jumps."""
    side, change = ("below", "rising") if jump.direction > 0 else ("above", "falling")
    there = f"{look.size(jump.before)} {look.shown} only {side} {look.place(jump.parameter)};\n{change}, it "
    if not jump.after:
        return there + "ends here"
    sizes = " or ".join(look.size(after) for after in jump.after)
    return f"{there}jumps to {sizes} {look.shown}"


def _peaks(branch: Branch, look: _Scale, top: float) -> list[Label]:
    """Return labels with speed and amplitude for the prominent stable peaks of a branch; the y axis ends at ``top``."""
    x, y = branch.parameter, look.scale * branch.amplitude
    found = [n for n, prominence in peaks(y) if prominence >= _STANDS_OUT * top]
    labels = []
    for n in (n for n in found if not _unstable_mask(branch)[n]):
        # the vertex of the parabola through three points
        near = x[n - 1 : n + 2] - x[n]
        bend, slope, height = np.polyfit(near, y[n - 1 : n + 2], 2)
        place, tall = (x[n] - 0.5 * slope / bend, height - 0.25 * slope**2 / bend) if bend < 0.0 else (x[n], y[n])
        labels.append(Label(x=look.factor * place, y=tall, text=f"peak, {look.place(place)}: {tall:.4g} {look.shown}"))
    return labels


def _crossings(branches: Sequence[Branch], look: _Scale, top: float) -> list[Label]:
    """Return labels for the special points, apart from folds, that a machine reaches; the y axis ends at ``top``.

    Points close together have one common label.
    """
    # a point on two branches, or passed twice, is named once
    met = {
        (special.kind, look.place(special.parameter)): special
        for branch in branches
        for special in branch.special
        if special.kind is not Crossing.FOLD and _is_reachable(branch, special)
    }
    width = float(np.ptp(np.concatenate([branch.parameter for branch in branches])))
    groups: list[list[SpecialPoint]] = []
    for special in sorted(met.values(), key=lambda s: (s.kind.value, s.parameter)):
        first = groups[-1][0] if groups else special
        near = abs(special.parameter - first.parameter) < _CASCADE * width
        level = look.scale * abs(special.orbit.amplitude - first.orbit.amplitude) < 5.0 * _CASCADE * top
        if groups and special.kind is first.kind and near and level:
            groups[-1].append(special)
        else:
            groups.append([special])
    labels = []
    for group in groups:
        middle, name = group[len(group) // 2], _MARKERS[group[0].kind][1]
        text = f"{name}, {look.place(middle.parameter)}"
        if len(group) > 1:
            low, high = (look.place(special.parameter) for special in (group[0], group[-1]))
            plural = "tori" if name == "torus" else f"{name}s"
            text = f"{len(group)} {plural},\n{low.removesuffix(look.unit).rstrip()} to {high}"
        labels.append(Label(x=look.factor * middle.parameter, y=look.scale * middle.orbit.amplitude, text=text))
    return labels


def _is_reachable(branch: Branch, special: SpecialPoint) -> bool:
    """Return whether a motion beside a special point is stable, so that a machine can reach the point."""
    return any(orbit.largest <= 1.0 + TOLERANCE for orbit in branch.orbits[special.after : special.after + 2])


def _branch_curves(
    numbered: Iterable[tuple[int, Branch]],
    look: _Scale,
    quantity: Callable[[Branch], FloatArray],
    hover: Callable[[Branch, int], Mapping[str, ArrayLike]] | None = None,
    **options: Any,
) -> list[Curve]:
    """Return the curves of a quantity (display units) along branches with their numbers.

    Where two unstable branches coincide only the first is drawn: two dashed lines would fill each other's gaps.
    """
    curves: list[Curve] = []
    numbers, branches = zip(*numbered)
    values = [quantity(branch) for branch in branches]
    places = [look.factor * branch.parameter for branch in branches]
    found = [v[np.isfinite(v)] for v in map(np.concatenate, (places, values))]
    sizes = [float(np.ptp(v)) or 1.0 if len(v) else 1.0 for v in found]
    drawn: list[LineString] = []
    for number, branch, y in zip(numbers, branches, values):
        if hover is not None:
            options["hover"] = hover(branch, number)
        for curve in _stability_curves(branch, number, look, y, **options):
            if curve.line == _STABLE[Stability.UNSTABLE]:
                shown = np.array(curve.y)
                points = np.column_stack([curve.x, shown]) / sizes
                finite = np.isfinite(shown)
                for line in drawn:
                    shown[finite] = np.where(distance(make_points(points[finite]), line) < _ON, np.nan, shown[finite])
                runs = np.ma.clump_unmasked(np.ma.masked_invalid(shown))  # type: ignore[no-untyped-call]
                drawn += [LineString(points[run]) for run in runs if run.stop - run.start > 1]
                curve = replace(curve, y=shown)
            curves.append(curve)
    return curves


def _stability_curves(branch: Branch, number: int, look: _Scale, y: FloatArray, **options: Any) -> list[Curve]:
    """Return the curves of a quantity ``y`` (display units) along a branch, one for each kind of stability.

    The colour shows the period. ``number`` is the index of the branch.
    """
    words = _stability_words(branch)
    order = branch.periods.bit_length() - 1
    style: dict[str, Any] = {"colour": COLOURS[order % len(COLOURS)], "order": 2.0 + 0.1 * order}
    style["hover"] = {"branch": np.full(len(branch), number + 1), "stability": words}
    curves = []
    for stability, line in _STABLE.items():
        part = words == stability.value
        if not part.any() and stability is Stability.MARGINAL:
            continue
        if stability is not Stability.STABLE:
            # a part reaches to the first point of the next, so that there is no gap between them
            part = part | np.append(part[1:], False) | np.insert(part[:-1], 0, False)
        x = look.factor * branch.parameter
        curves.append(Curve(x=x, y=np.where(part, y, np.nan), line=line, **style | options))
    return curves


def _hover_values(branch: Branch, number: int) -> Mapping[str, ArrayLike]:
    """Return the arrays, by name, that an HTML page shows under the pointer along the branch with index ``number``."""
    table, torque = branch.columns(), "greatest crank torque [N.m]"
    return {
        "branch": np.full(len(branch), number + 1),
        "turns in a period": np.full(len(branch), branch.crank_turns),
        "stability": _stability_words(branch),
        "largest multiplier": branch.largest_multiplier,
    } | ({torque: table[torque]} if torque in table else {})


def _letters(x: FloatArray, y: FloatArray, text: str, *, shift: float = 0.0, **options: Any) -> Curve:
    """Return letters at a few points of a curve, evenly along x; ``shift`` moves the letters by a share of their spacing."""
    finite = np.flatnonzero(np.isfinite(y))
    if len(finite):
        places = np.linspace(x[finite].min(), x[finite].max(), 2 * _LETTERS + 1)[1::2]
        places = places + shift * np.ptp(x[finite]) / _LETTERS
        finite = np.unique([finite[np.abs(x[finite] - place).argmin()] for place in places])
    return Curve(x=x[finite], y=y[finite], line="", marker=f"${text}$", order=3.0, **options)


def _special_points(branches: Sequence[Branch], look: _Scale, found: Sequence[FoldJump]) -> list[Curve]:
    """Return the special points of all branches as markers, one curve per kind."""
    curves = []
    style: dict[str, Any] = {"colour": "black", "line": "", "hollow": True, "order": 4.0}
    says = {jump.parameter: _jump(jump, look).replace("\n", " ") for jump in found}
    for kind, (marker, _) in _MARKERS.items():
        those = [(n, b, s) for n, b in enumerate(branches, start=1) for s in b.special if s.kind is kind]
        if those:
            hover: dict[str, ArrayLike] = {
                "branch": [n for n, _, _ in those],
                "turns in a period": [b.crank_turns for _, b, _ in those],
                "largest multiplier": [s.orbit.largest for _, _, s in those],
                "here": [says.get(s.parameter, "") if kind is Crossing.FOLD else "" for _, _, s in those],
            }
            x = [look.factor * s.parameter for _, _, s in those]
            y = [look.scale * s.orbit.amplitude for _, _, s in those]
            curves.append(Curve(x=x, y=y, label=kind.value, marker=marker, hover=hover, **style))
    return curves


def _legend_entries(branches: Sequence[Branch]) -> list[Curve]:
    """Return the legend entries of stability and, if the periods differ, of the period, as curves without points."""
    turns = sorted({(branch.periods, branch.crank_turns) for branch in branches})
    words = {str(word) for branch in branches for word in _stability_words(branch)}
    keys = []
    for n, shown in turns if len(turns) > 1 else []:
        colour, marker = COLOURS[(n.bit_length() - 1) % len(COLOURS)], "" if n == 1 else f"${shown}$"
        keys.append(Curve(x=[], y=[], colour=colour, label=f"period of {format_turns(shown)}", marker=marker))
    colour = "0.3" if len(turns) > 1 else COLOURS[0]
    keys += [
        Curve(x=[], y=[], colour=colour, line=line, label=f"{word.value} motion")
        for word, line in _STABLE.items()
        if word.value in words
    ]
    return keys


@dataclass(frozen=True, slots=True, kw_only=True)
class _Approximation:
    """Amplitudes of an approximation at values of the parameter, both of shape (k,), and errors of the approximation.

    ``errors`` has an array (3, n) for each branch of motions with a period of one turn; its rows are parameter, relative error
    (%) and true amplitude, with NaN at gaps.
    """

    name: str
    number: int
    parameter: FloatArray
    amplitude: FloatArray
    errors: Sequence[FloatArray]

    @property
    def look(self) -> dict[str, Any]:
        """Return colour and line style of the curve."""
        return {"colour": COLOURS[(self.number + 1) % len(COLOURS)], "line": _LINES[self.number % len(_LINES)]}


def _evaluate_approximations(
    branches: Sequence[Branch], beside: Callable[[FloatArray], Mapping[str, FloatArray]]
) -> list[_Approximation]:
    """Evaluate the approximations at stable motions of one crank turn, and evenly over the range of the parameter."""
    chosen = [(branch, _comparison_points(branch)) for branch in branches if branch.periods == 1]
    every = np.concatenate([branch.parameter for branch, _ in chosen])
    spread = np.linspace(every.min(), every.max(), _BESIDE)
    places = np.unique(np.concatenate([spread, *(branch.parameter[i] for branch, i in chosen)]))
    approximations = []
    for number, (name, values) in enumerate(beside(places).items()):
        errors = []
        for branch, i in chosen:
            own, true = values[np.searchsorted(places, branch.parameter[i])], branch.amplitude[i]
            # no line across unstable motions
            gaps = np.flatnonzero(np.diff(np.cumsum(_unstable_mask(branch))[i])) + 1
            error = 100.0 * np.abs(own / true - 1.0)
            errors.append(np.insert(np.array([branch.parameter[i], error, true]), gaps, np.nan, axis=1))
        approximations.append(
            _Approximation(name=name, number=number, parameter=places, amplitude=values, errors=errors)
        )
    return approximations


def _stability_words(branch: Branch) -> NDArray[np.str_]:
    """Return the stability of each point of a branch as a word."""
    margin = 1.0 - branch.largest_multiplier
    return np.select(
        [margin > TOLERANCE, margin < -TOLERANCE],
        [Stability.STABLE.value, Stability.UNSTABLE.value],
        Stability.MARGINAL.value,
    )


def _unstable_mask(branch: Branch) -> NDArray[np.bool_]:
    return np.asarray(branch.largest_multiplier > 1.0 + TOLERANCE)


def _comparison_points(branch: Branch) -> NDArray[np.int64]:
    """Return the indices of points at even distances along the drawn curve of a branch, without unstable motions."""
    steps = [np.diff(v, prepend=v[0]) / (float(np.ptp(v)) or 1.0) for v in (branch.parameter, branch.amplitude)]
    way = np.cumsum(np.hypot(*steps))
    chosen = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], _COMPARED)))
    return chosen[~_unstable_mask(branch)[chosen]]


def _visible_approximations(
    others: Sequence[_Approximation], branches: Sequence[Branch], look: _Scale, top: float
) -> list[Curve]:
    """Return the curves of the approximations that differ visibly from the true motion in a figure of usual size.

    The y axis ends at ``top``.
    """
    if not others:
        return []
    x = look.factor * others[0].parameter
    points = 72.0 * 0.85 * np.array([_SIZE[0], _MAIN * _SIZE[1]]) / (float(np.ptp(x)) or 1.0, top)
    true = [
        points * np.column_stack([look.factor * b.parameter, look.scale * b.amplitude])
        for b in branches
        if b.periods == 1
    ]
    curves = []
    for other in others:
        y = look.scale * other.amplitude
        seen = points * np.column_stack([x, y])[y < top]
        apart = [distance(LineString(line), make_points(seen)) for line in true if len(line) > 1]
        if len(seen) and apart and np.min(apart, axis=0).max() > _HIDDEN:
            curves.append(Curve(x=x, y=y, label=f"approximation, {other.name}", order=1.5, **other.look))
    return curves


def _harmonics(branches: Sequence[Branch], look: _Scale, shades: Sequence[Shade]) -> Panel:
    """Return the panel of the lowest harmonics of motions with a period of one crank turn, with the orders along the curves."""
    single = [(n, branch) for n, branch in enumerate(branches) if branch.periods == 1] or list(enumerate(branches))
    names = [n for n in branches[0].columns() if n.startswith("harmonic ") and n.endswith(f" of {look.column}")]
    tops = [float(np.nanmax(branch.columns()[name], initial=0.0)) for _, branch in single for name in names]
    top = look.scale * max(tops, default=0.0)
    least = top
    curves: list[Curve] = []
    letters: list[Curve] = []
    for order, name in enumerate(names):
        options: dict[str, Any] = {"colour": COLOURS[order % len(COLOURS)], "width": THIN}
        label = f"harmonic {order + 1}"

        def size(branch: Branch, name: str = name) -> FloatArray:
            y = look.scale * branch.columns()[name]
            # smaller harmonics are rounding
            return np.where(y > _SMALL * top, y, np.nan)

        curves += _branch_curves(single, look, size, **options)
        for _, branch in single:
            y = size(branch)
            least = min(least, float(np.nanmin(y, initial=np.inf)))
            x = look.factor * branch.parameter
            # the letters of different harmonics are shifted, as their curves may be near each other
            shift = (order + 1.0) / (len(names) + 1.0) - 0.5
            stable = np.where(_unstable_mask(branch), np.nan, y)
            if np.isfinite(stable).any():
                letters.append(_letters(x, stable, str(order + 1), shift=shift, label=label, **options))
                label = ""
    y_range = (0.5 * least, 2.0 * top) if top > 0.0 else None
    if y_range:
        width = look.factor * float(np.ptp(np.concatenate([branch.parameter for _, branch in single])))
        curves += _without_overlaps(letters, width, y_range[1] / y_range[0])
    turns = f",\n{format_turns(single[0][1].crank_turns)} " if len(single) < len(branches) else "\n"
    return Panel(
        x_label=look.axis,
        y_label=f"harmonics of {look.what}{turns}[{look.shown}]",
        curves=curves,
        logarithmic="y",
        y_range=y_range,
        legend_at="above",
        shades=shades,
    )


def _without_overlaps(letters: Sequence[Curve], width: float, ratio: float) -> list[Curve]:
    """Return letters without those that overlap others.

    ``width`` is the range of the panel's x axis, ``ratio`` the quotient of the ends of its logarithmic y axis.
    """
    points = 72.0 * 0.85 * np.array([_SIZE[0], 0.75 * _HARMONICS * _SIZE[1]]) / (width or 1.0, np.log(ratio))
    taken: list[FloatArray] = []
    kept = []
    for curve in letters:
        places = points * np.column_stack([curve.x, np.log(np.asarray(curve.y, dtype=float))])
        free = [not taken or float(np.abs(taken - place).max(axis=1).min()) > _LETTER for place in places]
        taken += list(places[free])
        kept.append(replace(curve, x=np.asarray(curve.x)[free], y=np.asarray(curve.y)[free]))
    return kept


def _errors(others: Sequence[_Approximation], look: _Scale, shades: Sequence[Shade]) -> Panel:
    """Return the panel of the errors of approximations relative to the stable one-turn motions (%)."""
    curves = [
        Curve(
            x=look.factor * parameter,
            y=error,
            label="" if n else other.name,
            hover={f"amplitude of the true motion [{look.shown}]": look.scale * true},
            **other.look,
        )
        for other in others
        for n, (parameter, error, true) in enumerate(other.errors)
    ]
    worst = max((float(np.nanmax(error, initial=0.0)) for o in others for _, error, _ in o.errors), default=0.0)
    return Panel(
        x_label=look.axis,
        y_label="relative error of\nthe amplitude [%]",
        curves=curves,
        logarithmic="y",
        y_range=(_NONE, max(2.0 * worst, 10.0 * _NONE)),
        legend_at="above",
        shades=shades,
    )


def _loads(branches: Sequence[Branch], look: _Scale, shades: Sequence[Shade]) -> list[Panel]:
    """Return the panels of crank torque and joint forces along the branches, if there are any and they are not all zero."""
    names = list(branches[0].columns())
    torque, forces = "greatest crank torque [N.m]", [name for name in names if name.startswith(FORCE)]
    rows: dict[str, Callable[[Branch], FloatArray]] = {}
    if torque in names:
        rows["greatest crank\ntorque [N.m]"] = lambda b: b.columns()[torque]
    if forces:
        kind = "pin" if all(name.startswith(f"{FORCE}pin ") for name in forces) else "joint"
        rows[f"greatest\n{kind} force [N]"] = lambda b: np.max([b.columns()[n] for n in forces], axis=0)
    return [
        Panel(
            x_label=look.axis,
            y_label=label,
            curves=_branch_curves(enumerate(branches), look, quantity),
            logarithmic="y",
            shades=shades,
        )
        for label, quantity in rows.items()
        if any(np.any(quantity(branch) > 0.0) for branch in branches)
    ]


@register_picture
def plot_branch(branch: Branch, *, title: str = "") -> Picture:
    """Plot amplitude, harmonics, crank torque and pin force of one branch over its parameter, with its special points.

    Ranges to avoid are shaded.
    """
    low, high = float(branch.parameter.min()), float(branch.parameter.max())
    alone = Response(branches=(branch,), low=low, high=high, problems=())
    return describe_branches([branch], title=title, avoid=alone.speeds_to_avoid, caution=alone.caution)


@register_picture
def plot_response(
    response: Response, *, title: str = "", rpm: bool = True, beside: Approximations | None = None
) -> Picture:
    """Plot all branches of a response with shaded ranges to avoid and classical approximations; see `plot_branches`."""
    return describe_branches(
        response.branches,
        title=title,
        rpm=rpm,
        beside=None if beside is None else beside.at,
        avoid=response.speeds_to_avoid,
        caution=response.caution,
    )
