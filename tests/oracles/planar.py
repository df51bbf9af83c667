"""Planar linkages in all coordinates of their bodies: loop closure from the description, Lagrange multipliers for the joints.

Neither `linkwork.planar` nor the structure analysis is used. Each body has a place (x, y, angle), each joint has its
constraint equations; accelerations and joint forces follow from one linear system.
"""

from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import casadi
import numpy as np
import pint
from scipy.integrate import solve_ivp

from analysis.linkages.description import GROUND, Description
from linkwork.friction import FRICTION_FORCE, FRICTION_RATE, FRICTION_SPEED

_UNITS = pint.UnitRegistry()


def number(value: Any) -> float:
    """Return an entry as a number in SI units; it may be a text with a unit."""
    return float(_UNITS.Quantity(value).to_base_units().magnitude) if isinstance(value, str) else float(value)


def interpolated(rows: list[list[float]], x: Any) -> Any:
    """Return the piecewise linear interpolation of rows (x, y) at x; the first and last segments are extrapolated."""
    lines = [y0 + (y1 - y0) / (x1 - x0) * (x - x0) for (x0, y0), (x1, y1) in pairwise(rows)]
    found = lines[0]
    for (knot, _), line in zip(rows[1:], lines[1:]):
        found = casadi.if_else(x > knot, line, found)
    return found


def refined_solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve a system for several right-hand sides; it is scaled by powers of two and refined in extended precision.

    The matrix is symmetric but for signs.
    """
    scale = np.ones(len(matrix))
    for _ in range(3):
        scale /= np.sqrt(np.abs(matrix * np.outer(scale, scale)).max(axis=1))
    scale = np.ldexp(1.0, np.round(np.log2(scale)).astype(int))
    a, b = matrix * np.outer(scale, scale), right * scale[:, None]
    x = np.linalg.solve(a, b).astype(np.longdouble)
    for _ in range(2):
        x += np.linalg.solve(a, (b - a.astype(np.longdouble) @ x).astype(float))
    return x.astype(float) * scale[:, None]


class Solution(NamedTuple):
    """Accelerations of the freedoms, loads on them, joint forces and kinetic energy.

    ``forces`` are (x, y) for a pin, (force across, couple) for a slide, by joint. ``friction`` is the force along each slot
    that has friction, ``lost`` the power of all friction by joint forces, ``places`` the accelerations of the bodies' places.
    """

    accelerations: np.ndarray
    loads: np.ndarray
    forces: dict[str, np.ndarray]
    kinetic: float
    friction: dict[str, float]
    lost: float
    places: np.ndarray


class Multipliers:
    """The equations of motion of one linkage description."""

    def __init__(self, description: Description) -> None:
        self.d = description
        self.bodies = list(description.bodies)
        self.q = casadi.SX.sym("q", 3 * len(self.bodies))
        self.v = casadi.SX.sym("v", 3 * len(self.bodies))
        owners: dict[str, list[str]] = {own: [GROUND] for own in description.ground}
        for name, body in description.bodies.items():
            for own in body.all_points:
                owners.setdefault(own, []).append(name)
        self.owners = owners
        self.rows: dict[str, tuple[int, int]] = {}
        self.loaded = [load.point for load in description.loads]
        self.pushed = [*description.torques, *(name for name, s in description.springs.items() if s.driven)]
        #: Whole turns in the angles of torsion springs, where the linkage counts them.
        self.turns: dict[str, int] = {}
        rows: list[Any] = []

        def closed(name: str, *equations: Any) -> None:
            self.rows[name] = (len(rows), len(rows) + len(equations))
            rows.extend(equations)

        for own, of in owners.items():
            for body in of[1:]:
                first, second = self.at(of[0], own), self.at(body, own)
                closed(own if len(of) == 2 else f"{own} of {body}", first[0] - second[0], first[1] - second[1])
        for name, s in description.slides.items():
            (normal, start), (x, y) = self.line(s), casadi.vertsplit(self.pose(s.body))[:2]
            across = normal[0] * (x - start[0]) + normal[1] * (y - start[1])
            closed(name, across, self.pose(s.body)[2] - self.pose(s.on)[2] - s.direction)
        for name, t in description.slots.items():
            normal, start = self.line(t)
            x, y = self.at(owners[t.pin][0], t.pin)
            closed(name, normal[0] * (x - start[0]) + normal[1] * (y - start[1]))
        for name, g in description.gears.items():
            carrier = self.pose(self.carrier(*g.bodies))[2]
            a, b = (self.pose(body)[2] - carrier for body in g.bodies)
            closed(name, b - g.ratio * a - g.phase)
        for name, r in description.racks.items():
            _, slide, carrier = self.meshed(r)
            turn = self.pose(r.gear)[2] - self.pose(carrier)[2]
            closed(name, self.coordinate(slide) - r.radius * turn - r.offset)
        self.closure = casadi.vertcat(*rows)
        self.freedoms = casadi.vertcat(*(self.coordinate(f.joint) for f in description.freedoms.values()))
        both = casadi.vertcat(self.closure, self.freedoms)
        self.joints = casadi.Function("joints", [self.q], [both, casadi.jacobian(both, self.q)])
        rubbed = [casadi.jacobian(self.coordinate(name), self.q) for name in description.friction]
        self.along_friction = casadi.Function("along", [self.q], [casadi.vertcat(*rubbed)])
        #: The size of a joint force below which its friction is that of a force of this size.
        self.least = min(FRICTION_FORCE, 0.1 * sum(self.mass(name)[0] for name in self.bodies))

    def pose(self, body: str) -> Any:
        """Return the place (x, y, angle) of a body."""
        if body == GROUND:
            return casadi.SX(3, 1)
        n = self.bodies.index(body)
        return self.q[3 * n : 3 * n + 3]

    def at(self, body: str, own: str) -> tuple[Any, Any]:
        """Return the position of a point of a body."""
        x, y = self.d.ground[own] if body == GROUND else self.d.bodies[body].all_points[own]
        px, py, angle = casadi.vertsplit(self.pose(body))
        return px + x * casadi.cos(angle) - y * casadi.sin(angle), py + x * casadi.sin(angle) + y * casadi.cos(angle)

    def line(self, s: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """Return the normal, and a point, of the line of a slide or slot."""
        angle = self.pose(s.on)[2] + s.direction
        return (-casadi.sin(angle), casadi.cos(angle)), self.at(s.on, s.through)

    def carrier(self, one: str, other: str) -> str:
        """Return the body to which both gears are pinned."""
        pinned = [{b for of in self.owners.values() if gear in of for b in of} for gear in (one, other)]
        return next(iter((pinned[0] & pinned[1]) - {one, other}))

    def meshed(self, r: Any) -> tuple[str, str, str]:
        """Return the pin of a gear, the slide of its rack, and the body that carries both."""
        for slide, s in self.d.slides.items():
            for carrier in {s.on, s.body} - {r.rack} if r.rack in (s.on, s.body) else ():
                for pin, of in self.owners.items():
                    if {carrier, r.gear} <= set(of):
                        return pin, slide, carrier
        raise AssertionError(r)

    def coordinate(self, joint: str) -> Any:
        """Return the coordinate of a joint."""
        if joint in self.d.slides or joint in self.d.slots:
            if joint in self.d.slides:
                s: Any = self.d.slides[joint]
                x, y, _ = casadi.vertsplit(self.pose(s.body))
            else:
                s = self.d.slots[joint]
                x, y = self.at(self.moving(s.pin), s.pin)
            normal, start = self.line(s)
            return normal[1] * (x - start[0]) - normal[0] * (y - start[1])
        first, second = self.owners[joint]
        return self.pose(second)[2] - self.pose(first)[2]

    def moving(self, own: str) -> str:
        """Return the body on which a force at a point acts: of all bodies pinned there, the first that moves."""
        return next((body for body in self.owners[own] if body != GROUND), GROUND)

    def stretch(self, s: Any) -> Any:
        """Return the length or angle that a spring measures."""
        if s.at:
            return self.coordinate(s.at)
        if s.bodies:
            return self.pose(s.bodies[1])[2] - self.pose(s.bodies[0])[2]
        (ax, ay), (bx, by) = (self.at(self.moving(own), own) for own in s.between)
        return casadi.sqrt((bx - ax) ** 2 + (by - ay) ** 2)

    def mass(self, name: str) -> tuple[float, tuple[float, float], float]:
        """Return mass, centre of mass in the body's frame, and moment of inertia of a body."""
        body = self.d.bodies[name]
        if body.section is not None:
            mass, centre, inertia = body.section.properties(body.length)
            return (mass, centre, inertia) if body.mass is None else (body.mass, centre, inertia * body.mass / mass)
        return body.mass or 0.0, body.cog if body.cog is not None else (0.5 * body.length, 0.0), body.inertia or 0.0

    def centre(self, name: str) -> tuple[Any, Any]:
        """Return the position of a body's centre of mass."""
        x, y = self.mass(name)[1]
        px, py, angle = casadi.vertsplit(self.pose(name))
        return px + x * casadi.cos(angle) - y * casadi.sin(angle), py + x * casadi.sin(angle) + y * casadi.cos(angle)

    def value(self, expression: Any, q: np.ndarray) -> np.ndarray:
        """Return the values of an expression in the places of the bodies at places q; shape (n,)."""
        return np.asarray(casadi.Function("value", [self.q], [expression])(q)).ravel()

    def residual(self, q: np.ndarray) -> float:
        """Return the largest closure error at places q."""
        return float(np.abs(self.value(self.closure, q)).max(initial=0.0))

    def share(self, forces: dict[str, np.ndarray], q: np.ndarray, gear: Any, couple: float) -> None:
        """Replace the couple between two gears, as closure gives it, by a force at their pitch point; change the pin forces."""
        carrier = self.carrier(*gear.bodies)
        pins = [next(own for own, of in self.owners.items() if {carrier, body} <= set(of)) for body in gear.bodies]
        first, second = (self.value(casadi.vertcat(*self.at(carrier, own)), q) for own in pins)
        if gear.ratio == 1.0:
            return
        pitch = first + gear.ratio / (gear.ratio - 1.0) * (second - first)
        lever = pitch - second
        force = couple / (lever @ lever) * np.array([-lever[1], lever[0]])
        for own, body, sign in ((pins[1], gear.bodies[1], -1.0), (pins[0], gear.bodies[0], 1.0)):
            if own in forces:
                forces[own] = forces[own] + sign * force * (1.0 if self.owners[own][0] == body else -1.0)

    def pull(self, forces: dict[str, np.ndarray], q: np.ndarray, rack: Any, pull: float) -> None:
        """Replace the force on the block and the couple on the gear, as closure gives them, by a force at the pitch point."""
        pin, name, carrier = self.meshed(rack)
        s = self.d.slides[name]
        angle = float(self.value(self.pose(s.on)[2] + s.direction, q)[0])
        along = np.array([np.cos(angle), np.sin(angle)])
        centre, block = self.value(casadi.vertcat(*self.at(carrier, pin)), q), self.value(self.pose(s.body)[:2], q)
        side = 1.0 if s.body == rack.rack else -1.0
        pitch = centre + side * rack.radius * np.array([along[1], -along[0]])
        arm = pitch - block
        forces[name] = forces[name] - np.array([0.0, pull * (arm[0] * along[1] - arm[1] * along[0])])
        if pin in forces:
            first = 1.0 if self.owners[pin][0] == rack.gear else -1.0
            forces[pin] = forces[pin] + first * side * pull * along
        for body, sign in ((rack.gear, -1.0), (carrier, 1.0)):
            if (own := f"{pin} of {body}") in forces:
                forces[own] = forces[own] + sign * side * pull * along

    def placed(self, coordinates: np.ndarray, guess: np.ndarray, sweeps: int = 20) -> np.ndarray:
        """Return the places of the bodies at given coordinates of the freedoms, by Newton's method from a guess."""
        q = guess
        for _ in range(sweeps):
            residual, jacobian = (np.asarray(a) for a in self.joints(q))
            residual[len(residual) - len(coordinates) :, 0] -= coordinates
            q = q - np.linalg.solve(jacobian, residual[:, 0])
            if np.abs(residual).max() < 1e-13:
                return q
        return q

    @cached_property
    def equations(self) -> Any:
        """A function of places, velocities, and what `given` returns.

        It returns the Jacobian of closure and freedoms, their drift, the mass matrix, the generalised forces and the kinetic
        energy.
        """
        given = casadi.SX.sym("given", 2 * len(self.loaded) + len(self.pushed) + len(self.d.springs))
        acting = iter(casadi.vertsplit(given) if given.numel() else [])
        points = {own: (next(acting), next(acting)) for own in self.loaded}
        forces = {name: next(acting) for name in self.pushed}
        turns = {name: next(acting) for name in self.d.springs}
        both = casadi.vertcat(self.closure, self.freedoms)
        jacobian = casadi.jacobian(both, self.q)
        drift = casadi.jtimes(casadi.jtimes(both, self.q, self.v), self.q, self.v)
        kinetic = casadi.SX(0)
        for n, name in enumerate(self.bodies):
            mass, _, inertia = self.mass(name)
            vx, vy = (casadi.jtimes(c, self.q, self.v) for c in self.centre(name))
            kinetic += 0.5 * mass * (vx**2 + vy**2) + 0.5 * inertia * self.v[3 * n + 2] ** 2
        momentum = casadi.gradient(kinetic, self.v)
        force = casadi.gradient(kinetic, self.q) - casadi.jtimes(momentum, self.q, self.v)
        g = self.d.gravity * np.array([np.cos(self.d.gravity_direction), np.sin(self.d.gravity_direction)])
        for name in self.bodies:
            for component, c in zip(g, self.centre(name)):
                force += self.mass(name)[0] * component * casadi.gradient(c, self.q)
        freed = {freedom.joint for freedom in self.d.freedoms.values()}
        for name, s in self.d.springs.items():
            measure = self.stretch(s)
            x, v = measure - number(s.free), casadi.jtimes(measure, self.q, self.v)
            about = s.bodies or s.at in self.owners
            if about and s.at not in freed:
                # an angle that is no freedom's coordinate is known only up to whole turns
                x = casadi.atan2(casadi.sin(x), casadi.cos(x)) + 2.0 * np.pi * turns[name]
            known = {own: value for own, (value, _) in s.constants.items()}
            functions = {"fabs": casadi.fabs, "tanh": casadi.tanh}
            if isinstance(s.law, tuple):
                law = interpolated([[number(value) for value in row] for row in s.law], x)
            else:
                law = eval(s.law, {"x": x, "v": v, **functions, **known}) if s.law else 0.0
            slow = FRICTION_RATE if about else FRICTION_SPEED
            law += number(s.friction) * casadi.tanh(v / slow)
            pull = number(s.stiffness) * x + number(s.damping) * v + law - forces.get(name, 0.0)
            force -= pull * casadi.gradient(measure, self.q)
        for name in self.d.torques:
            force += forces[name] * casadi.gradient(self.pose(name)[2], self.q)
        frames = {load.point: load.frame for load in self.d.loads}
        for own, (fx, fy) in points.items():
            x, y = self.at(self.moving(own), own)
            if frames[own] == "body":
                angle = self.pose(self.moving(own))[2]
                c, s = casadi.cos(angle), casadi.sin(angle)
                fx, fy = c * fx - s * fy, s * fx + c * fy
            force += fx * casadi.gradient(x, self.q) + fy * casadi.gradient(y, self.q)
        inertia_of = casadi.jacobian(momentum, self.v)
        return casadi.Function("f", [self.q, self.v, given], [jacobian, drift, inertia_of, force, kinetic])

    def given(self, points: Mapping[str, tuple[float, float]], forces: Mapping[str, float]) -> list[float]:
        """Return forces on points, torques on bodies and forces of driven springs, and the turns of springs, in their order."""
        loads = [part for own in self.loaded for part in points.get(own, (0.0, 0.0))]
        turns = [self.turns.get(name, 0) for name in self.d.springs]
        return [*loads, *(forces.get(name, 0.0) for name in self.pushed), *turns]

    def rubbing(self, q: np.ndarray, v: np.ndarray) -> dict[str, tuple[float, np.ndarray]]:
        """Return the friction of each joint per newton of joint force: along its coordinate, and in all coordinates."""
        found = {}
        for (name, value), along in zip(self.d.friction.items(), np.asarray(self.along_friction(q))):
            slow = FRICTION_RATE if name in self.owners else FRICTION_SPEED
            rub = -number(value) * float(np.tanh(along @ v / slow))
            found[name] = rub, rub * along
        return found

    def solve(
        self,
        q: np.ndarray,
        rates: np.ndarray,
        loads: np.ndarray,
        commanded: Mapping[int, float],
        points: Mapping[str, tuple[float, float]],
        forces: Mapping[str, float],
    ) -> Solution:
        """Solve for accelerations and forces at places q, given the rates of the freedoms.

        Freedoms have the given loads, or commanded accelerations by their index. ``points`` are forces on points, ``forces``
        torques on bodies and forces of driven springs, by name.
        """
        acting = self.given(points, forces)
        j = np.asarray(self.joints(q)[1])
        size, count = self.closure.numel(), self.freedoms.numel()
        v = np.linalg.solve(j, np.concatenate([np.zeros(size), rates]))
        j, d, m, right, energy = (np.asarray(a) for a in self.equations(q, v, acting))
        closed, along = j[:size], j[size:]
        held = sorted(commanded)
        free = [n for n in range(count) if n not in commanded]
        constraints = np.concatenate([closed, along[held]])
        total = len(q) + size + len(held)
        matrix = np.zeros((total, total))
        matrix[: len(q), : len(q)] = m
        matrix[: len(q), len(q) :] = -constraints.T
        matrix[len(q) :, : len(q)] = constraints
        wanted = np.concatenate([-d[:size, 0], [commanded[n] - d[size + n, 0] for n in held]])
        rubbing = self.rubbing(q, v)
        columns = [np.concatenate([right[:, 0] + along[free].T @ loads[free], wanted])]
        columns += [np.concatenate([rub, np.zeros(len(wanted))]) for _, rub in rubbing.values()]
        responses = refined_solve(matrix, np.array(columns).T)

        def joints_of(multipliers: np.ndarray) -> dict[str, np.ndarray]:
            """The joint forces, which are linear in the multipliers."""
            joints = {name: multipliers[a:b] for name, (a, b) in self.rows.items()}
            for name, gear in self.d.gears.items():
                self.share(joints, q, gear, float(joints[name][0]))
            for name, rack in self.d.racks.items():
                self.pull(joints, q, rack, float(joints[name][0]))
            return joints

        sizes = np.zeros(len(rubbing))
        if rubbing:
            of = [joints_of(column) for column in responses[len(q) :].T]
            parts = [np.array([c[name] if name in self.owners else c[name][:1] for c in of]) for name in rubbing]

            def made(sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
                """The sizes of the joint forces that make friction where they have these sizes, and their derivatives."""
                forces = [[1.0, *sizes] @ part for part in parts]
                found = np.array([np.hypot(self.least, np.linalg.norm(force)) for force in forces])
                return found, np.array([part[1:] @ force for part, force in zip(parts, forces)]) / found[:, None]

            for _ in range(50):
                found, slopes = made(sizes)
                change = np.linalg.solve(np.eye(len(sizes)) - slopes, found - sizes)
                sizes = sizes + change
                if np.abs(change).max() < 1e-14 * sizes.max():
                    break
            assert np.abs(made(sizes)[0] - sizes).max() < 1e-10 * sizes.max()
        solution = responses @ [1.0, *sizes]
        multipliers = solution[len(q) :]
        joints = joints_of(multipliers)
        rubbed = sum((size * rub for size, (_, rub) in zip(sizes, rubbing.values())), np.zeros(len(q)))
        accelerations = along @ solution[: len(q)] + d[size:, 0]
        all_loads = loads.copy()
        all_loads[held] = multipliers[size:]
        along_slots = {name: size * rubbing[name][0] for name, size in zip(rubbing, sizes) if name in self.d.slots}
        lost = -float(rubbed @ v)
        return Solution(accelerations, all_loads, joints, float(energy[0, 0]), along_slots, lost, solution[: len(q)])

    def motion(self, commanded: tuple[int, ...]) -> Any:
        """Return a function of coordinates and rates of the freedoms, a guess, loads and what `given` returns.

        It returns accelerations and places where no joint has friction.
        """
        size, count, total = self.closure.numel(), self.freedoms.numel(), 3 * len(self.bodies)
        free = [n for n in range(count) if n not in commanded]
        x, rates, loads = (casadi.MX.sym(name, count) for name in ("x", "rates", "loads"))
        guess, given = casadi.MX.sym("guess", total), casadi.MX.sym("given", self.equations.numel_in(2))
        wanted = casadi.SX.sym("wanted", count)
        error = casadi.vertcat(self.closure, self.freedoms - wanted)
        place = casadi.Function("place", [self.q, wanted], [error])
        q = casadi.rootfinder("placed", "newton", place, {"abstol": 1e-13, "max_iter": 20})(guess, x)
        v = casadi.solve(self.joints(q)[1], casadi.vertcat(casadi.MX(size, 1), rates), "qr")
        j, drift, mass, force, _ = self.equations(q, v, given)
        constraints = j[[*range(size), *(size + n for n in commanded)], :]
        held = casadi.MX(constraints.shape[0], constraints.shape[0])
        matrix = casadi.blockcat([[mass, -constraints.T], [constraints, held]])
        right = casadi.vertcat(force, -drift[:size], *(-drift[size + n] for n in commanded))
        if free:
            right[:total] += casadi.mtimes(j[[size + n for n in free], :].T, loads[free])
        solution = casadi.solve(matrix, right, "qr")
        accelerations = casadi.mtimes(j[size:, :], solution[:total]) + drift[size:]
        return casadi.Function("motion", [x, rates, guess, loads, given], [accelerations, q])

    def on_bodies(
        self, solution: Solution, pulls: Mapping[str, float], q: np.ndarray
    ) -> dict[tuple[str, str], np.ndarray]:
        """Return the total force (x, y) of all other bodies on each body at each of its pins.

        Forces of slots and their friction are included. ``pulls`` are the forces of springs along slots, which act on their
        blocks.
        """
        forces = solution.forces
        found: dict[tuple[str, str], np.ndarray] = {}

        def add(own: str, body: str, force: np.ndarray) -> None:
            found[own, body] = found.get((own, body), np.zeros(2)) + force

        for own, of in self.owners.items():
            for body in of[1:]:
                force = forces[own if len(of) == 2 else f"{own} of {body}"]
                add(own, of[0], force)
                add(own, body, -force)
        for name, slot in self.d.slots.items():
            x, y = self.value(casadi.vertcat(*self.line(slot)[0]), q)
            across, along = float(forces[name][0]), solution.friction.get(name, 0.0) + pulls.get(name, 0.0)
            add(slot.pin, self.owners[slot.pin][0], np.array([across * x + along * y, across * y - along * x]))
        return found

    def run(
        self,
        coordinates: np.ndarray,
        rates: np.ndarray,
        guess: np.ndarray,
        time: np.ndarray,
        *,
        commanded: tuple[int, ...] = (),
        loads: np.ndarray | None = None,
        forces: Mapping[str, float] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Integrate from time[0] under constant loads; return coordinates and rates of the freedoms at all times.

        Freedoms with an index in ``commanded`` keep their rates. ``guess`` is near the places of the bodies at the start.
        """
        n, last = len(coordinates), [guess]
        points = {load.point: (0.0, 0.0) for load in self.d.loads}
        acting, given = np.zeros(n) if loads is None else loads, self.given(points, forces or {})
        motion = self.motion(commanded)

        def derivative(t: float, z: np.ndarray) -> np.ndarray:
            if self.d.friction:
                last[0] = self.placed(z[:n], last[0])
                found = self.solve(last[0], z[n:], acting, dict.fromkeys(commanded, 0.0), points, forces or {})
                return np.concatenate([z[n:], found.accelerations])
            accelerations, last[0] = motion(z[:n], z[n:], last[0], acting, given)
            return np.concatenate([z[n:], np.asarray(accelerations)[:, 0]])

        start, span = np.concatenate([coordinates, rates]), (time[0], time[-1])
        z = solve_ivp(derivative, span, start, method="DOP853", t_eval=time, rtol=1e-11, atol=1e-12).y
        return z[:n], z[n:]
