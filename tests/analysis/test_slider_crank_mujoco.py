"""The slider-crank's motion against MuJoCo, a general engine for rigid bodies in joint coordinates, in two spatial cases.

MuJoCo gets the mechanism as bodies: a crank on a slide and a hinge, a rod on a ball joint, a slider on its guide, and the
rod's far end tied to the slider. Its mass matrix, bias forces and Jacobians give accelerations and the closing force at one
instant; its own simulation gives a motion.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis import simulate
from analysis.run import Inputs
from linkwork.slider_crank import published
from linkwork.slider_crank.parameters import InitialState, SliderCrankParameters

mujoco = pytest.importorskip("mujoco")

Array = NDArray[np.float64]

_OFFSET = published.parameters(10.0)
#: Mechanism, start, torque (N.m), axial force (N) or None where the shift is held, load (N).
CASES: dict[str, tuple[SliderCrankParameters, InitialState, float, float | None, float]] = {
    # Rahman's a4 = 10 in, S1 = 3.5 in under a torque, with gravity across the guide
    "offset and shift": (replace(_OFFSET, gravity_y=-9.81), published.initial(3.5), 20.0, None, -5.0),
    # twisted guide, crank out of balance, both freedoms free
    "twist, free shift": (
        replace(
            published.parameters(20.0, 310.0), crank_cog_y=0.03, crank_cog_z=-0.05, crank_product_xz=-0.08,
            crank_product_yz=-0.02, shift_stiffness=2e3, shift_damping=30.0, slider_stiffness=150.0,
            slider_spring_free_position=1.1, slider_damping=8.0, gravity_x=2.0, gravity_y=-9.0, gravity_z=1.5,
            slider_mass=12.0,
        ),
        replace(published.initial(2.0), shift_velocity=0.1),
        12.0,
        6.0,
        3.0,
    ),
}  # fmt: skip


def xml(p: SliderCrankParameters, initial: InitialState, *, held: bool) -> str:
    """The mechanism at rest at crank angle 0 and shift 0, its joints' coordinates zero but for the ball."""
    x, y, z = p.crank_cog_x, p.crank_cog_y, p.crank_cog_z
    # about the centre of mass, from the axes of frame 2; what turns about k alone does not feel the first two
    izz = p.crank_inertia - p.crank_mass * (x * x + y * y)
    ixz = -(p.crank_product_xz - p.crank_mass * x * z)
    iyz = -(p.crank_product_yz - p.crank_mass * y * z)
    ca, sa = cos(p.guide_twist), sin(p.guide_twist)
    shift = (
        ""
        if held
        else f"""<joint name="shift" type="slide" axis="0 0 1" stiffness="{p.shift_stiffness!r}"
        springref="{p.shift_spring_free_position!r}" damping="{p.shift_damping!r}"/>"""
    )
    height = initial.shift_position if held else 0.0
    thin = 1e-4 * max(p.rod_inertia, 1e-3)
    return f"""
<mujoco>
  <option gravity="{p.gravity_x!r} {p.gravity_y!r} {p.gravity_z!r}" timestep="2e-4" integrator="RK4" tolerance="0"
      iterations="200" solver="Newton"/>
  <compiler angle="radian" boundmass="0" boundinertia="0" balanceinertia="false"/>
  <worldbody>
    <body name="crank" pos="0 0 {height!r}">
      {shift}
      <joint name="crank" type="hinge" axis="0 0 1"/>
      <inertial pos="{x!r} {y!r} {z!r}" mass="{p.crank_mass!r}" fullinertia="{izz!r} {izz!r} {izz!r} 0 {ixz!r} {iyz!r}"/>
      <body name="rod" pos="{p.crank_length!r} 0 0">
        <joint name="ball" type="ball"/>
        <inertial pos="{p.rod_cog_distance!r} 0 0" mass="{p.rod_mass!r}"
            diaginertia="{thin!r} {p.rod_inertia!r} {p.rod_inertia!r}"/>
        <site name="end" pos="{p.rod_length!r} 0 0"/>
      </body>
    </body>
    <body name="slider" pos="{-p.guide_offset!r} 0 0">
      <joint name="slider" type="slide" axis="0 {-sa!r} {-ca!r}" stiffness="{p.slider_stiffness!r}"
          springref="{p.slider_spring_free_position!r}" damping="{p.slider_damping!r}"/>
      <inertial pos="{p.slider_cog_x!r} 0 0" mass="{p.slider_mass!r}" diaginertia="1 1 1"/>
      <site name="pin"/>
    </body>
  </worldbody>
  <equality>
    <connect site1="end" site2="pin" solref="-4e6 -4e3" solimp="0.9999 0.9999 0.001 0.5 2"/>
  </equality>
</mujoco>"""


class Engine:
    """MuJoCo's model and data of a case, set to a configuration of ours."""

    def __init__(self, name: str) -> None:
        self.p, self.initial, self.torque, self.force, self.load = CASES[name]
        self.held = self.force is None
        self.model = mujoco.MjModel.from_xml_string(xml(self.p, self.initial, held=self.held))
        self.data = mujoco.MjData(self.model)
        self.first = 0 if self.held else 1

    def place(self, row: dict[str, float]) -> None:
        """Set position and velocity from a row of our outputs."""
        d, first = self.data, self.first
        if not self.held:
            d.qpos[0], d.qvel[0] = row["shift.position"], row["shift.velocity"]
        d.qpos[first], d.qvel[first] = row["crank.angle"], row["crank.speed"]
        c, s = np.cos(row["crank.angle"]), np.sin(row["crank.angle"])
        to_crank = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        pins = [np.array([row[f"{pin}.{axis}"] for axis in "xyz"]) for pin in ("crank_pin", "slider_pin")]
        direction = to_crank @ (pins[1] - pins[0])
        # the shortest rotation from the first axis to the rod: any will do, the rod is round
        axis = np.cross([1.0, 0.0, 0.0], direction)
        angle = np.arctan2(np.linalg.norm(axis), direction[0])
        mujoco.mju_axisAngle2Quat(d.qpos[first + 1 : first + 5], axis / np.linalg.norm(axis), angle)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, d.qpos[first + 1 : first + 5])
        turn = np.array([row[f"rod.w{axis}"] for axis in "xyz"]) - [0.0, 0.0, row["crank.speed"]]
        d.qvel[first + 1 : first + 4] = rotation.reshape(3, 3).T @ to_crank @ turn
        d.qpos[-1], d.qvel[-1] = row["slider.position"], row["slider.velocity"]
        d.qfrc_applied[:] = 0.0
        d.qfrc_applied[first] = self.torque
        d.qfrc_applied[-1] = self.load
        if self.force is not None:
            d.qfrc_applied[0] = self.force

    def accelerations(self) -> tuple[Array, Array]:
        """Accelerations of the joints and the force of the slider on the rod, the loop held closed exactly."""
        m, d = self.model, self.data
        mujoco.mj_forward(m, d)
        nv = m.nv
        mass = np.empty((nv, nv))
        for column, unit in zip(mass, np.eye(nv)):
            mujoco.mj_mulM(m, d, column, unit)
        jacobian, rate = np.zeros((3, nv)), np.zeros((3, nv))
        for sign, name in ((1.0, "end"), (-1.0, "pin")):
            site = d.site(name)
            one, other = np.zeros((3, nv)), np.zeros((3, nv))
            body = m.site(name).bodyid[0]
            mujoco.mj_jac(m, d, one, None, site.xpos, body)
            mujoco.mj_jacDot(m, d, other, None, site.xpos, body)
            jacobian += sign * one
            rate += sign * other
        assert np.linalg.norm(d.site("end").xpos - d.site("pin").xpos) < 1e-12
        assert np.linalg.norm(jacobian @ d.qvel) < 1e-11
        system = np.block([[mass, -jacobian.T], [jacobian, np.zeros((3, 3))]])
        applied = d.qfrc_applied + d.qfrc_passive - d.qfrc_bias
        solution = np.linalg.solve(system, np.concatenate([applied, -rate @ d.qvel]))
        return solution[:nv], solution[nv:]


def ours(name: str, **options: Any) -> Any:
    p, initial, torque, force, load = CASES[name]
    inputs = Inputs(torque=torque, axial_force=force, load=load)
    return simulate(p, inputs, initial=initial, stop_time=0.8, step=0.02, tolerance=1e-12, **options)


@pytest.mark.parametrize("name", CASES)
def test_accelerations_and_the_closing_force_are_those_of_the_engine(name: str) -> None:
    run, engine = ours(name), Engine(name)
    assert run.status == 0
    for k in range(len(run)):
        row = {output: run[output][k] for output in run.names}
        engine.place(row)
        acceleration, force = engine.accelerations()
        size = max(1.0, np.abs(acceleration).max())
        assert acceleration[engine.first] == pytest.approx(row["crank.acceleration"], abs=1e-9 * size)
        assert acceleration[-1] == pytest.approx(row["slider.acceleration"], abs=1e-9 * size)
        if not engine.held:
            assert acceleration[0] == pytest.approx(row["shift.acceleration"], abs=1e-9 * size)
        wanted = [row[f"slider_pin.f{axis}"] for axis in "xyz"]
        assert force == pytest.approx(wanted, abs=1e-9 * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize("name", CASES)
def test_motion_is_that_of_the_engine(name: str) -> None:
    run, engine = ours(name), Engine(name)
    engine.place({output: run[output][0] for output in run.names})
    per_sample = round(0.02 / engine.model.opt.timestep)
    for k in range(1, len(run)):
        for _ in range(per_sample):
            mujoco.mj_step(engine.model, engine.data)
        assert engine.data.time == pytest.approx(run.time[k])
        # MuJoCo's closing constraint is a stiff spring with damping: how exactly it holds the loop is its own matter
        assert engine.data.qpos[engine.first] == pytest.approx(run["crank.angle"][k], abs=2e-4)
        assert engine.data.qpos[-1] == pytest.approx(run["slider.position"][k], abs=1e-4)
        if not engine.held:
            assert engine.data.qpos[0] == pytest.approx(run["shift.position"][k], abs=1e-4)
    assert abs(run["crank.angle"][-1] - run["crank.angle"][0]) > 1.0
