"""The figures of two theses: of Youssef's a runnable module each, of Rahman's one module for all.

``python -m analysis.studies.fig_3_2`` runs Youssef's figure 3.2, ``python -m analysis.studies.rahman R5`` Rahman's figure 5.
`STUDIES` lists them in order with their titles; `load` imports one, `make` runs it and writes its files.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from ..files import unknown_name
from ._rahman import FIGURES as _RAHMAN

if TYPE_CHECKING:
    from .study import Study, StudyResult

#: Title of each study of Youssef's thesis by its number there, and of the pictures of the linkage.
YOUSSEF: Mapping[str, str] = MappingProxyType(
    {
        "3.2": "Drift of the slider without a spring; Table 3.1, 420 rpm",
        "3.3": "Drift with and without gravity; Table 3.1, 420 rpm, k = 0",
        "3.4": "Steady motion of the slider, three springs; Table 3.1, 420 rpm",
        "3.5": "Torque that holds the speed, three springs; Table 3.1, 420 rpm",
        "3.6": "Launch with three torques: slider position; Table 3.1",
        "3.7": "Launch with three torques: crank speed; Table 3.1",
        "3.8": "Launch with three springs: slider position; Table 3.1",
        "3.9": "Launch with three springs: crank speed; Table 3.1",
        "3.10": "Torque of the launch against its time to 1 rad; Table 3.1",
        "3.11": "Free motion, k = 5e5 dyn/cm: slider position; Table 3.1",
        "3.12": "Free motion, k = 5e5 dyn/cm: crank speed; Table 3.1",
        "3.13": "Free motion, k = 2e6 dyn/cm: slider position; Table 3.1",
        "3.14": "Free motion, k = 2e6 dyn/cm: crank speed; Table 3.1",
        "4.3": "First harmonic over the speed without damping; chapter IV",
        "4.4": "First harmonic over the speed with dampers; chapter IV, I4 = 1",
        "4.5": "Harmonics near half the natural frequency; chapter IV, I4 = 1",
        "4.6": "Resonance over the inertia of the rocker; chapter IV",
        "4.7": "Linear equations against the plant; chapter IV, I4 = 1",
        "5.1": "First region of instability over the inertia ratio, without damping",
        "5.2": "First region of instability with damping, and the damping that removes it",
        "5.3": "First region of instability over the coupler's length",
        "5.4": "First region over the crank's length, and the widths of higher ones",
        "6.4": "Ellipse (a), timed",
        "6.5": "Ellipse (b), timed",
        "6.6": "Ellipse (a), timed, with bounds on the lengths",
        "6.7": "Rocker function, unweighted",
        "6.8": "Rocker function, weighted, and with a mounting angle",
        "6.9": "Path (a): least area between the curves",
        "6.10": "Path (b): least area between the curves",
        "6.11": "Packaging machine: a straight push and a return",
        "7.2": "Coupler curves and accessible area of P; Table 3.1",
        "7.3": "Error over the slider position at one crank angle; printed linkage of ellipse (a)",
        "7.4": "A curve traced by moving the slider while the crank turns; Table 3.1",
        "7.5": "Variational motion of the slider; weighted rocker function",
        "7.6": "Slider moved by one, two and three harmonics; weighted rocker function",
        "7.7": "Slider moved by two harmonics; path (b)",
        "7.8": "Slider moved by three and five harmonics; path (b)",
        "7.9": "Links and slider optimised together; path (b)",
        "7.10": "Smoothness of the slider's motion against error; weighted rocker function",
        "7.11": "The simplest mechanism that meets a tolerance; rocker function",
        "7.12": "Force, power and tracking of the slider's motion; weighted rocker function",
        "8.7": "Steady motion far below resonance; rig 1, spring A",
        "8.8": "Steady motion near half the natural frequency; rig 1, spring A",
        "8.9": "Four peaks a turn become two; rig 1, spring A",
        "8.10": "Steady motion through resonance; rig 1, spring A",
        "8.11": "Steady motion near a third of the natural frequency; rig 1, spring B",
        "8.12": "Steady motion near half the natural frequency; rig 1, spring B",
        "8.13": "Steady motion towards resonance; rig 1, spring B",
        "8.14": "Amplitude of the slider over the speed; rig 1, spring A",
        "8.15": "Amplitude of the slider over the speed; rig 1, spring B",
        "8.16": "Harmonics of the slider's motion over the speed; rig 1",
        "8.17": "Coulomb friction in the guide: amplitude, and whether it explains the misfit; rig 1",
        "8.18": "Amplitude of the slider over the speed; rig 2, spring C",
        "8.19": "Amplitude of the slider over the speed; rig 2, spring D",
        "8.20": "Harmonics of the slider's motion over the speed; rig 2",
        "8.21": "Crank torque and pin forces over the speed; rig 2",
        "linkage": "The five-bar slider of Table 3.1 at 420 rpm",
    }
)


#: Title of each study of Rahman's thesis by the figure's number there with an R before it.
RAHMAN: Mapping[str, str] = MappingProxyType({number: figure.title for number, figure in _RAHMAN.items()})

#: Title of each study.
STUDIES: Mapping[str, str] = MappingProxyType({**YOUSSEF, **RAHMAN})


def is_figure(number: str) -> bool:
    """Whether a study is a figure of a thesis; the others are pictures of a linkage."""
    return number.removeprefix("R")[0].isdigit()


def file_stem(number: str) -> str:
    """Name of a study's files without their endings."""
    return f"fig_{number.replace('.', '_')}" if is_figure(number) else number


def module_name(number: str) -> str:
    """Module of a study."""
    return f"{__name__}.{'rahman' if number in RAHMAN else file_stem(number)}"


def load(number: str) -> Study:
    """The study of a figure.

    Raises
    ------
    UnknownNameError
        If there is no study of that number.
    """
    if number not in STUDIES:
        raise unknown_name(number, STUDIES, f"study of figure {number!r}")
    module = import_module(module_name(number))
    study: Study = module.study(number) if number in RAHMAN else module.STUDY
    return study


def make(number: str, out: str | Path = "out") -> tuple[StudyResult, tuple[Path, ...]]:
    """Run a study and write its plot and CSV (of the linkage an animation too) into a folder; returns the paths."""
    return load(number).make(out)
