"""Derive the LaTeX symbols of the variables of a described linkage from their names."""

from __future__ import annotations

#: Letter and further index by the last part of a name; for a force or a coordinate of a point the index is the axis.
_SYMBOLS = {
    "angle": (r"\theta", ""),
    "speed": (r"\dot\theta", ""),
    "position": ("s", ""),
    "velocity": (r"\dot s", ""),
    "turn": (r"\varphi", ""),
    "transmission_angle": (r"\mu", ""),
    "clearance": (r"\sin\mu", r"\min"),
    "length": ("l", ""),
    "mass": ("m", ""),
    "inertia": ("J", ""),
    "cog_x": ("x", "S"),
    "cog_y": ("y", "S"),
    "direction": (r"\beta", ""),
    "gravity_direction": (r"\beta", "g"),
    "gravity": ("g", ""),
    "ratio": ("i", ""),
    "phase": (r"\varphi", "0"),
    "radius": ("r", ""),
    "offset": ("s", "0"),
    "stiffness": ("k", ""),
    "damping": ("c", ""),
    "free_length": ("l", "0"),
    "free_position": ("s", "0"),
    "free_angle": (r"\varphi", "0"),
    "friction_radius": (r"\rho", ""),
    "friction_coefficient": ("f", ""),
    "assembly": (r"\sigma", ""),
    "force": ("F", ""),
    "applied_force": ("F", ""),
    "exerted_force": ("F", ""),
    "torque": ("T", ""),
    "applied_torque": ("T", ""),
    "exerted_torque": ("T", ""),
    "moment": ("M", ""),
    "fx": ("F", "x"),
    "fy": ("F", "y"),
    "load_x": ("P", "x"),
    "load_y": ("P", "y"),
    "x": ("x", ""),
    "y": ("y", ""),
}


def symbol(name: str, unit: str, at: str = "") -> str:
    r"""Return the symbol of a variable: a letter for the quantity, with the body as index; empty if there is none.

    ``at`` is a further index, such as 0 for an initial value.

    >>> symbol("crank.length", "m"), symbol("coupler.P_x", "m"), symbol("crank.acceleration", "rad/s2")
    ('l_{\\mathrm{crank}}', 'x_{\\mathrm{coupler},P}', '\\ddot\\theta_{\\mathrm{crank}}')
    """
    owner, _, last = name.rpartition(".")
    if last == "acceleration":
        letter, index = r"\ddot\theta" if unit == "rad/s2" else r"\ddot s", ""
    elif last == "friction":
        letter, index = "F" if unit == "N" else "T", "R"
    elif last not in _SYMBOLS and unit == "m" and last[-2:] in ("_x", "_y"):
        letter, index = last[-1], last[:-2]
    elif last in _SYMBOLS and not name.startswith("energy."):
        letter, index = _SYMBOLS[last]
    else:
        return ""
    whose = "" if last in ("clearance", "gravity_direction") else owner
    indices = [part if len(part) == 1 or "\\" in part else rf"\mathrm{{{part}}}" for part in (whose, index, at) if part]
    return f"{letter}_{{{','.join(indices)}}}" if indices else letter
