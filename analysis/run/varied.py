"""Sets of parameters or inputs given by arrays of values, without an object for each set."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, partial
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError, ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import Rules, field_name, fmi_name

from .. import files
from ..mechanisms import Parameters, find_mechanism
from ..numerics.symbolic import ELEMENTARY
from ..numerics.tracing import ReboundFunctions, rebind_functions
from .arguments import variant
from .equations import equation_modules, parameters_class
from .inputs import Inputs


class VariedSequence(Sequence[Any]):
    """A sequence of objects that differ in some fields; each object is made only when it is taken from the sequence.

    Attributes
    ----------
    base : object
        Object with the values of the fields that do not differ.
    columns : dict of str to ndarray
        Values of the fields that differ, for all objects, by field.
    make : callable
        Function that makes an object from ``base`` and the object's own values, as keywords.
    """

    def __init__(self, base: Any, columns: dict[str, NDArray[np.float64]], make: Callable[..., Any]) -> None:
        self.base = base
        self.columns = columns
        self.make = make

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return VariedSequence(self.base, {name: values[index] for name, values in self.columns.items()}, self.make)
        return self.make(self.base, **{name: values[index].item() for name, values in self.columns.items()})


def distinct_objects(items: Sequence[Any]) -> list[Any]:
    """Return the objects of a sequence without repetitions; of a `VariedSequence` only the first, which represents all."""
    return [items[0]] if isinstance(items, VariedSequence) else list({id(item): item for item in items}.values())


def vary(parameters: Parameters, inputs: Any, values: Mapping[str, Any]) -> tuple[Sequence[Any], Any]:
    """Return the parameters and the inputs of all sets, which differ in the given values.

    Parameters
    ----------
    parameters, inputs
        Values that all sets have in common.
    values : mapping
        Values of a parameter or of a constant input, one for each set, in SI or as texts with units; by the FMI name or the
        name of the field.

    Raises
    ------
    InputError, ParameterError
        If a name is unknown, lengths differ, or a value is wrong; the message names the set.
    """
    mechanism = find_mechanism(parameters)
    if not isinstance(values, Mapping):
        raise InputError(f"vary is {values!r:.200}: it must be a mapping from names to values, one value for each set")
    own = {field.name for field in fields(mechanism.parameters)}
    channels = {name: c.argument for c in mechanism.channels if c.kind != "rate" for name in (c.name, c.argument)}
    if not isinstance(inputs, Inputs | None):
        raise InputError("with vary inputs must be one object for all sets: give the values of constant inputs in vary")
    of_sets: dict[str, NDArray[np.float64]] = {}
    of_inputs: dict[str, NDArray[np.float64]] = {}
    for name, given in values.items():
        field = field_name(name)
        if field in of_sets or channels.get(name) in of_inputs:
            raise InputError(f"vary has {name} twice, by its FMI name and by its name in Python: give one of them")
        if field in own:
            of_sets[field] = _column(name, given, partial(_read_parameter, parameters, field))
        elif name in channels:
            of_inputs[channels[name]] = _column(name, given, partial(_read_input, channels[name]))
        else:
            raise files.unknown_name(name, (*map(fmi_name, sorted(own)), *channels), f"parameter or input {name!r}")
    lengths = {name: len(column) for name, column in (of_sets | of_inputs).items()}
    if len(set(lengths.values())) != 1:
        told = ", ".join(f"{length} of {name}" for name, length in lengths.items()) or "nothing"
        raise InputError(f"vary has {told}: it needs the same number of values of each")
    count = next(iter(lengths.values()))
    sets: Sequence[Any] = [parameters] * count
    if of_sets:
        sets = VariedSequence(parameters, of_sets, replace)
        check_sets(mechanism, sets)
    for name, column in of_inputs.items():
        for i in np.flatnonzero(~np.isfinite(column))[:1].tolist():
            raise InputError(f"set {i} of {count}: {name} is {column[i]}: it must be a finite number")
    if not of_inputs:
        return sets, inputs
    return sets, VariedSequence(Inputs() if inputs is None else inputs, of_inputs, Inputs.replace)


def _read_parameter(parameters: Parameters, field: str, text: str) -> float:
    return float(getattr(variant(parameters, **{field: text}), field))


def _read_input(name: str, text: str) -> float:
    return float(Inputs(**{name: text}).parts(name)[0])


def _column(name: str, given: Any, read: Callable[[str], float]) -> NDArray[np.float64]:
    """Return the values of one parameter or input as an array; ``read`` converts texts to SI."""
    if isinstance(given, (list, tuple)):
        values: list[Any] = []
        for i, value in enumerate(given):
            try:
                values.append(read(value) if isinstance(value, str) else value)
            except LinkworkError as error:
                error.args = (f"set {i} of {len(given)}: {error}",)
                raise
        given = values
    column = np.asarray(given)
    if column.ndim != 1 or column.dtype.kind not in "iuf" or len(column) == 0:
        raise InputError(
            f"vary has {name} = {given!r:.100}: it must be a list or an array of numbers, one for each set"
        )
    return column.astype(float)


def check_sets(mechanism: Mechanism, sets: VariedSequence) -> None:
    """Check all sets against the rules of the parameters at once; raise ParameterError for the first that breaks a rule."""
    rules: Rules = mechanism.parameters.RULES  # type: ignore[attr-defined]
    wrong = np.zeros(len(sets), dtype=bool)
    for name, column in sets.columns.items():
        wrong |= ~np.isfinite(column)
        if name in rules.signs:
            wrong |= np.abs(column) != 1.0
        elif name in rules.positive:
            wrong |= ~(column > 0.0)
        elif name not in rules.free_sign:
            wrong |= ~(column >= 0.0)
    if not wrong.any():
        try:
            with np.errstate(all="ignore"):
                of, constants = varied_constants(mechanism, sets)
                for least in rules.least:
                    wrong |= getattr(of, least.field) < least.of(of)
                wrong |= ~np.isfinite(np.sum(np.broadcast_arrays(*constants, wrong)[:-1], axis=0))
        except (ArithmeticError, ValueError):
            # raised by a function of `math`: check each set by itself
            wrong[:] = True
    for i in np.flatnonzero(wrong).tolist():
        try:
            sets[i]
        except ParameterError as error:
            error.args = (f"set {i} of {len(sets)}: {error}",)
            raise


def varied_constants(mechanism: Mechanism, sets: Sequence[Parameters]) -> tuple[SimpleNamespace, Any]:
    """Return the parameters of all sets as one object with arrays, and the constants of the equations computed from it.

    If ``sets`` are a `VariedSequence`, parameters that do not vary are numbers.
    """
    _, like = array_functions(mechanism)
    names = [field.name for field in fields(mechanism.parameters)]
    if isinstance(sets, VariedSequence):
        columns = {name: sets.columns.get(name, float(getattr(sets.base, name))) for name in names}
    else:
        columns = dict(zip(names, np.array(list(map(attrgetter(*names), sets)), float).reshape(len(sets), -1).T))
    parameters = like(**columns)
    return parameters, parameters.constants()


@cache
def array_functions(mechanism: Mechanism) -> tuple[ReboundFunctions, type[SimpleNamespace]]:
    """Return the equations as functions of arrays, and the class of parameters with arrays as fields.

    The functions apply those of `math` to each element, as NumPy's functions differ in the last bits.
    """
    elementwise = {name: _vectorise(getattr(math, name)) for name in ELEMENTARY}
    ours = {"sqrt": np.sqrt, "fabs": np.abs, "max": np.maximum, "min": np.minimum, "float": lambda value: value}
    functions = rebind_functions(equation_modules(mechanism), elementwise | ours)
    return functions, parameters_class(mechanism, functions)


def _vectorise(function: Callable[..., float]) -> Callable[..., Any]:
    """Return a function of arrays that applies a function of floats to each element."""

    def applied(*values: Any) -> Any:
        if all(isinstance(value, float) for value in values):
            return function(*values)
        arrays = np.broadcast_arrays(*values) if len(values) > 1 else [np.asarray(values[0])]
        columns = [array.ravel().tolist() for array in arrays]
        return np.fromiter(map(function, *columns), float, arrays[0].size).reshape(arrays[0].shape)

    return applied
