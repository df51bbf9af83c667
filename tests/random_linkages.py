"""Generate random planar linkages: chains of dyads of all kinds, made from given positions so that they can be assembled."""

from typing import Any

import numpy as np

KINDS = ("RRR", "RRP", "PRP", "RPR", "RPP", "gear", "slot")


class Maker:
    """Builder of a random linkage description, dyad by dyad.

    Every body has a place (x, y, angle) in the ground frame; coordinates of points in the body follow from it.
    """

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.data: dict[str, Any] = {"name": "random-linkage", "ground": {}, "bodies": {}, "freedoms": {}}
        self.data |= {"slides": {}, "slots": {}, "gears": {}, "racks": {}, "springs": {}, "assembly": {}, "loads": []}
        self.places: dict[str, tuple[float, float, float]] = {"ground": (0.0, 0.0, 0.0)}
        self.count = 0
        #: bodies whose freedom is the angle at a pin on the ground, with the pin's position: possible mates of gears
        self.mates: list[tuple[str, np.ndarray]] = []
        #: bodies whose freedom is the angle at a pin on another body, with that body: possible gears of racks
        self.pinned: list[tuple[str, str]] = []

    def name(self, prefix: str) -> str:
        self.count += 1
        return f"{prefix}{self.count}"

    def spot(self) -> np.ndarray:
        return self.rng.uniform(-0.5, 0.5, 2)

    def new(self, place: np.ndarray | None = None, angle: float | None = None) -> str:
        """Add a body with a mass, at a given or random place; return its name."""
        name, rng = self.name("b"), self.rng
        x, y = self.spot() if place is None else place
        self.places[name] = (float(x), float(y), float(rng.uniform(-3, 3) if angle is None else angle))
        self.data["bodies"][name] = {
            "points": {},
            "mass": float(rng.uniform(0.2, 2.0)),
            "inertia": float(rng.uniform(1e-3, 1e-2)),
            "cog": [float(c) for c in rng.uniform(-0.1, 0.1, 2)],
        }
        return name

    def mark(self, body: str, own: str, place: np.ndarray) -> None:
        """Add a point ``own`` to a body; ``place`` is its position in the ground frame."""
        x, y, angle = self.places[body]
        c, s = np.cos(angle), np.sin(angle)
        dx, dy = place[0] - x, place[1] - y
        points = self.data["ground"] if body == "ground" else self.data["bodies"][body]["points"]
        points[own] = [float(c * dx + s * dy), float(-s * dx + c * dy)]

    def known(self) -> str:
        return str(self.rng.choice(list(self.places)))

    def pin(self, *bodies: str, place: np.ndarray | None = None) -> str:
        own, place = self.name("p"), self.spot() if place is None else place
        for body in bodies:
            self.mark(body, own, place)
        return own

    def slide(self, on: str, block: str) -> str:
        """Add a slide of ``block``, along its x axis, on the body ``on``; return the slide's name."""
        name, own = self.name("s"), self.name("o")
        x, y, angle = self.places[block]
        way = self.rng.uniform(-0.3, 0.3)
        self.mark(on, own, np.array([x - way * np.cos(angle), y - way * np.sin(angle)]))
        direction = float(angle - self.places[on][2])
        self.data["slides"][name] = {"body": block, "on": on, "through": own, "direction": direction}
        return name

    def joined(self, kind: str, base: str, body: str) -> str:
        """Add a joint between two bodies, "R" or "P"; either body may be the block of "P". Return the joint's name."""
        if kind == "R":
            return self.pin(base, body)
        swap = base != "ground" and self.rng.uniform() < 0.5
        return self.slide(body, base) if swap else self.slide(base, body)

    def freedom(self) -> None:
        """Add a body as a freedom: pinned to an existing body, or sliding on it."""
        base, body = self.known(), self.new()
        kind = self.rng.choice(["R", "R", "P"])
        joint = self.joined(kind, base, body)
        start = self.places[body][2] - self.places[base][2]
        if kind == "P":
            start = self.position(joint)
        else:
            self.pinned.append((body, base))
        if kind == "R" and base == "ground":
            self.mates.append((body, self.place_of("ground", joint)))
        self.free(joint, start, bool(self.rng.uniform() < 0.6))

    def free(self, joint: str, start: float, driven: bool) -> None:
        self.data["freedoms"][self.name("f")] = {"joint": joint, "start": float(start), "driven": driven}

    def position(self, slide: str) -> float:
        """Return the position of a slide (m) at the places of its bodies."""
        s = self.data["slides"][slide]
        ox, oy = self.in_ground(s["on"], s["through"])
        bx, by, turn = self.places[s["body"]]
        return float((bx - ox) * np.cos(turn) + (by - oy) * np.sin(turn))

    def in_ground(self, body: str, own: str) -> np.ndarray:
        x, y, angle = self.places[body]
        p, c, s = self.place_of(body, own), np.cos(angle), np.sin(angle)
        return np.array([x + c * p[0] - s * p[1], y + s * p[0] + c * p[1]])

    def place_of(self, body: str, own: str) -> np.ndarray:
        points = self.data["ground"] if body == "ground" else self.data["bodies"][body]["points"]
        return np.array(points[own])

    def dyad(self, kind: str) -> None:
        if kind in ("gear", "rack"):
            return self.gear() if kind == "gear" else self.rack()
        if kind == "group":
            return self.group()
        if kind == "slot":
            base, other, body = self.known(), self.known(), self.new()
            self.pin(base, body)
            own, name, through = self.name("p"), self.name("t"), self.name("o")
            at = self.spot()
            holder, pinned = (body, other) if self.rng.uniform() < 0.5 else (other, body)
            self.mark(pinned, own, at)
            self.mark(holder, through, self.spot())
            way = at - self.in_ground(holder, through)
            direction = np.arctan2(way[1], way[0]) - self.places[holder][2]
            self.data["slots"][name] = {"pin": own, "on": holder, "through": through, "direction": float(direction)}
            return None
        first, second = self.known(), self.known()
        one, other = self.new(), self.new()
        self.joined(kind[0], first, one)
        self.joined(kind[2], second, other)
        if kind[1] == "R":
            self.pin(one, other)
        else:
            # the slide is along the block's own axis, so that any two bodies can slide on each other
            pair = (one, other) if self.rng.uniform() < 0.5 else (other, one)
            self.slide(*pair)
        return None

    def group(self) -> None:
        """Add a four-bar on a body that is pinned to an existing one; its coupler drives a lever.

        This is a dyad that contains a dyad.
        """
        base, other = self.known(), self.known()
        first, upper, lower, coupler, lever = (self.new() for _ in range(5))
        self.pin(base, first)
        start = self.places[upper][2] - self.places[first][2]
        self.free(self.pin(first, upper), start, driven=False)
        for pair in ((first, lower), (lower, coupler), (upper, coupler), (coupler, lever), (other, lever)):
            self.pin(*pair)

    def gear(self) -> None:
        if not self.mates:
            return
        mate, _ = self.mates[int(self.rng.integers(len(self.mates)))]
        body = self.new()
        self.pin("ground", body)
        ratio = float(self.rng.choice([-1.0, -0.5, 1.5, 2.0]))
        phase = self.places[body][2] - ratio * self.places[mate][2]
        self.data["gears"][self.name("g")] = {"bodies": [mate, body], "ratio": ratio, "phase": float(phase)}

    def rack(self) -> None:
        """Add a rack on the carrier of a pinned freedom, or a gear on either body of a slide."""
        slides = list(self.data["slides"])
        if self.pinned and (not slides or self.rng.uniform() < 0.5):
            gear, carrier = self.pinned[int(self.rng.integers(len(self.pinned)))]
            rack = self.new()
            slide = self.joined("P", carrier, rack)
        elif slides:
            slide = str(self.rng.choice(slides))
            ends = [self.data["slides"][slide][part] for part in ("on", "body")]
            gear = self.new()
            carrier, rack = ends if ends[1] == "ground" or self.rng.uniform() < 0.5 else ends[::-1]
            self.pin(carrier, gear)
        else:
            return
        radius = float(self.rng.uniform(0.05, 0.2) * self.rng.choice([-1.0, 1.0]))
        offset = self.position(slide) - radius * (self.places[gear][2] - self.places[carrier][2])
        self.data["racks"][self.name("r")] = {"gear": gear, "rack": rack, "radius": radius, "offset": offset}

    def actions(self) -> None:
        """Add springs, dampers, a load and gravity."""
        rng, data = self.rng, self.data
        data |= {"gravity": 9.81, "gravity_direction": float(rng.uniform(-3, 3))}
        owned = [(body, own) for body, table in data["bodies"].items() for own in table["points"]]
        for freedom in data["freedoms"].values():
            if rng.uniform() < 0.5:
                joint, free = freedom["joint"], float(freedom["start"] + 0.1)
                data["springs"][self.name("k")] = {"at": joint, "stiffness": 30.0, "damping": 0.3, "free": free}
        if data["slides"] and rng.uniform() < 0.5:
            joint = str(rng.choice(list(data["slides"])))
            data["springs"][self.name("k")] = {"at": joint, "stiffness": 40.0, "damping": 0.2, "free": 0.03}
        ends = {own for _, own in owned}
        if len(ends) > 1:
            pair = [str(own) for own in rng.choice(sorted(ends), 2, replace=False)]
            name, tables = self.name("k"), [data["ground"], *(body["points"] for body in data["bodies"].values())]
            if not any(set(pair) <= table.keys() for table in tables):
                data["springs"][name] = {"between": pair, "stiffness": 50.0, "damping": 0.5, "free": 0.2}
        if not owned:
            body = next(iter(data["bodies"]))
            owned = [(body, self.pin(body))]
        point = owned[int(rng.integers(len(owned)))][1]
        data["loads"] = [{"point": point, "frame": "body"} if rng.uniform() < 0.5 else point]
        self.drives()

    def drives(self) -> None:
        """Add laws and drives to the springs, a motor at a pin that is no freedom, and a shaft between two bodies."""
        rng, data = self.rng, self.data
        for spring in data["springs"].values():
            if rng.uniform() < 0.4:
                spring |= {"law": "40*x**3 + a*tanh(3*v)", "constants": {"a": "0.5 N"}}
            spring["driven"] = bool(rng.uniform() < 0.4)
        owners = [data["ground"], *(body["points"] for body in data["bodies"].values())]
        taken = {table["joint"] for table in data["freedoms"].values()} | {s["pin"] for s in data["slots"].values()}
        points = sorted({own for table in owners for own in table} - taken)
        pins = [own for own in points if sum(own in table for table in owners) == 2]
        if pins and rng.uniform() < 0.6:
            data["springs"][self.name("k")] = {"at": str(rng.choice(pins)), "driven": True}
        if len(data["bodies"]) > 1 and rng.uniform() < 0.6:
            pair = [str(body) for body in rng.choice(sorted(data["bodies"]), 2, replace=False)]
            data["springs"][self.name("k")] = {"bodies": pair, "stiffness": 20.0, "damping": 0.1, "free": 0.4}


def random_linkage(
    seed: int, kinds: tuple[str, ...] = KINDS, dyads: tuple[int, int] = (1, 4)
) -> tuple[dict[str, Any], dict[str, tuple[float, float, float]]]:
    """Return the tables of a random linkage's description and the places of its bodies (x, y, angle).

    The number of dyads is at least ``dyads[0]`` and less than ``dyads[1]``.
    """
    for attempt in range(100):
        maker = Maker(100 * seed + attempt)
        for _ in range(int(maker.rng.integers(1, 4))):
            maker.freedom()
        for _ in range(int(maker.rng.integers(*dyads))):
            maker.dyad(str(maker.rng.choice(kinds)))
        blocks = [slide["body"] for slide in maker.data["slides"].values()]
        # a block may have only one slide: two slides of one block would be parallel
        if len(set(blocks)) == len(blocks):
            break
    maker.actions()
    return maker.data, maker.places
