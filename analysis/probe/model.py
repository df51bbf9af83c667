"""Read from an FMU what the probe needs: variables, the calls that are allowed for each variable, states and capabilities."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

#: Group of functions and C type for each type of variable, in FMI 2 and FMI 3; the group Real has GetReal and SetReal.
TYPES: dict[int, dict[str, tuple[str, Any]]] = {
    2: {
        "Real": ("Real", ctypes.c_double),
        "Integer": ("Integer", ctypes.c_int),
        "Enumeration": ("Integer", ctypes.c_int),
        "Boolean": ("Boolean", ctypes.c_int),
        "String": ("String", ctypes.c_char_p),
    },
    3: {
        "Float32": ("Float32", ctypes.c_float),
        "Float64": ("Float64", ctypes.c_double),
        "Enumeration": ("Int64", ctypes.c_int64),
        "Boolean": ("Boolean", ctypes.c_bool),
        "String": ("String", ctypes.c_char_p),
        **{
            f"{sign}Int{bits}": (f"{sign}Int{bits}", getattr(ctypes, f"c_{sign.lower()}int{bits}"))
            for sign in ("", "U")
            for bits in (8, 16, 32, 64)
        },
    },
}


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the model description, with its numbers converted from text."""

    name: str
    reference: int
    group: str  # functions that access the variable: Real for GetReal and SetReal, Float64 for GetFloat64, ...
    causality: str
    variability: str
    initial: str | None
    start: Any
    minimum: float
    maximum: float
    nominal: float
    size: int
    is_state: bool

    @property
    def is_real(self) -> bool:
        return self.group in ("Real", "Float64", "Float32")


def _settable(variable: Variable) -> bool:
    return variable.variability != "constant" and variable.causality not in ("independent", "structuralParameter")


#: For each cell of the tables in `machines`: whether a variable may be read or set, as in the standard's footnotes.
CONDITIONS: dict[str, Callable[[Variable], bool]] = {
    "1": lambda v: _settable(v) and (v.initial in ("exact", "approx") or v.causality == "input"),
    "2": lambda v: v.causality == "output",
    "3": lambda v: _settable(v) and (v.initial == "exact" or v.causality == "input"),
    "4": lambda v: v.causality == "input" or (v.causality == "parameter" and v.variability == "tunable"),
    "5": lambda v: (v.causality == "input" and v.variability == "continuous") or v.is_state,
    "6": lambda v: v.causality == "input" or (v.causality == "parameter" and v.variability == "tunable"),
    # conditions of the probe: what FMI 3.0 allows without doubt
    "s": lambda v: v.causality in ("input", "parameter") or v.initial == "exact",
    "i": lambda v: v.causality == "input" and v.variability == "continuous",
    "x": lambda v: True,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """One interface of an FMU, with its variables and capabilities."""

    version: int  # of FMI: 2 or 3
    interface: str  # cs or me
    name: str
    identifier: str
    token: str
    variables: tuple[Variable, ...]
    states: int
    state_names: tuple[str, ...]  # in the order of the state vector; "" for a state that is not scalar
    indicators: int
    start_time: float
    step: float
    fixed_step: bool
    can_save: bool
    can_serialize: bool
    directional: bool
    adjoint: bool
    output_order: int
    input_derivatives: bool
    event_mode: bool
    evaluates_discrete: bool
    other_interface: bool
    once: bool  # whether the FMU can be instantiated only once in a process
    initial_unknowns: frozenset[str]
    #: Each Real derivative and output with the Real inputs and states on which it may depend.
    dependencies: tuple[tuple[Variable, tuple[Variable, ...]], ...] = field(repr=False)

    def select_variables(self, group: str, condition: str = "x") -> list[Variable]:
        """Return the variables of a ``group``, such as Real, that satisfy a ``condition``, a key of `CONDITIONS`."""
        meets = CONDITIONS[condition]
        if condition == "2":
            return [v for v in self.variables if v.group == group and (meets(v) or v.name in self.initial_unknowns)]
        return [v for v in self.variables if v.group == group and meets(v)]

    @property
    def groups(self) -> list[str]:
        return list(dict.fromkeys(v.group for v in self.variables))

    @property
    def c_types(self) -> dict[str, Any]:
        return dict(TYPES[self.version].values())


def interfaces(description: Any) -> list[str]:
    """Return the interfaces of an FMU that can be probed: "cs" (co-simulation) and "me" (model exchange)."""
    return [name for name, value in (("cs", description.coSimulation), ("me", description.modelExchange)) if value]


def read_model(folder: Path, interface: str) -> Model:
    """Read one interface, cs or me, that an extracted FMU of FMI 2.0 or 3.0 has."""
    from fmpy import read_model_description

    description = read_model_description(str(folder), validate=False)
    version = description.fmiMajorVersion
    about = description.coSimulation if interface == "cs" else description.modelExchange
    experiment = description.defaultExperiment
    start, stop, step = (
        _number(getattr(experiment, name, None), 0.0) for name in ("startTime", "stopTime", "stepSize")
    )
    steps = (_number(getattr(about, "fixedInternalStepSize", None), 0.0), step, (stop - start) / 500)
    offered = _capabilities(folder, interface)
    fixed = interface == "cs" and not about.canHandleVariableCommunicationStepSize
    derivatives = [unknown.variable for unknown in description.derivatives]
    names = tuple(variable.derivative.name for variable in derivatives if variable.derivative is not None)
    by_name = {
        v.name: _variable(v, version, v.name in names) for v in description.modelVariables if v.type in TYPES[version]
    }
    return Model(
        version=version,
        interface=interface,
        name=description.modelName,
        identifier=about.modelIdentifier,
        token=description.guid,
        variables=tuple(by_name.values()),
        states=description.numberOfContinuousStates,
        state_names=names if len(names) == description.numberOfContinuousStates else (),
        indicators=description.numberOfEventIndicators,
        start_time=start,
        step=next((size for size in steps if size > 0.0), 0.01),
        fixed_step=fixed,
        can_save=about.canGetAndSetFMUstate,
        can_serialize=about.canSerializeFMUstate,
        directional=bool(offered & {"providesDirectionalDerivative", "providesDirectionalDerivatives"}),
        adjoint="providesAdjointDerivatives" in offered,
        output_order=getattr(about, "maxOutputDerivativeOrder", 0),
        input_derivatives=getattr(about, "canInterpolateInputs", False),
        event_mode=getattr(about, "hasEventMode", False),
        evaluates_discrete=getattr(about, "providesEvaluateDiscreteStates", False),
        other_interface=len(interfaces(description)) > 1,
        once=about.canBeInstantiatedOnlyOncePerProcess,
        initial_unknowns=frozenset(u.variable.name for u in description.initialUnknowns if u.variable is not None),
        dependencies=tuple(_dependencies(description, by_name)),
    )


def _dependencies(description: Any, by_name: dict[str, Variable]) -> list[tuple[Variable, tuple[Variable, ...]]]:
    """Return each scalar Real derivative and output together with the inputs and states on which it may depend."""
    knowns = [v for v in by_name.values() if v.is_real and v.size == 1 and CONDITIONS["5"](v)]
    pairs = []
    for unknown in [*description.derivatives, *description.outputs]:
        variable = by_name.get(unknown.variable.name)
        if variable is None or not variable.is_real or variable.size != 1 or variable.variability != "continuous":
            continue
        named = None if unknown.dependencies is None else {v.name for v in unknown.dependencies}
        pairs.append((variable, tuple(k for k in knowns if named is None or k.name in named)))
    return [(unknown, known) for unknown, known in pairs if known]


def _number(text: Any, default: float) -> float:
    try:
        return float(text)
    except (TypeError, ValueError):
        return default


def _start(variable: Any, group: str) -> Any:
    text = variable.start
    if group == "String":
        return (text or "").encode()
    if group == "Boolean":
        return str(text).split()[0] in ("true", "1") if text else False
    value = _number(str(text).split()[0] if text else None, 0.0)
    return value if group in ("Real", "Float64", "Float32") else int(value)


def _variable(variable: Any, version: int, is_state: bool) -> Variable:
    group = TYPES[version][variable.type][0]
    declared = variable.declaredType
    bounds = [
        _number(getattr(variable, name) or getattr(declared, name, None), default)
        for name, default in (("min", -math.inf), ("max", math.inf), ("nominal", 1.0))
    ]
    if variable.type == "Enumeration" and declared is not None and declared.items:
        items = [int(item.value) for item in declared.items]
        bounds[:2] = min(items), max(items)
    return Variable(
        name=variable.name,
        reference=variable.valueReference,
        group=group,
        causality=variable.causality or "local",
        variability=variable.variability or ("continuous" if group in ("Real", "Float64", "Float32") else "discrete"),
        initial=variable.initial,
        start=_start(variable, group),
        minimum=bounds[0],
        maximum=bounds[1],
        nominal=bounds[2],
        size=math.prod(variable.shape or ()) if variable.dimensions else 1,
        is_state=is_state,
    )


def _capabilities(folder: Path, interface: str) -> set[str]:
    """Return the names of the capability flags of an interface that are true.

    The flags are read from the XML file, because FMPy does not read all of them.
    """
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    element = root.find({"cs": "CoSimulation", "me": "ModelExchange"}[interface])
    return set() if element is None else {name for name, value in element.items() if value in ("true", "1")}
