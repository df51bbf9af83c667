"""Place the parts of a system in its diagram, from left to right in the order of the file."""

from __future__ import annotations

from typing import NamedTuple

from .wiring import Wiring

#: Width of a part, room between columns, height of a port and of a heading, all in mm.
WIDTH, ROOM, PORT, HEAD = 105.0, 70.0, 6.0, 10.0


class Box(NamedTuple):
    """Box of a part: its edges (mm, y upwards), and its ports from the top, inputs at the left edge, outputs at the right."""

    left: float
    bottom: float
    right: float
    top: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def port_height(self, port: str) -> float:
        """Return the y coordinate of a port (mm)."""
        ports = self.inputs if port in self.inputs else self.outputs
        return self.top - HEAD - PORT * (ports.index(port) + 0.5)


def boxes(wiring: Wiring) -> dict[str, Box]:
    """Return the box of each part; four or more parts are placed in columns of two."""
    placed: dict[str, Box] = {}
    names = list(wiring.parts)
    rows = 1 if len(names) < 4 else 2
    for number, name in enumerate(names):
        ends = [end.port for pair in wiring.connections.items() for end in pair if end.part == name]
        inputs = tuple(port for port in wiring.parts[name].real_variables("input") if port in ends)
        outputs = tuple(port for port in wiring.parts[name].real_variables("output") if port in ends)
        height = HEAD + PORT * max(len(inputs), len(outputs), 1)
        left = (number // rows) * (WIDTH + ROOM)
        top = -(number % rows) * 70.0
        placed[name] = Box(left, top - height, left + WIDTH, top, inputs, outputs)
    return placed
