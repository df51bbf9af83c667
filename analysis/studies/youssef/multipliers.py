"""Chapter II: the equations of motion with Lagrange's multipliers, eqs (2.1) to (3.10), which are pin forces.

The equations are exactly those of the thesis; their results are compared with those of the plant, which has no multipliers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.five_bar import dynamics, kinematics

from ...run import Inputs, TorsionBar, simulate
from ...units import RAD_S_PER_RPM
from ..statements import Case, FloatArray, Statement, at_most, statement
from .runs import SPEED, table_3_1

#: The mechanism, its speed (rad/s), torque of a launch (N.m), and greatest relative rounding error.
TABLE, OMEGA = table_3_1(1e6), SPEED * RAD_S_PER_RPM
TORQUE, ROUNDING = 10.0, 1e-9
#: Mechanism with all the lengths and angles of Fig 2.1, and without a spring; force F1 at P (N, x + iy) and force F2 (N).
FULL = replace(
    TABLE, slider_stiffness=0.0, crank_mass=0.15, crank_cog_distance=0.02, coupler_cog_angle=0.1, slider_guide_angle=0.2,
    ground_inclination=0.3, coupler_point_distance=0.06, coupler_point_angle=0.4,
)  # fmt: skip
LOAD, FORCE = 3.0 - 2.0j, 4.0


def solve_multipliers(q: ArrayLike, qd: ArrayLike, torque: float | None = None) -> FloatArray:
    """Solve A W = B, eqs (3.1), (3.8), (3.10), for W at q = (th2, th3, th4, u) and q' = ``qd`` (SI).

    W = (lambda3, lambda2, lambda1, u'', th4'', th3''). If a torque acts on the crank, th2'' takes the place of lambda3 (3.2.2).
    """
    q, qd, p = np.asarray(q), np.asarray(qd), TABLE
    m3, m4, r3, r4, g = p.coupler_mass, p.rocker_mass, p.coupler_cog_distance, p.rocker_cog_distance, p.gravity
    (x2, x3, x4), (y2, y3, y4) = (
        (p.crank_length, p.coupler_length, p.rocker_length) * f(q[:3]) for f in (np.cos, np.sin)
    )
    w2, w3, w4 = qd[:3] ** 2
    couple = m3 * p.crank_length * r3 * np.exp(1j * (q[0] - q[1]))
    lift4, sway4 = m4 * r4 * np.sin(q[2]), m4 * r4 * np.cos(q[2])
    a = [
        [-1.0, -x2, y2, 0.0, 0.0, couple.real],
        [0.0, -x3, y3, 0.0, 0.0, p.coupler_inertia + m3 * r3**2],
        [0.0, x4, -y4, -lift4, p.rocker_inertia + m4 * r4**2, 0.0],
        [0.0, 0.0, 1.0, m4 + p.slider_mass, -lift4, 0.0],
        [0.0, 0.0, 0.0, 1.0, -y4, y3],
        [0.0, 0.0, 0.0, 0.0, -x4, x3],
    ]
    b = [
        -m3 * g * x2 - couple.imag * w3,
        -m3 * g * r3 * np.cos(q[1]) + couple.imag * w2,
        -g * sway4,
        -p.slider_damping * qd[3] - p.slider_stiffness * q[3] + sway4 * w4,
        -x2 * w2 - x3 * w3 + x4 * w4,
        y2 * w2 + y3 * w3 - y4 * w4,
    ]
    if torque is not None:
        for row, entry in ((0, p.crank_inertia + m3 * p.crank_length**2), (1, couple.real), (4, y2), (5, x2)):
            a[row][0] = entry
        b[0] += torque
    unknowns: FloatArray = np.linalg.solve(a, b)
    return unknowns


def chapter_2_residuals() -> dict[str, float]:
    """Return the greatest residual of each equation (2.11) to (2.21) in motions of the plant, relative to its greatest term.

    The crank turns at constant speed, and then under a torque.
    """
    p, worst, load = FULL.constants(), dict[str, float](), LOAD * np.exp(-1j * FULL.ground_inclination)
    for drive, th in ((drive, th) for drive in (1.0, 0.0) for th in np.linspace(0.0, 6.0, 25).tolist()):
        u, w, v = 0.01 * cos(2.0 * th), OMEGA, 0.3 * sin(th + 1.0)
        state, inputs = (th, u, w, v, 0.0, 0.0), dynamics.Inputs(drive, TORQUE, 0.0, FORCE, load.real, load.imag)
        g = kinematics.position(th, u, p)
        m = dynamics.motion(g, kinematics.coefficients(g, p), state, inputs, p)
        pins = dynamics.reactions(g, state, m, inputs, p)
        for name, terms in chapter_2_terms(th, kinematics.link_angles(g, p), w, v, m, pins).items():
            # (2.11), (2.12), (2.15) and (2.16) are for constant speed, (2.18) to (2.21) for a torque
            if (name in ("(2.13)", "(2.14)")) or (name < "(2.17)") == bool(drive):
                worst[name] = max(worst.get(name, 0.0), abs(sum(terms)) / max(map(abs, terms)))
    return worst


def chapter_2_terms(
    th2: float, links: tuple[float, float], w: float, v: float, m: dynamics.Motion, pins: dynamics.Reactions
) -> dict[str, tuple[float, ...]]:
    """Return the terms of each equation (2.11) to (2.21) as in the scanned text, by the equation's number.

    ``links`` are th3 and th4 + alpha (rad), ``w`` is the crank speed (rad/s), ``v`` the slider velocity (m/s).
    """
    q, p, (th3, th4), g, x, y = FULL, FULL.constants(), links, FULL.gravity, pins.cx, pins.cy
    alpha, alpha1, swing = q.slider_guide_angle, q.ground_inclination, th2 - th3 - q.coupler_cog_angle
    tilt2, tilt3, point = th2 + alpha1, th3 + q.coupler_cog_angle + alpha1, th3 + q.coupler_point_angle + alpha1
    m3r3, m4r4 = q.coupler_mass * q.coupler_cog_distance, q.rocker_mass * q.rocker_cog_distance
    (x2, y2), (x3, y3), (x4, y4) = (
        (length * cos(at), length * sin(at)) for length, at in ((p.l2, th2), (p.l3, th3), (p.l4, th4))
    )
    crank = (
        m3r3 * p.l2 * cos(swing) * m.e3,
        m3r3 * p.l2 * sin(swing) * m.w3**2,
        x * y2,
        -y * x2,
        -m.torque,
        (p.m2 * q.crank_cog_distance + p.m3 * p.l2) * g * cos(tilt2),
        LOAD.real * p.l2 * sin(tilt2),
        -LOAD.imag * p.l2 * cos(tilt2),
    )
    coupler = (
        p.i3b * m.e3,
        -m3r3 * p.l2 * sin(swing) * w**2,
        x * y3,
        -y * x3,
        m3r3 * g * cos(tilt3),
        LOAD.real * q.coupler_point_distance * sin(point),
        -LOAD.imag * q.coupler_point_distance * cos(point),
    )
    slider = (x * cos(alpha), y * sin(alpha), p.m45 * g * sin(alpha + alpha1), -FORCE, p.mu * v)
    e2, a = m.crank_acceleration, m.slider_acceleration
    along = (y3 * m.e3, a * cos(alpha), x2 * w**2, x3 * m.w3**2, -x4 * m.w4**2)
    across = (x3 * m.e3, -x4 * m.e4, -a * sin(alpha), -y2 * w**2, -y3 * m.w3**2, y4 * m.w4**2)
    sin4, cos4 = sin(th4 - alpha), cos(th4 - alpha)
    return {
        "(2.11)": crank,
        "(2.12)": coupler,
        "(2.13)": (p.i4d * m.e4, -m4r4 * sin4 * a, -x * y4, y * x4, m4r4 * g * cos(th4 + alpha1)),
        "(2.14)": (p.m45 * a, -m4r4 * sin4 * m.e4, -m4r4 * cos4 * m.w4**2, *slider),
        "(2.15)": (*along, -y4 * m.e4),
        "(2.16)": across,
        "(2.18)": (p.i2b * e2, *crank),
        "(2.19)": (m3r3 * p.l2 * cos(swing) * e2, *coupler),
        "(2.20)": (y2 * e2, *along, -x4 * m.e4),
        "(2.21)": (x2 * e2, *across),
    }


def closed_loop_state(crank: float, u: float, speed: float, velocity: float) -> tuple[FloatArray, FloatArray]:
    """Return q and q' of the closed loop, eqs (2.1) and (2.4), at a crank angle, u and their rates (SI)."""
    p = TABLE.constants()
    g = kinematics.position(crank, u, p)
    k = kinematics.coefficients(g, p)
    rates = [speed, k.k32 * speed + k.k3u * velocity, k.k42 * speed + k.k4u * velocity, velocity]
    return np.array([crank, *kinematics.link_angles(g, p), u]), np.array(rates)


def broken_loop_forces(q: ArrayLike, qd: ArrayLike) -> NDArray[np.complex128]:
    """Return the multipliers of the loop (N, x + iy) where it is broken at A, B, C and D in turn, at constant crank speed.

    q = (th2, th3, th4, u) and q' = ``qd`` (SI). The links before the broken joint hang from A, the others from the slider, as
    in Fig 2.3. A multiplier is the force on the link before the joint.
    """
    q, qd, p = np.asarray(q), np.asarray(qd), TABLE
    vectors = np.array([p.crank_length, p.coupler_length, p.rocker_length, 0.0]) * np.exp(1j * np.append(q[:3], 0.0))
    slopes, bend = 1j * vectors + np.array([0.0, 0.0, 0.0, 1.0]), -vectors * qd**2
    place3, place4 = p.coupler_cog_distance / p.coupler_length, p.rocker_cog_distance / p.rocker_length
    # shares of the vectors of crank, coupler, rocker and slider in the centres of mass, from A and from the slider
    coupler = ((1.0, place3, 0.0, 0.0), (0.0, place3 - 1.0, 1.0, 1.0))
    rocker = ((1.0, 1.0, place4 - 1.0, 0.0), (0.0, 0.0, place4, 1.0))
    loop = np.array([1.0, 1.0, -1.0, -1.0])
    found = []
    for joint in range(4):
        mass, force = np.diag([p.crank_inertia, p.coupler_inertia, p.rocker_inertia, p.slider_mass]), np.zeros(4)
        force[3] = -p.slider_stiffness * q[3] - p.slider_damping * qd[3]
        for m, shares in ((p.coupler_mass, coupler[joint < 2]), (p.rocker_mass, rocker[joint < 3])):
            place = shares * slopes
            mass += m * np.real(np.outer(place.conj(), place))
            force -= m * np.real(place.conj() * (shares @ bend + 1j * p.gravity))
        closing = np.array([(loop * slopes).real, (loop * slopes).imag, [1.0, 0.0, 0.0, 0.0]])
        whole = np.block([[mass, -closing.T], [closing, np.zeros((3, 3))]])
        unknowns = np.linalg.solve(whole, np.concatenate([force, [-(loop @ bend).real, -(loop @ bend).imag, 0.0]]))
        found.append(complex(*unknowns[4:6]))
    return np.array(found)


def judge_broken_loops() -> tuple[Case, ...]:
    """Compare the multipliers of a loop broken at each joint with the pin forces of the plant, at constant speed."""
    p, multipliers, pins = TABLE.constants(), [], []
    for th in np.linspace(0.0, 6.0, 25).tolist():
        u, v = 0.01 * cos(2.0 * th), 0.3 * sin(th + 1.0)
        state, inputs = (th, u, OMEGA, v, 0.0, 0.0), dynamics.NO_INPUTS._replace(speed_drive=1.0)
        g = kinematics.position(th, u, p)
        r = dynamics.reactions(g, state, dynamics.motion(g, kinematics.coefficients(g, p), state, inputs, p), inputs, p)
        multipliers.append(broken_loop_forces(*closed_loop_state(th, u, OMEGA, v)))
        # the plant's forces at A and B are those on the link after the joint
        pins.append([complex(-r.ax, -r.ay), complex(-r.bx, -r.by), complex(r.cx, r.cy), complex(r.dx, r.dy)])
    errors = np.abs(np.array(multipliers) - pins).max(axis=0) / np.abs(pins).max(axis=0)
    return tuple(at_most(f"broken at {joint}", ROUNDING, x) for joint, x in zip("ABCD", errors))


def judge_multipliers() -> tuple[Case, ...]:
    """Compare the multipliers with torque and force of the plant, at constant speed and under a torque."""
    worst: dict[str, float] = {}
    force = {"force at C in y": ("pin.C.fy", 1), "force at C in x": ("pin.C.fx", 2)}
    for drive, inputs, compared in (
        ("constant speed", Inputs(speed=OMEGA), {"crank torque": ("drive.applied_torque", 0), **force}),
        ("torque", Inputs(torque=TorsionBar(torque=TORQUE)), force),
    ):
        run = simulate(TABLE, inputs, stop_time=0.3, step=0.003)
        for i in range(1, len(run)):
            where = closed_loop_state(
                *(run[name][i] for name in ("crank.angle", "slider.position", "crank.speed", "slider.velocity"))
            )
            w = solve_multipliers(*where, None if inputs.speed is not None else run["drive.applied_torque"][i])
            for words, (name, place) in compared.items():
                label, scale = f"{words}; {drive}", np.abs(run[name]).max()
                worst[label] = max(worst.get(label, 0.0), abs(w[place] - run[name][i]) / scale)
    return tuple(at_most(label, ROUNDING, x) for label, x in worst.items())


def chapter_2_statements() -> Iterator[Statement]:
    """Judge the equations of motion, and whether their multipliers are the pin forces."""
    yield statement(
        "Assuming that [F1x and F1y] are the values of the force F1 in the x and y directions the equations of "
        "motion may be written as follows : [(2.11) to (2.14)] ... Two of these equations are : [(2.18), (2.19)]",
        "2.2, eqs (2.11) to (2.21), L796-934",
        "residual of each equation divided by its greatest term, with accelerations, force at C and crank torque by our "
        "equations of motion, at 25 crank angles; (2.13) and (2.14) at constant speed and under a torque. Table 3.1, with "
        "angles, speeds and forces of ours, so that no term is zero. Signs, squares and dots that the scan lacks are read as "
        "in (2.15) to (2.19), (3.8) and (4.10) to (4.13), and the illegible weight in (2.14) as that of rocker and slider",
        f"{ROUNDING:g}, above rounding errors",
        *(at_most(name, ROUNDING, x) for name, x in chapter_2_residuals().items()),
        why="(2.20) has cos(theta4 + alpha) theta4'' where (2.15) has the sine",
    )
    yield statement(
        "This means that four sets of values of [lambda_i] are obtainable. Each set corresponds to the pin force at the "
        "joint[ ]where the [l]inkage is broken.",
        "2.3.1, L1058-1062",
        "multipliers of the loop if it is broken at a joint, minus the force in this joint by our equations of motion, "
        "which have no multipliers, relative to the greatest value. The links before the joint are described from A, the "
        "others from the slider. Table 3.1 with k = 1e6 dyn/cm and mu = 3e4 dyn.s/cm at 420 rpm, at 25 crank angles with "
        "slider positions and velocities of ours",
        f"{ROUNDING:g}, above rounding errors",
        *judge_broken_loops(),
    )
    yield statement(
        "[T]he multipliers are equal to the internal forces components and the input torque.",
        "2.3.1, L1143-1145; for C, L1848-1852 and L2042-2046",
        "multipliers by (3.1), (3.8) and (3.10), minus crank torque and force at C by our equations of motion, "
        "which have no multipliers, relative to the greatest value of each. Table 3.1 with k = 1e6 dyn/cm and mu = "
        "3e4 dyn.s/cm, 0.3 s from u = u' = 0, at 420 rpm and, by 3.2.2, with T0 = 1e8 dyn.cm",
        f"{ROUNDING:g}, above rounding errors",
        *judge_multipliers(),
        why="where our scan differs, we read (3.8) with the minus of l2 cos theta2 as in (4.10), and (3.10) with k for k2",
    )
