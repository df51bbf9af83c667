"""Sets made by arrays of values: as many parameters or inputs as there are values, without an object for each."""

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

from linkwork.errors import InputError, ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import Rules, field_name, fmi_name

from .. import files
from ..mechanisms import Parameters, mechanism_of
from ..numerics.symbolic import ELEMENTARY
from ..numerics.tracing import Rebound, rebound
from .arguments import variant
from .equations import like_parameters, modules_of
from .inputs import Inputs


class Varied(Sequence[Any]):
    """A sequence of objects that differ in some fields; each is made when it is asked for.

    Attributes
    ----------
    base : object
        Source of the other fields.
    columns : dict of str to ndarray
        Values by field.
    make : callable
        Makes one from the base and its own values.
    """

    def __init__(self, base: Any, columns: dict[str, NDArray[np.float64]], make: Callable[..., Any]) -> None:
        self.base = base
        self.columns = columns
        self.make = make

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return Varied(self.base, {name: values[index] for name, values in self.columns.items()}, self.make)
        return self.make(self.base, **{name: values[index].item() for name, values in self.columns.items()})


def distinct(items: Sequence[Any]) -> list[Any]:
    """Return the objects of a sequence, each once; of varied ones the first, which stands for all."""
    return [items[0]] if isinstance(items, Varied) else list({id(item): item for item in items}.values())


def vary(parameters: Parameters, inputs: Any, values: Mapping[str, Any]) -> tuple[Sequence[Any], Any]:
    """Return sets of parameters, and inputs, that differ in what is varied.

    Parameters
    ----------
    parameters, inputs
        What all have in common.
    values : mapping
        By the name of a parameter, in the FMI contract or of the field, or of an input that is constant: one for each set, in
        SI or texts with units.

    Raises
    ------
    InputError, ParameterError
        If a name is unknown, lengths differ, or a value is wrong; it says which set.
    """
    mechanism = mechanism_of(parameters)
    own = {field.name for field in fields(mechanism.parameters)}
    channels = {name: c.argument for c in mechanism.channels if c.kind != "rate" for name in (c.name, c.argument)}
    if not isinstance(inputs, Inputs | None):
        raise InputError("with vary there is one object of inputs for all: vary can hold values of constant inputs")
    of_sets: dict[str, NDArray[np.float64]] = {}
    of_inputs: dict[str, NDArray[np.float64]] = {}
    for name, given in values.items():
        field = field_name(name)
        if field in of_sets or channels.get(name) in of_inputs:
            raise InputError(f"vary has {name} twice, by its FMI name and by that in Python: give one of them")
        if field in own:
            of_sets[field] = _column(name, given, partial(_read_parameter, parameters, field))
        elif name in channels:
            of_inputs[channels[name]] = _column(name, given, partial(_read_input, channels[name]))
        else:
            raise files.unknown_name(name, (*map(fmi_name, sorted(own)), *channels), f"parameter or input {name!r}")
    lengths = {name: len(column) for name, column in (of_sets | of_inputs).items()}
    if len(set(lengths.values())) != 1:
        told = ", ".join(f"{length} of {name}" for name, length in lengths.items()) or "nothing"
        raise InputError(f"vary has {told}: it needs as many values of each")
    count = next(iter(lengths.values()))
    sets: Sequence[Any] = [parameters] * count
    if of_sets:
        sets = Varied(parameters, of_sets, replace)
        check_sets(mechanism, sets)
    for name, column in of_inputs.items():
        for i in np.flatnonzero(~np.isfinite(column))[:1].tolist():
            raise InputError(f"set {i} of {count}: {name} is {column[i]}: it must be a finite number")
    if not of_inputs:
        return sets, inputs
    return sets, Varied(Inputs() if inputs is None else inputs, of_inputs, Inputs.replace)


def _read_parameter(parameters: Parameters, field: str, text: str) -> float:
    return float(getattr(variant(parameters, **{field: text}), field))


def _read_input(name: str, text: str) -> float:
    return float(Inputs(**{name: text}).parts(name)[0])


def _column(name: str, given: Any, read: Callable[[str], float]) -> NDArray[np.float64]:
    """Return the values of one name as an array."""
    if isinstance(given, (list, tuple)):
        given = [read(value) if isinstance(value, str) else value for value in given]
    column = np.asarray(given)
    if column.ndim != 1 or column.dtype.kind not in "iuf" or len(column) == 0:
        raise InputError(
            f"vary has {name} = {given!r:.100}: it must be a list or an array of numbers, one for each set"
        )
    return column.astype(float)


def check_sets(mechanism: Mechanism, sets: Varied) -> None:
    """Check all sets against the rules of the parameters at once; the first that is wrong says what is."""
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
                of, constants = constants_of(mechanism, sets)
                for least in rules.least:
                    wrong |= getattr(of, least.field) < least.of(of)
                wrong |= ~np.isfinite(np.sum(np.broadcast_arrays(*constants, wrong)[:-1], axis=0))
        except (ArithmeticError, ValueError):
            # of a function of `math`: one by one shows which
            wrong[:] = True
    for i in np.flatnonzero(wrong).tolist():
        try:
            sets[i]
        except ParameterError as error:
            error.args = (f"set {i} of {len(sets)}: {error}",)
            raise


def constants_of(mechanism: Mechanism, sets: Sequence[Parameters]) -> tuple[SimpleNamespace, Any]:
    """Return the parameters of all sets as one object with arrays, and the constants of the equations from it.

    What does not vary is a number.
    """
    _, like = over_arrays(mechanism)
    names = [field.name for field in fields(mechanism.parameters)]
    if isinstance(sets, Varied):
        columns = {name: sets.columns.get(name, float(getattr(sets.base, name))) for name in names}
    else:
        columns = dict(zip(names, np.array(list(map(attrgetter(*names), sets)), float).reshape(len(sets), -1).T))
    parameters = like(**columns)
    return parameters, parameters.constants()


@cache
def over_arrays(mechanism: Mechanism) -> tuple[Rebound, type[SimpleNamespace]]:
    """Return the equations for arrays, and the type of parameters that they take.

    The functions are those of `math` itself, element by element, as those of NumPy differ in bits.
    """
    elementwise = {name: _elementwise(getattr(math, name)) for name in ELEMENTARY}
    ours = {"sqrt": np.sqrt, "fabs": np.abs, "max": np.maximum, "min": np.minimum, "float": lambda value: value}
    functions = rebound(modules_of(mechanism), elementwise | ours)
    return functions, like_parameters(mechanism, functions)


def _elementwise(function: Callable[..., float]) -> Callable[..., Any]:
    """Return a function of floats that is applied to arrays element by element."""

    def applied(*values: Any) -> Any:
        if all(isinstance(value, float) for value in values):
            return function(*values)
        arrays = np.broadcast_arrays(*values) if len(values) > 1 else [np.asarray(values[0])]
        columns = [array.ravel().tolist() for array in arrays]
        return np.fromiter(map(function, *columns), float, arrays[0].size).reshape(arrays[0].shape)

    return applied
