"""The directions in which parameters move the numbers of a drive and the constants of the equations, exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism
from linkwork.parameters import fmi_name

from ..mechanisms import Parameters, mechanism_of
from ..numerics import symbolic
from ..run import of_parameters, takes_published
from .drives import Drive
from .orbits import PeriodicOrbit
from .planes import of_the_motor, require_variable, variable_names

FloatArray = NDArray[np.float64]


@takes_published()
def gradient_names(parameters: Parameters, drive: Drive) -> tuple[str, ...]:
    """All parameters that motions have derivatives by: what acts of the drive, and those of the mechanism, by FMI name.

    A parameter that would switch on what is switched off, friction by contact forces, is left out: it can be named all the
    same.
    """
    mechanism, acting = mechanism_of(parameters), []
    for name in variable_names(mechanism):
        try:
            require_variable(parameters, drive, name)
        except InputError:
            continue
        acting.append(name)
    if mechanism.switch_place < 0 or mechanism.switched(parameters.constants()):
        return tuple(acting)
    effect = along_parameters(parameters, acting).p[mechanism.switch_place]
    return tuple(name for name, change in zip(acting, effect) if change == 0.0)


class Along(NamedTuple):
    """Derivatives of the constants with respect to parameters, and of these with respect to one more; shape (P, m)."""

    p: FloatArray
    p_along: FloatArray


def along_parameters(parameters: Parameters, names: Sequence[str], along: str = "") -> Along:
    """Derivatives of the constants by parameters of FMI names, zero by what is no parameter of the mechanism."""
    mechanism = mechanism_of(parameters)
    own = [float(getattr(parameters, field.name)) for field in fields(parameters)]
    known = {fmi_name(field.name): number for number, field in enumerate(fields(parameters))}
    direction = np.zeros(len(own))
    if along in known:
        direction[known[along]] = 1.0
    found = [np.asarray(part) for part in _constants(mechanism)(own, direction)]
    chosen = [np.zeros((len(found[0]), len(names))) for _ in found]
    for part, columns in zip(found, chosen):
        for column, name in enumerate(names):
            if name in known:
                columns[:, column] = part[:, known[name]]
    return Along(*chosen)


def stacked(orbit: PeriodicOrbit, names: Sequence[str], p: FloatArray) -> FloatArray:
    """Derivatives of the numbers of the drive, and after them of the constants, ``p``; shape (c, m)."""
    mechanism = mechanism_of(orbit.parameters)
    drive = np.zeros((orbit.flow.drive_size, p.shape[1]))
    # in the order of `Drive.vector`
    places = (*mechanism.input_names, *of_the_motor(mechanism))
    for column, name in enumerate(names):
        if name in places:
            drive[places.index(name), column] = 1.0
    return np.vstack([drive, p])


@cache
def _constants(mechanism: Mechanism) -> Any:
    """(parameters, direction) -> derivatives of the constants, and of these along the direction."""
    casadi = symbolic.library()
    traced = of_parameters(mechanism)
    k = casadi.vertcat(*traced.parameters.constants())
    direction = casadi.SX.sym("direction", *traced.own.shape)
    jacobian = casadi.jacobian(k, traced.own)
    along = casadi.reshape(casadi.jtimes(casadi.vec(jacobian), traced.own, direction), *jacobian.shape)
    return casadi.Function("constants", [traced.own, direction], [casadi.densify(jacobian), casadi.densify(along)])
