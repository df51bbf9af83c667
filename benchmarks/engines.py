"""Run the five-bar slider in two general multibody engines, MuJoCo and Exudyn, and measure time and error.

Each engine gets the formulation, the integrator and the solver settings that reach the accuracy in the shortest time. In MuJoCo
the closed loop is a tree of relative joints with one closing pin; in Exudyn it is planar bodies with three pins. No Python code
runs inside the integration. Accuracy is that of `benchmarks.engine_cases`.

This needs Exudyn 1.13 or later and MuJoCo 3.7 or later, whose ``connect`` constraint includes the velocity term J' q'. Without
this term the model is of no use: the error of u in MuJoCo 3.6 is 70 %.
"""

import contextlib
import io
import sys
from collections.abc import Callable, Iterator
from math import ceil, cos, inf, log, sin
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from benchmarks.engine_cases import Case, EngineRun, centre, relative_error, start, step_count
from linkwork.five_bar.parameters import Constants

Run = Callable[[Case, float], EngineRun]


# --- MuJoCo -------------------------------------------------------------------------------------------------------------

#: A flywheel of this inertia (kg.m2) on the crank's shaft prescribes the speed. The mechanism's torque of about 1 N.m changes
#: the speed by a relative 1e-11; the error of u is the same for inertias from 1e9 to 1e14. A velocity servo is no substitute:
#: a gain of 10 N.m.s leaves an error of 2e-3, a gain of 100 N.m.s is unstable under RK4 even at a step of 5e-5 s.
FLYWHEEL = 1e9

#: Rates (1/s) at which a closure error of the pin decays, critically damped, with prescribed speed and under torque. They are
#: the rates between 20 and 200 that allow the longest steps. The constraint on the pin's acceleration includes J' q', so that
#: only truncation errors decay in this way; a high rate is stiff and spoils the RK4 step.
CLOSURE_RATE_SPEED, CLOSURE_RATE_TORQUE = 30.0, 100.0

_MJCF = """
<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <option integrator="RK4" solver="Newton" jacobian="dense" tolerance="0" ls_iterations="4" gravity="{gx!r} {gy!r} 0">
    <flag contact="disable" limit="disable" frictionloss="disable" island="disable" warmstart="disable"
          sensor="disable" autoreset="disable" refsafe="disable"/>
  </option>
  <default><joint type="hinge" axis="0 0 1"/></default>
  <worldbody>
    <body>
      <joint name="crank" armature="{flywheel!r}" stiffness="{torsion!r}" springref="{switch_angle!r}"/>
      <inertial pos="{x2!r} {y2!r} 0" mass="{m2!r}" diaginertia="{i2!r} {i2!r} {i2!r}"/>
      <body pos="{l2!r} 0 0">
        <joint name="coupler"/>
        <inertial pos="{x3!r} {y3!r} 0" mass="{m3!r}" diaginertia="{i3!r} {i3!r} {i3!r}"/>
        <site name="coupler end" pos="{l3!r} 0 0"/>
      </body>
    </body>
    <body pos="{l1!r} 0 0">
      <joint name="slider" type="slide" axis="{ca!r} {sa!r} 0" stiffness="{k!r}" springref="{u0!r}" damping="{mu!r}"/>
      <inertial pos="0 0 0" mass="{m5!r}" diaginertia="1 1 1"/>
      <body>
        <joint name="rocker"/>
        <inertial pos="{x4!r} {y4!r} 0" mass="{m4!r}" diaginertia="{i4!r} {i4!r} {i4!r}"/>
        <site name="rocker end" pos="{l4!r} 0 0"/>
      </body>
    </body>
  </worldbody>
  <equality>
    <connect site1="coupler end" site2="rocker end" solref="{closure_stiffness!r} {closure_damping!r}"
             solimp="0.9999 0.9999 1"/>
  </equality>
</mujoco>
"""
_CRANK, _COUPLER, _SLIDER, _ROCKER = range(4)  # order of the joints in the tree

#: Mass and inertia of a massless link: a little above the least values that MuJoCo accepts for a moving body (kg, kg.m2).
_NEGLIGIBLE = 1e-12


def _mujoco_model(case: Case, iterations: int, *, stiffened: bool = True) -> tuple[Any, Any]:
    """Return MuJoCo's model of a case, and its data at the start of the run."""
    import mujoco

    q = case.parameters
    p = q.constants()
    rate = CLOSURE_RATE_TORQUE if case.crank_speed is None else CLOSURE_RATE_SPEED
    x2, y2 = centre(q.crank_cog_distance, q.crank_cog_angle)
    x3, y3 = centre(q.coupler_cog_distance, q.coupler_cog_angle)
    x4, y4 = centre(q.rocker_cog_distance, q.rocker_cog_angle)
    text = _MJCF.format(
        **{name: getattr(p, name) for name in ("l1", "l2", "l3", "l4", "ca", "sa", "gx", "gy", "k", "u0", "mu")},
        **{"x2": x2, "y2": y2, "x3": x3, "y3": y3, "x4": x4, "y4": y4},
        m2=max(p.m2, _NEGLIGIBLE),
        m3=max(p.m3, _NEGLIGIBLE),
        m4=max(p.m4, _NEGLIGIBLE),
        m5=max(p.m5, _NEGLIGIBLE),
        i2=max(q.crank_inertia - p.m2 * q.crank_cog_distance**2, _NEGLIGIBLE),
        i3=max(q.coupler_inertia, _NEGLIGIBLE),
        i4=max(q.rocker_inertia, _NEGLIGIBLE),
        flywheel=0.0 if case.crank_speed is None else FLYWHEEL,
        # T0 (1 - th2/switch_angle) is a spring on the crank, relaxed at the switch angle
        torsion=case.torque / case.switch_angle,
        switch_angle=case.switch_angle,
        closure_stiffness=-(rate**2),
        closure_damping=-2.0 * rate,
    )
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.iterations = iterations
    # MuJoCo softens the constraint in proportion to the bodies' inverse weight by (1 - d)/d. The impedance d is at most 0.9999,
    # which causes an error of 3e-5 in u. A smaller inverse weight stiffens the constraint; the rounding error that this causes
    # is removed by a second Newton iteration.
    if stiffened:
        model.body_invweight0 *= 1e-4 if iterations == 1 else 1e-6
    data = mujoco.MjData(model)
    s = start(case, p)
    data.qpos[:] = (0.0, s.th3, 0.0, s.th4)
    data.qvel[:] = (case.start_speed, s.w3 - case.start_speed, 0.0, s.w4)
    return model, data


def _mujoco_until_switch(model: Any, data: Any, case: Case, n: int) -> tuple[int, float | None]:
    """Take ``n`` steps, or fewer up to the switch angle; Newton's method shortens the last step to end at that angle.

    Returns the number of steps, and the time (s) from the switch to the end of the ``n`` steps, None if the switch angle is
    not reached.
    """
    import mujoco

    full = model.opt.timestep
    for taken in range(1, n + 1):
        qpos, qvel = data.qpos.copy(), data.qvel.copy()
        mujoco.mj_step(model, data)
        if data.qpos[_CRANK] < case.switch_angle:
            continue
        for _ in range(10):
            miss = data.qpos[_CRANK] - case.switch_angle
            if abs(miss) < 1e-14:
                break
            model.opt.timestep -= miss / data.qvel[_CRANK]
            data.qpos[:], data.qvel[:] = qpos, qvel
            mujoco.mj_step(model, data)
        model.jnt_stiffness[_CRANK] = 0.0
        return taken, (n + 1 - taken) * full - model.opt.timestep
    return n, None


def run_mujoco(case: Case, time_step: float, *, iterations: int = 1, stiffened: bool = True) -> EngineRun:
    """Run ``case`` in MuJoCo: RK4 on relative joints, stepped in C from sample to sample.

    ``iterations`` is the number of iterations of the constraint solver. With one iteration a step is cheapest, but the error
    does not fall below about 1e-7; with two it falls with the fourth power of the step to below 1e-9. If not ``stiffened``,
    the constraint is as soft as MuJoCo's model file makes it: the inverse weights of the compiled model stay unchanged.
    `mujoco.rollout` takes the same time per step.
    """
    import mujoco

    model, data = _mujoco_model(case, iterations, stiffened=stiffened)
    interval = case.duration / case.samples
    n_full = step_count(interval, time_step)
    u = np.zeros(case.samples + 1)
    steps = 0
    driven = case.torque != 0.0
    begin = process_time()
    for sample in range(1, case.samples + 1):
        n = n_full
        model.opt.timestep = interval / n
        if driven:
            taken, rest = _mujoco_until_switch(model, data, case, n)
            steps += taken
            n = 0
            if rest is not None:
                driven = False
                n = step_count(rest, time_step)
                model.opt.timestep = rest / n
        if n:
            mujoco.mj_step(model, data, n)
            steps += n
        u[sample] = data.qpos[_SLIDER]
    seconds = process_time() - begin
    label = "MuJoCo RK4" if stiffened else "MuJoCo RK4, by its model file alone"
    return EngineRun(seconds=seconds, error=relative_error(case, u), label=label, steps=steps)


# --- Exudyn -------------------------------------------------------------------------------------------------------------


def _import_exudyn() -> tuple[Any, Any]:
    """Import Exudyn's fast build, without range checks, and its item classes, silently; return both modules."""
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # type: ignore[attr-defined]
    with contextlib.redirect_stdout(io.StringIO()):
        import exudyn
        from exudyn import itemInterface
    return exudyn, itemInterface


class _Bar(NamedTuple):
    """A link as a planar body of Exudyn: its object, and the position of its centre of mass in the frame of the link."""

    body: Any
    x: float
    y: float


#: Indices of the coordinates of crank and slider in the vector of all coordinates; their nodes are the first two.
_EXUDYN_CRANK, _EXUDYN_SLIDER = 0, 1


class _Assembly:
    """A planar system of Exudyn, and its parts."""

    def __init__(self, gx: float, gy: float) -> None:
        self.exu, self.items = _import_exudyn()
        self.mbs = self.exu.SystemContainer().AddSystem()
        self.gx, self.gy = gx, gy
        self.ground = self.coordinate(self.mbs.AddNode(self.items.NodePointGround()))

    def coordinate(self, node: Any) -> Any:
        return self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))

    def point(self, body: Any, x: float, y: float = 0.0) -> Any:
        return self.mbs.AddMarker(self.items.MarkerBodyPosition(bodyNumber=body, localPosition=[x, y, 0.0]))

    def bar(
        self, x: float, angle: float, speed: float, w: float, m: float, inertia: float, g: tuple[float, float]
    ) -> _Bar:
        """Add a link as a planar body; ``g`` is its centre of mass in the frame of the link.

        The origin of that frame is at ``x`` on the x axis, its angle is ``angle``. The origin has the velocity ``speed`` along
        y; the link has the angular velocity ``w``.
        """
        rx, ry = cos(angle) * g[0] - sin(angle) * g[1], sin(angle) * g[0] + cos(angle) * g[1]
        node = self.mbs.AddNode(
            self.items.NodeRigidBody2D(
                referenceCoordinates=[x + rx, ry, angle], initialVelocities=[-w * ry, speed + w * rx, w]
            )
        )
        body = self.mbs.AddObject(self.items.ObjectRigidBody2D(mass=m, inertia=inertia, nodeNumber=node))
        if self.gx or self.gy:
            marker = self.mbs.AddMarker(self.items.MarkerBodyMass(bodyNumber=body))
            self.mbs.AddLoad(self.items.LoadMassProportional(markerNumber=marker, loadVector=[self.gx, self.gy, 0.0]))
        return _Bar(body, *g)

    def pin(self, a: Any, b: Any) -> None:
        self.mbs.AddObject(self.items.ObjectJointRevolute2D(markerNumbers=[a, b]))

    def spring(self, node: Any, **constants: float) -> Any:
        """Add a spring and damper between a node's coordinate and the ground."""
        return self.mbs.AddObject(
            self.items.ObjectConnectorCoordinateSpringDamper(
                markerNumbers=[self.ground, self.coordinate(node)], **constants
            )
        )

    def crank(self, case: Case, p: Constants) -> tuple[Any, Any]:
        """Add the crank; return its node and body."""
        q = case.parameters
        node = self.mbs.AddNode(self.items.Node1D(initialVelocities=[case.start_speed]))
        body = self.mbs.AddObject(self.items.ObjectRotationalMass1D(inertia=q.crank_inertia, nodeNumber=node))
        if p.mx2 or p.my2:
            marker = self.point(body, *centre(q.crank_cog_distance, q.crank_cog_angle))
            weight = [p.m2 * p.gx, p.m2 * p.gy, 0.0]
            self.mbs.AddLoad(self.items.LoadForceVector(markerNumber=marker, loadVector=weight))
        return node, body

    def slider(self, p: Constants) -> tuple[Any, Any]:
        """Add the slider with its spring and damper; return its node and body."""
        node = self.mbs.AddNode(self.items.Node1D())
        body = self.mbs.AddObject(
            self.items.ObjectMass1D(
                mass=p.m5,
                nodeNumber=node,
                referencePosition=[p.l1, 0.0, 0.0],
                referenceRotation=[[p.ca, -p.sa, 0.0], [p.sa, p.ca, 0.0], [0.0, 0.0, 1.0]],
            )
        )
        along_guide = p.m5 * (p.gx * p.ca + p.gy * p.sa)
        if along_guide:
            self.mbs.AddLoad(self.items.LoadCoordinate(markerNumber=self.coordinate(node), load=along_guide))
        self.spring(node, stiffness=p.k, damping=p.mu, offset=p.u0)
        return node, body

    def drive(self, case: Case, node: Any) -> Any:
        """Drive the crank at its prescribed speed, or by a torsion spring; return the spring, or None without one."""
        if case.crank_speed is not None:
            markers = [self.ground, self.coordinate(node)]
            self.mbs.AddObject(
                self.items.ObjectConnectorCoordinate(markerNumbers=markers, velocityLevel=True, offset=case.crank_speed)
            )
        elif case.torque:
            # T0 (1 - th2/switch_angle) is a spring on the crank, relaxed at the switch angle and then made inactive
            return self.spring(node, stiffness=case.torque / case.switch_angle, offset=case.switch_angle)
        return None


def _exudyn_model(case: Case) -> tuple[Any, Any, Any]:
    """Build the system at the start of the run; return it, the sensor of the slider position, and the torsion spring or None.

    Crank and slider have one coordinate each, a rotation and a translation, coupler and rocker three each: eight coordinates
    and six pin conditions. Four planar bodies with a prismatic joint (twelve coordinates, ten conditions) give the same
    numbers in twice the time; so do two kinematic trees with one pin.
    """
    q = case.parameters
    p = q.constants()
    s = start(case, p)
    made = _Assembly(p.gx, p.gy)
    crank_node, crank = made.crank(case, p)
    slider_node, slider = made.slider(p)
    of_coupler = centre(q.coupler_cog_distance, q.coupler_cog_angle)
    of_rocker = centre(q.rocker_cog_distance, q.rocker_cog_angle)
    coupler = made.bar(p.l2, s.th3, p.l2 * case.start_speed, s.w3, p.m3, q.coupler_inertia, of_coupler)
    rocker = made.bar(p.l1, s.th4, 0.0, s.w4, p.m4, q.rocker_inertia, of_rocker)
    made.pin(made.point(crank, p.l2), made.point(coupler.body, -coupler.x, -coupler.y))
    end_of_coupler = made.point(coupler.body, p.l3 - coupler.x, -coupler.y)
    made.pin(end_of_coupler, made.point(rocker.body, p.l4 - rocker.x, -rocker.y))
    made.pin(made.point(rocker.body, -rocker.x, -rocker.y), made.point(slider, 0.0))
    spring = made.drive(case, crank_node)
    sensor = made.mbs.AddSensor(
        made.items.SensorNode(
            nodeNumber=slider_node,
            storeInternal=True,
            writeToFile=False,
            outputVariableType=made.exu.OutputVariableType.Coordinates,
        )
    )
    made.mbs.Assemble()
    return made.mbs, sensor, spring


class _ExudynSolver:
    """A solver that integrates a run in pieces, each by one call of the engine; ``seconds`` is the total processor time."""

    def __init__(self, mbs: Any, newton_tolerance: float) -> None:
        self.exu, _ = _import_exudyn()
        self.mbs = mbs
        self.seconds = 0.0
        self.steps = 0
        self.settings = self.exu.SimulationSettings()
        self.settings.solution.file.write = False
        integration = self.settings.timeIntegration
        integration.solverType = self.exu.DynamicSolverType.TrapezoidalIndex2
        integration.adaptiveStep = False
        integration.generalizedAlpha.useNewmark = True
        integration.generalizedAlpha.useIndex2Constraints = True
        integration.newton.useModifiedNewton = False
        integration.newton.relativeTolerance = newton_tolerance
        integration.newton.absoluteTolerance = 1e-14

    def run(self, start: float, end: float, steps: int, sampling: float) -> None:
        """Integrate from the initial configuration in equal steps; the result becomes the current configuration.

        The run lasts from ``start`` to ``end``; the sensors store a value after each time ``sampling`` (all in s).
        """
        integration = self.settings.timeIntegration
        integration.startTime, integration.endTime, integration.numberOfSteps = start, end, steps
        self.settings.solution.sensors.writePeriod = sampling
        solver = self.exu.MainSolverImplicitSecondOrder()
        solver.InitializeSolver(self.mbs, self.settings)
        begin = process_time()
        finished = solver.SolveSteps(self.mbs, self.settings)
        self.seconds += process_time() - begin
        self.steps += steps
        solver.FinalizeSolver(self.mbs, self.settings)
        if not finished:
            raise ArithmeticError(f"Exudyn stopped between t = {start:g} s and {end:g} s")

    def state(self, which: str = "Current") -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates and velocities of the configuration ``which``: "Current", or "Initial" for the next start."""
        data, configuration = self.mbs.systemData, getattr(self.exu.ConfigurationType, which)
        return data.GetODE2Coordinates(configuration), data.GetODE2Coordinates_t(configuration)

    def set_start(self, state: tuple[np.ndarray, np.ndarray]) -> None:
        """Make ``state`` the initial configuration of the next piece."""
        data, initial = self.mbs.systemData, self.exu.ConfigurationType.Initial
        data.SetODE2Coordinates(state[0], initial)
        data.SetODE2Coordinates_t(state[1], initial)


def _exudyn_until_switch(case: Case, solver: _ExudynSolver, spring: Any, time_step: float) -> list[float]:
    """Return the slider positions (m) up to the first sample after the torque is switched off.

    Newton's method finds the time of the switch.
    """
    interval = case.duration / case.samples
    n = step_count(interval, time_step)
    u: list[float] = [0.0]
    while True:
        start = (len(u) - 1) * interval
        begin = solver.state("Initial")
        solver.run(start, start + interval, n, interval)
        q, qd = solver.state()
        if q[_EXUDYN_CRANK] >= case.switch_angle:
            break
        u.append(q[_EXUDYN_SLIDER])
        solver.set_start((q, qd))
    kept = solver.steps - n
    switch = start + interval
    for _ in range(10):
        miss = q[_EXUDYN_CRANK] - case.switch_angle
        if abs(miss) < 1e-10:
            break
        switch -= miss / qd[_EXUDYN_CRANK]
        solver.set_start(begin)
        n = step_count(switch - start, time_step)
        solver.run(start, switch, n, interval)
        q, qd = solver.state()
    solver.mbs.SetObjectParameter(spring, "activeConnector", False)
    solver.set_start((q, qd))
    rest = start + interval - switch
    solver.steps = kept + n
    solver.run(switch, start + interval, step_count(rest, time_step), interval)
    u.append(solver.state()[0][_EXUDYN_SLIDER])
    solver.set_start(solver.state())
    return u


def run_exudyn(case: Case, time_step: float, *, newton_tolerance: float = 1e-6) -> EngineRun:
    """Run ``case`` in Exudyn: the implicit trapezoidal rule with the constraints at velocity level, full Newton steps.

    The rule is of second order. So is generalised-alpha, but its numerical damping makes it 1.7 times less accurate. The
    explicit integrators accept no pins; with stiff springs for pins they need five times as long. With the default
    ``newton_tolerance`` a step takes one Newton iteration. At equal steps this is three times less accurate than with 1e-8; at
    equal accuracy it is as fast or faster.
    """
    mbs, sensor, spring = _exudyn_model(case)
    solver = _ExudynSolver(mbs, newton_tolerance)
    interval = case.duration / case.samples
    error = inf
    with contextlib.suppress(ArithmeticError):
        u = [0.0] if spring is None else _exudyn_until_switch(case, solver, spring, time_step)
        done = len(u) - 1
        steps = (case.samples - done) * step_count(interval, time_step)
        solver.run(done * interval, case.duration, steps, interval)
        u.extend(mbs.GetSensorStoredData(sensor)[done - case.samples :, 1])
        error = relative_error(case, np.array(u))
    return EngineRun(seconds=solver.seconds, error=error, label="Exudyn trapezoidal", steps=solver.steps)


# --- choice of the step ---------------------------------------------------------------------------------------------------


def time_steps(case: Case, first: float, last: float, ratio: float = 2.0**-0.25) -> Iterator[float]:
    """Yield a geometric series of time steps (s) from ``first`` to ``last``, each shortened to divide a sample interval."""
    interval = case.duration / case.samples
    count = ceil(log(last / first) / log(ratio) * (1.0 - 1e-9))
    fitted = (step_count(interval, first * ratio**i) for i in range(count + 1))
    return (interval / n for n in dict.fromkeys(fitted))


def fastest_run(run: Run, case: Case, time_step: float, repeats: int = 7) -> EngineRun:
    """Return the fastest of several equal runs, which the machine has disturbed least."""
    return min((run(case, time_step) for _ in range(repeats)), key=lambda result: result.seconds)


class Engine(NamedTuple):
    """An engine: its run, and the first and last time step of a series (s)."""

    run: Run
    first_step: float
    last_step: float


ENGINES: tuple[Engine, ...] = (Engine(run_mujoco, 2e-3, 1e-5), Engine(run_exudyn, 1e-3, 5e-6))
