"""Run the experiments that an FMU contains (inputs, parameters and reference results) and compare the results.

The file ``extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml`` lists the experiments, as the layered standard FMI-LS-REF
(https://github.com/modelica/fmi-ls-ref, tag v1.0.0-beta.1) requires. Their format is that of
https://github.com/modelica/ma-hs-experiments.
"""

from __future__ import annotations

import csv
import os
import posixpath
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import LinkworkError

from ..files import check_fmu, first_line
from .component import FOLDER
from .fmu import CosimulationError, read_description

STANDARD = "org.fmi-standard.fmi-ls-ref"
EXPERIMENTS = f"extra/{STANDARD}"
MANIFEST = f"{EXPERIMENTS}/fmi-ls-manifest.xml"
#: Type of Linkwork's annotation for the largest relative difference that an experiment allows.
ALLOWED = "org.linkwork.allowed"
#: Difference that is allowed without this annotation: the first number times the experiment's tolerance, but at least the
#: second number; the third number if the experiment has no tolerance.
_FACTOR, _LEAST_ALLOWED, _DEFAULT_ALLOWED = 100.0, 1e-6, 1e-3
#: Smallest scale of a variable's differences, as a fraction of the largest magnitude of variables with the same unit.
_LEAST_SCALE = 1e-3


class ExperimentError(LinkworkError):
    """Error for experiments in an FMU that cannot be read or run."""


def unpacking_folder() -> str:
    """Return a folder in which to unpack any FMU: the temporary folder, or another one if PythonFMU cannot read its name.

    An FMU receives the URI of its folder. PythonFMU's library decodes only "%20" in the URI; if it then does not find its
    files, it ends the process. Linkwork's own Python FMUs have a guard against this.

    Raises
    ------
    CosimulationError
        If there is no such folder.
    """
    here = tempfile.gettempdir()
    others = ("/tmp", "/var/tmp") if os.name == "posix" else (os.environ.get("PUBLIC"), "C:/Windows/Temp")
    for folder in (here, *others):
        if folder and os.access(folder, os.W_OK) and not re.search("%(?!20)", Path(folder).absolute().as_uri()):
            return folder
    raise CosimulationError(
        f"an FMU cannot be unpacked in {here}: PythonFMU's library reads only letters from a to z, digits, spaces and - . _ ~ "
        "in a folder's name; set TMPDIR to another folder"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """An experiment of an FMU; an attribute that the file does not give is None or empty.

    Attributes
    ----------
    name, description : str
    start, stop, step : float or None
        Times (s).
    tolerance : float or None
        Relative tolerance of the solver.
    allowed : float or None
        Largest relative difference from the reference that the FMU allows.
    parameters : mapping
        Values of parameters by name, as texts.
    stimuli, reference : structured ndarray or None
        Inputs and reference results: a column of times (s), then a column for each variable by its name.
    """

    name: str
    description: str = ""
    start: float | None = None
    stop: float | None = None
    step: float | None = None
    tolerance: float | None = None
    allowed: float | None = None
    parameters: Mapping[str, str]
    stimuli: NDArray[Any] | None = None
    reference: NDArray[Any] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Largest difference of a variable from its reference: its time (s), both values, and the relative difference."""

    name: str
    unit: str
    time: float
    value: float
    reference: float
    relative: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Result of an experiment: deviations of all variables, largest first; the allowed deviation; a message if it failed."""

    experiment: str
    description: str
    interface: str
    deviations: tuple[Deviation, ...]
    allowed: float
    message: str = ""

    @property
    def passed(self) -> bool:
        """Return whether the run reached its end and the deviation of every variable is within the allowed one."""
        return not self.message and all(d.relative <= self.allowed for d in self.deviations)


def read_experiments(fmu: str | Path) -> tuple[Experiment, ...]:
    """Read the experiments that an FMU contains.

    Raises
    ------
    InputError
        If the file is not an FMU.
    ExperimentError
        If the FMU has no experiments, or they cannot be read.
    """
    check_fmu(fmu)
    with ZipFile(fmu) as archive:
        if MANIFEST not in archive.namelist():
            raise ExperimentError(f"{fmu} has no experiments: there is no {MANIFEST} in it (FMI-LS-REF)")
        reader = _Reader(fmu, archive)
        found = [
            experiment
            for related in reader.xml(MANIFEST).iter("Related")
            if related.get("role", "").partition("/")[0] == "experiment"
            for experiment in reader.experiments(reader.place(MANIFEST, related))
        ]
    if not found:
        raise ExperimentError(f"{fmu} has no experiments: {MANIFEST} names none")
    return tuple(found)


class _Reader:
    """Reader of an FMU's manifest and of the files that it names."""

    def __init__(self, fmu: str | Path, archive: ZipFile) -> None:
        self.fmu, self.archive, self.names = fmu, archive, set(archive.namelist())

    def place(self, base: str, node: ElementTree.Element) -> str:
        """Return the path in the archive of the file that the ``source`` of ``node`` names, relative to the file ``base``."""
        source = node.get("source", "")
        parts = urlsplit(source)
        place = posixpath.normpath(posixpath.join(posixpath.dirname(base), unquote(parts.path)))
        if parts.scheme or parts.netloc or place not in self.names:
            raise ExperimentError(f"{self.fmu}: {base} names {source!r}: it must be a file inside the FMU")
        return place

    def text(self, place: str) -> str:
        try:
            return self.archive.read(place).decode("utf-8-sig")
        except Exception as error:  # zipfile and zlib raise exceptions of their own
            raise ExperimentError(f"{self.fmu}: {place} cannot be read: {first_line(error)}") from error

    def xml(self, place: str) -> ElementTree.Element:
        """Read an XML file of the FMU; return its root, with the namespaces removed from all element names."""
        try:
            root = ElementTree.fromstring(self.text(place))
        except ElementTree.ParseError as error:
            raise ExperimentError(f"{self.fmu}: {place} is not XML: {error}") from error
        for node in root.iter():
            node.tag = node.tag.rpartition("}")[2]
        return root

    def experiments(self, place: str) -> Iterator[Experiment]:
        """Yield the experiments that a file of the FMU describes."""
        for node in self.xml(place).iter("Experiment"):
            name = node.get("name", "")
            # in the schema the times are attributes of the kind of analysis; in the standard's text, of the experiment
            kinds = [child for child in node if child.tag not in ("Parameters", "Stimuli", "References", "Annotations")]
            if kinds and kinds[0].tag != "TransientSimulation":
                raise ExperimentError(
                    f"{self.fmu}: the experiment {name!r} is a {kinds[0].tag}: only TransientSimulation can be run"
                )
            values = {**node.attrib, **(kinds[0].attrib if kinds else {})}
            for note in node.iter("Annotation"):
                if note.get("type") == ALLOWED:
                    values["allowed"] = note.text or ""
            start, stop, step, tolerance, allowed = (
                self._number(values[key], f"{key} of the experiment {name!r}") if key in values else None
                for key in ("startTime", "stopTime", "stepSize", "tolerance", "allowed")
            )
            sources = {child.tag: self.place(place, child) for child in node if "source" in child.attrib}
            yield Experiment(
                name=name,
                description=node.get("description", ""),
                start=start,
                stop=stop,
                step=step,
                tolerance=tolerance,
                allowed=allowed,
                parameters=self._parameters(sources["Parameters"]) if "Parameters" in sources else {},
                stimuli=self._table(sources["Stimuli"]) if "Stimuli" in sources else None,
                reference=self._table(sources["References"]) if "References" in sources else None,
            )

    def _number(self, text: str, what: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            raise ExperimentError(f"{self.fmu}: {what} is {text!r}: it must be a finite number")
        return number

    def _parameters(self, place: str) -> dict[str, str]:
        """Read a parameter set in SSP's format; return the values as texts, by name."""
        values = {}
        for node in self.xml(place).iter("Parameter"):
            value = next((child.get("value") for child in node if "value" in child.attrib), None)
            if value is None or "name" not in node.attrib:
                raise ExperimentError(f"{self.fmu}: {place} has a parameter without name or value")
            values[node.attrib["name"]] = value
        return values

    def _table(self, place: str) -> NDArray[Any]:
        """Read a CSV table of the FMU whose first column is the time."""
        try:
            names, *rows = list(csv.reader(self.text(place).splitlines())) or [[]]
        except csv.Error as error:
            raise ExperimentError(f"{self.fmu}: {place} cannot be read: {error}") from error
        names = [name.strip() for name in names]
        if len(names) < 2 or len(set(names)) < len(names) or not rows or any(len(row) != len(names) for row in rows):
            raise ExperimentError(
                f"{self.fmu}: {place} must be CSV with different names in its first row, the time first, and equally long rows"
            )
        values = [tuple(self._number(cell, f"a cell of {place}") for cell in row) for row in rows]
        table = np.array(values, dtype=[(name, float) for name in names])
        if (np.diff(table[names[0]]) < 0.0).any():
            raise ExperimentError(f"{self.fmu}: the times in {place} decrease: they must increase")
        return table


def verify(fmu: str | Path, *, allowed: float | None = None) -> Iterator[Outcome]:
    """Run the experiments that an FMU from any tool contains, with FMPy, and compare results with references.

    An experiment is run in co-simulation if the FMU has that interface: inputs are held over each step, and the reference has
    the outputs at the end of the step, before the next inputs are set. Differences are relative to the scale of a variable.
    The scale is the largest magnitude of the variable's reference, but at least a thousandth of the largest magnitude of all
    variables with the same unit.

    Parameters
    ----------
    fmu : path
    allowed : float, optional
        Largest relative difference; by default the one that the experiment states, else 100 times its tolerance but at least
        1e-6, or 1e-3 if it has no tolerance.

    Yields
    ------
    Outcome

    Raises
    ------
    InputError, ExperimentError
        As for `read_experiments`.

    Examples
    --------
    >>> from analysis.run import verify
    >>> all(outcome.passed for outcome in verify("build/FiveBarSlider-native.fmu"))
    True
    """
    from fmpy import extract

    experiments = read_experiments(fmu)
    description = read_description(fmu)
    folder = tempfile.mkdtemp(dir=unpacking_folder())
    try:
        extract(str(fmu), folder)
        if [place.name for place in Path(folder).glob("binaries/*")] == [FOLDER]:
            raise ExperimentError(
                f"{fmu} has only a WebAssembly component, but FMPy, which runs the experiments, needs a library for this "
                "platform: 'linkwork check --all --fmu' runs the component on all standard cases"
            )
        for experiment in experiments:
            yield _run(experiment, description, folder, allowed)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _run(experiment: Experiment, description: Any, folder: str, allowed: float | None) -> Outcome:
    """Run one experiment of an unpacked FMU; ``allowed`` replaces the allowed difference if it is not None."""
    from fmpy import simulate_fmu

    kind = "ModelExchange" if description.coSimulation is None else "CoSimulation"
    reference, tolerance = experiment.reference, experiment.tolerance
    if allowed is None:
        allowed = experiment.allowed
    if allowed is None:
        allowed = _DEFAULT_ALLOWED if tolerance is None else max(_LEAST_ALLOWED, _FACTOR * tolerance)
    names, stimuli = _columns(reference), _columns(experiment.stimuli)
    known = {v.name for v in description.modelVariables}
    unknown = [name for name in (*names, *stimuli, *experiment.parameters) if name not in known]
    deviations: tuple[Deviation, ...] = ()
    message = f"the FMU has no variable {unknown[0]}" if unknown else ""
    if not message:
        try:
            found = simulate_fmu(
                folder, validate=False, fmi_type=kind, model_description=description, start_time=experiment.start,
                stop_time=experiment.stop, output_interval=experiment.step, relative_tolerance=tolerance,
                start_values=dict(experiment.parameters), input=experiment.stimuli, output=list(names) or None,
                record_events=False,
            )  # fmt: skip
        except Exception as error:  # FMPy raises plain exceptions
            message = first_line(error)
        else:
            end = experiment.stop if reference is None else float(reference[-1][0])
            if end is not None and found["time"][-1] < end - 1e-9 * max(1.0, abs(end)):
                message = f"the run ended early, at t = {found['time'][-1]:.9g} s"
            elif reference is not None:
                deviations = _deviations(found, reference, {v.name: v.unit or "" for v in description.modelVariables})
    return Outcome(
        experiment=experiment.name,
        description=experiment.description,
        interface="model exchange" if kind == "ModelExchange" else "co-simulation",
        deviations=deviations,
        allowed=allowed,
        message=message,
    )


def _columns(table: NDArray[Any] | None) -> tuple[str, ...]:
    """Return the names of all columns of a table except the first one, the time."""
    return () if table is None else (table.dtype.names or ())[1:]


def deviation_scales(columns: Iterable[NDArray[Any]], units: Sequence[str]) -> NDArray[np.float64]:
    """Return the scale of each variable's differences, computed from the columns of a reference.

    The scale is the greatest magnitude in the column, but at least `_LEAST_SCALE` times that of all variables with the same
    unit; 1 if all their values are zero.
    """
    sizes, kinds = np.array([float(np.abs(column).max()) for column in columns]), np.array(units)
    scales = np.maximum(sizes, _LEAST_SCALE * np.array([sizes[kinds == unit].max() for unit in units]))
    return np.where(scales > 0.0, scales, 1.0)


def _deviations(found: NDArray[Any], reference: NDArray[Any], units: Mapping[str, str]) -> tuple[Deviation, ...]:
    """Return the largest difference of each variable at the times of the reference, sorted by relative size, largest first."""
    clock, *names = reference.dtype.names or ()
    times = reference[clock]
    scales = deviation_scales((reference[name] for name in names), [units[name] for name in names])
    deviations = []
    for name, scale in zip(names, scales.tolist()):
        values = np.interp(times, found["time"], found[name].astype(float))
        difference = np.abs(values - reference[name])
        difference[np.isnan(difference)] = np.inf
        worst = int(np.argmax(difference))
        at, value, right = float(times[worst]), float(values[worst]), float(reference[name][worst])
        share = float(difference[worst]) / scale
        deviations.append(Deviation(name=name, unit=units[name], time=at, value=value, reference=right, relative=share))
    return tuple(sorted(deviations, key=lambda d: -d.relative))
