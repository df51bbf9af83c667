"""Write what the documentation repeats from the code: the nomenclature, and the variable table of the README.

python docs/generate.py           writes docs/nomenclature.md and the table between the README's markers
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from textwrap import fill

from analysis.mechanisms import FIVE_BAR, SLIDER_CRANK, Mechanism
from linkwork.parameters import field_name
from linkwork.variables import Variable

HERE = Path(__file__).resolve().parent
README = HERE.parent / "README.md"
BEGIN, END = "<!-- variables: begin -->", "<!-- variables: end -->"

#: Symbols of the equations that are no FMI variable: identifier, symbol, unit, meaning.
INTERNAL = (
    ("th2", r"\theta_2", "rad", "crank angle"),
    ("th3", r"\theta_3", "rad", "coupler angle B to C"),
    (
        "th4",
        r"\theta_4 + \alpha",
        "rad",
        "absolute rocker angle D to C; the thesis counts theta4 from the slider's line",
    ),
    ("w2", r"\dot\theta_2", "rad/s", "crank speed; w3, w4 likewise, and e2, e3, e4 the accelerations"),
    ("v", r"\dot u", "m/s", "slider velocity"),
    ("c2, s2", r"\cos\theta_2, \sin\theta_2", "1", "likewise c3, s3, c4, s4"),
    ("c43, s43", r"\cos(\theta_4 + \alpha - \theta_3), \sin(\ldots)", "1", "s43 = 0 is the limit of assembly"),
    ("k32, k42", r"\partial\dot\theta_3/\partial\dot\theta_2, \ldots", "1", "velocity coefficients of the crank"),
    ("k3u, k4u", r"\partial\dot\theta_3/\partial\dot u, \ldots", "rad/m", "velocity coefficients of the slider"),
    ("m11, m12, m22", r"M", "kg.m2, kg.m, kg", "inertia matrix of (theta2, u)"),
    ("b1, b2", "", "N.m, N", "velocity terms of the equations of motion"),
    ("Q1, Q2", "", "N.m, N", "generalised forces of gravity, load, spring, damper, friction"),
    ("cx, cy", r"\lambda_1, \lambda_2", "N", "force of the rocker on the coupler: the loop multipliers (2.3)"),
    ("i2b", r"I_A + m_3 l_2^2", "kg.m2", "crank with the coupler's mass at B"),
    ("i3b", r"I_{G3} + m_3 l_{G3}^2", "kg.m2", "coupler about B"),
    ("i4d", r"I_{G4} + m_4 l_{G4}^2", "kg.m2", "rocker about D"),
    (
        "mx3, my3",
        r"m_3 l_{G3} \cos\nu_3, m_3 l_{G3} \sin\nu_3",
        "kg.m",
        "first moments along and across the link; 2 and 4 likewise",
    ),
    ("xp, yp", r"r \cos a_2, r \sin a_2", "m", "coupler point P along and across the coupler"),
    ("ca, sa", r"\cos\alpha, \sin\alpha", "1", "direction of the guide"),
    ("gx, gy", r"-g \sin\alpha_1, -g \cos\alpha_1", "m/s2", "gravity in the frame of the ground link"),
    ("zeta", r"\zeta = u / l_4", "1", "slider position relative to the rocker's length; ' = d/d(theta2)"),
    ("sigma2", r"\sigma_2 = l_2 / l_4", "1", "crank's length relative to the rocker's"),
    (
        "p45, I4",
        r"p_{45} = m_4 / (m_4 + m_5), I_4 = I_D / (m_4 l_4^2)",
        "1",
        "mass and inertia ratios of chapters IV and V",
    ),
    (
        "SliderEquation.mass, .stiffness, .force",
        r"M, K, F",
        "1",
        "coefficients of (M zeta')' + lambda_c zeta' + (lambda_k^2 + K) zeta = F, eq (4.21) put right: Fourier series",
    ),
    ("spring", r"\lambda_k^2 = k / ((m_4 + m_5) \omega^2)", "1", "spring relative to inertia"),
    ("damping", r"\lambda_c = \mu / ((m_4 + m_5) \omega)", "1", "damper likewise; omega_c = mu/(m4 + m5) in 1/s"),
    (
        "y",
        r"(u, \dot u) \text{ or } (u, \dot u, \dot\theta_2)",
        "m, m/s, rad/s",
        "state on the section theta2 = 0, at prescribed speed or under a torque",
    ),
    (
        "monodromy",
        r"\Phi = \partial y(T) / \partial y(0)",
        "mixed",
        "monodromy matrix of a periodic motion; its eigenvalues are the Floquet multipliers",
    ),
)

#: The same of the slider-crank.
SLIDER_CRANK_INTERNAL = (
    ("th, w", r"\theta_1, \dot\theta_1", "rad, rad/s", "crank angle and speed; e the acceleration"),
    ("s1, v", r"S_1, \dot S_1", "m, m/s", "axial shift of the crank and its velocity; a the acceleration"),
    ("s4", r"S_4", "m", "slider position: the slider pin is at (-a4, 0, 0) - S4 k4, k4 = (0, sin alpha4, cos alpha4)"),
    (
        "f, g",
        r"a_1 c + a_4, a_1 s \cos\alpha_4 - S_1 \sin\alpha_4",
        "m",
        "coordinates of the crank pin across the guide",
    ),
    (
        "h",
        r"\pm\sqrt{a_2^2 - f^2 - g^2}",
        "m",
        "slider pin from the crank pin's foot on the guide; 0 at the limit of assembly",
    ),
    (
        "kth, ks",
        r"\partial S_4/\partial\theta_1, \partial S_4/\partial S_1",
        "m/rad, 1",
        "velocity coefficients; kth = 0 at the dead centres of a constant shift",
    ),
    ("m11, m12, m22", r"M", "kg.m2, kg.m, kg", "inertia matrix of (theta1, S1)"),
    ("b1, b2", "", "N.m, N", "velocity terms of the equations of motion"),
    ("Q1, Q2", "", "N.m, N", "generalised forces of gravity, load, springs, dampers, friction"),
    (
        "p.m22, p.m23, p.m33",
        "",
        "kg",
        "the rod's masses at its ends: its energy is half of m22 v2.v2 + 2 m23 v2.v3 + m33 v3.v3",
    ),
    ("share", r"g_2/a_2", "1", "distance of the rod's centre of mass from the crank pin relative to its length"),
    ("amplitude, ratio", r"S_{S1}, \alpha", "m, 1", "of the groove's shift S1 = SS1 sin(alpha theta1), eq 28"),
)

_FIVE_BAR_FRAME = """**Frame and signs.** x runs along the ground link from the crank shaft A to the slider's zero, y to its left; angles
are counter-clockwise from x. `ground.inclination` is the angle of x above the horizontal, so gravity in this frame is
(-g sin, -g cos) of it. `*.cog_angle` and `coupler.point_angle` turn from the link's own direction: A to B, B to C,
D to C. A positive torque drives the crank counter-clockwise. `rocker.angle` is absolute, the thesis's theta4 + alpha.
`assembly.branch` is the sign of sin(rocker.angle - coupler.angle), +1 in the thesis's runs: C lies to the left of the
line from B to D. `pin.A` is the force of the ground on the crank, `pin.B` of the crank on the coupler, `pin.C` of the
rocker on the coupler, `pin.D` of the slider on the rocker; `slider.guide_force` is the guide's force on the slider, to
the left of its direction of travel."""

_SLIDER_CRANK_FRAME = """**Frames and signs.** Frame 1, the ground's: z along the crank axis, x along the common normal of crank axis and
guide, the origin O where they meet; the crank points along x at `crank.angle` 0 and turns about z. Frame 2 turns and shifts
with the crank, x towards the crank pin, its origin on the axis in the plane of the pin. Frame 3 has x along the rod from
crank pin to slider pin, y perpendicular to rod and crank axis. Frame 4, the guide's: x that of frame 1, z along
(0, sin, cos) of `guide.twist`. The guide passes through (-`guide.offset`, 0, 0), and the slider position increases along -z of
frame 4. `assembly.branch` says on which side of the crank pin's foot on the guide the slider is. FMI outputs are in frame 1:
`bearing` is what the ground exerts on the crank, axial drive and torque included, its moment about O; `crank_pin` the force
of the crank on the rod, `slider_pin` that of the slider on the rod, `guide` that of the guide on the slider, its moment about
the slider pin. `slider.load` is positive in the direction in which the slider position increases."""


def _symbol(text: str) -> str:
    return f"${text}$" if text else ""


def _range(variable: Variable) -> str:
    low = "" if variable.minimum is None else f"{variable.minimum:g}"
    high = "" if variable.maximum is None else f"{variable.maximum:g}"
    return f"{low} .. {high}" if low or high else ""


def _start(variable: Variable) -> str:
    return f"{variable.start:.9g}" if isinstance(variable.start, float) else str(variable.start)


def nomenclature() -> str:
    """The text of docs/nomenclature.md."""
    return "\n".join(
        [
            "# Nomenclature",
            "",
            "For each mechanism one table: thesis symbol, identifier in Python, FMI variable, unit, meaning and sign. Written by",
            "`python docs/generate.py` from the tables in the code; a test holds it to them.",
            "",
            "## The five-bar slider",
            "",
            *_of_mechanism(FIVE_BAR, _FIVE_BAR_FRAME, INTERNAL),
            "## The generalised slider-crank",
            "",
            *_of_mechanism(SLIDER_CRANK, _SLIDER_CRANK_FRAME, SLIDER_CRANK_INTERNAL),
        ]
    )


def _of_mechanism(mechanism: Mechanism, frame: str, internal: tuple[tuple[str, str, str, str], ...]) -> list[str]:
    """Frame, FMI variables and symbols of one mechanism."""
    kind, variables = mechanism.parameters.__name__, mechanism.variables
    lines = [frame, "", "### FMI variables", ""]
    lines += ["| symbol | identifier | FMI variable | unit | start | range | meaning |"]
    lines += ["| --- | --- | --- | --- | --- | --- | --- |"]
    for variable in (*variables.PARAMETERS, *variables.INPUTS, *variables.OUTPUTS):
        if variable.name in mechanism.mechanism_variables:
            identifier = f"`{kind}.{field_name(variable.name)}`"
        elif variable.name.startswith("initial."):
            identifier = f"`InitialState.{variable.name.split('.')[1]}`"
        elif variable.causality == "output" and variable.kind == "Real":
            identifier = f"`Outputs.{variable.name.replace('.', '_')}`"
        else:
            identifier = ""
        start = "" if variable.causality == "output" else _start(variable)
        cells = (_symbol(variable.symbol), identifier, f"`{variable.name}`", variable.unit or variable.kind, start)
        lines.append(f"| {' | '.join(cells)} | {_range(variable)} | {variable.description} |")
    lines += [
        "",
        "### Symbols of the equations",
        "",
        "| symbol | identifier | unit | meaning |",
        "| --- | --- | --- | --- |",
    ]
    lines += [f"| {_symbol(symbol)} | `{name}` | {unit} | {meaning} |" for name, symbol, unit, meaning in internal]
    return [*lines, ""]


def variable_table() -> str:
    """The table of the README: the variables of FiveBarSlider."""
    lines = ["| variable | causality | unit | start | range | meaning |", "| --- | --- | --- | --- | --- | --- |"]
    variables = FIVE_BAR.variables
    for v in (*variables.PARAMETERS, *variables.INPUTS, *variables.OUTPUTS):
        start = "" if v.causality == "output" else _start(v)
        lines.append(f"| `{v.name}` | {v.causality} | {v.unit or v.kind} | {start} | {_range(v)} | {v.description} |")
    return "\n".join(lines)


def readme(text: str) -> str:
    """The README with its variable table brought up to date."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{variable_table()}\n{END}{after}"


YOUSSEF_FIGURES = """# The figures of Youssef's thesis, and what it states

Each figure of chapters III, IV, V, VII and VIII is a module of `analysis.studies`, with a plot, a CSV and verdicts; `linkwork figures`
makes them all. The figures themselves are unreadable in the copy we have: what is held against the computation is what the
text of the thesis states, and reference numbers from an independent derivation that was cross-checked against two multibody
engines. Where a caption is lost, which quantity stands under which number is our assignment, and the study says so. This page is
written by `python docs/generate.py --figures`.

"thesis" in the second column is the thesis's own statement, "reference" the independent number, "check" a property that the
computation must have.
"""

RAHMAN_FIGURES = """# The figures of Rahman's thesis, and what it states

Figures 5 to 38 are one family of studies, `analysis.studies.rahman`: `linkwork figures R5` makes figure 5 as a plot and a CSV in
pounds, inches and degrees, with verdicts. The mechanism of section 3.1 turns at 50 rpm under a crank torque of 100 lb.in; each
figure has three cases beside the ideal slider-crank (a4 = 0, S1 = 0, alpha4 = 270 deg):

| figures | cases |
| --- | --- |
| R5 to R15 | offset a4 = 10, 20, 30 in at S1 = 3.5 in, alpha4 = 270 deg |
| R16 to R26 | shift S1 = 3, 6, 9 in at a4 = 30 in, alpha4 = 270 deg |
| R27 to R37 | twist alpha4 = 232, 270, 310 deg at a4 = 20 in, S1 = 0 |
| R38 | all of them |

**The numbering is ours.**
{assigned}

**Signs and frames.** nFni is the force in joint n along i of frame n, nTni the moment. 1F1 and 1T1 are those of the ground on the
crank, 1T1 about the origin of frame 1 and with the torque as 1T1k; 2F2 is the force of the rod on the crank, in frame 2, whose i
points to the crank pin; 3F3 that of the slider on the rod, in frame 3, whose i points along the rod and whose j is perpendicular
to rod and crank axis; 4F4 and 4T4 those of the ground on the slider, in frame 4, whose k is the guide. 4F4k is the slider force
sought; the slider position counts against k. The signs of 1F1, 1T1 and 2F2 follow from the thesis's statements; about those of 3F3
and 4F4 it states nothing that we have.

**Dead centres.** With the torque given, the forces have no finite value where dS4/dtheta1 = 0. The plots are cut off there and
dotted lines mark the places, which the CSV lists; a value that falls on one of them is "nan" in the CSV. A "greatest magnitude"
below is that at whole degrees more than 10 deg from a dead centre.

What does not hold, with the right values, and the errors in the equations are summed up in [rahman-errata.md](rahman-errata.md).
This page is written by `python docs/generate.py --figures`. "thesis" in the second column is the thesis's own statement,
"reference" a number from an independent derivation, "check" a property that the computation must have.
"""


def figures(head: str, numbers: Iterable[str]) -> str:
    """The text of docs/youssef-figures.md or rahman-figures.md: these studies computed, with their verdicts."""
    from analysis.studies import load

    lines = [head]
    for number in numbers:
        result = load(number).compute()
        lines += [f"## {result.heading}", "", result.claim, ""]
        if result.assignment and result.assignment not in " ".join(head.split()):
            lines += [f"*{result.assignment}*", ""]
        lines += ["| statement | source | stated | computed | |", "| --- | --- | --- | --- | --- |"]
        lines += [
            f"| {v.statement} | {v.source} | {v.expected} | {v.found} | {'holds' if v.holds else '**does not hold**'} |"
            for v in result.verdicts
        ]
        lines.append("")
    return "\n".join(lines)


def youssef_figures() -> str:
    """The text of docs/youssef-figures.md."""
    from analysis.studies import YOUSSEF

    return figures(YOUSSEF_FIGURES, YOUSSEF)


def rahman_figures() -> str:
    """The text of docs/rahman-figures.md."""
    from analysis.studies import RAHMAN
    from analysis.studies.rahman import ASSIGNED

    return figures(RAHMAN_FIGURES.format(assigned=fill(ASSIGNED, 130)), RAHMAN)


#: Pictures of docs/rig-2.md by the study that they are.
RIG_2 = {"rig-2-approximations.png": "8.18", "rig-2-harmonics.png": "8.20", "rig-2-forces.png": "8.21"}


def rig_2_pictures() -> None:
    """Draw the pictures of docs/rig-2.md."""
    from analysis import figures
    from analysis.files.io import save_figure
    from analysis.periodic import frequency_response
    from analysis.studies import load
    from analysis.youssef import approximations
    from linkwork.five_bar.published import RAD_S_PER_RPM, SETS

    for name, number in RIG_2.items():
        study = load(number)
        save_figure(study.draw(study.compute()), HERE / name)
    rig = SETS["rig-2-spring-c"]
    response = frequency_response(rig.parameters, 100.0 * RAD_S_PER_RPM, 1300.0 * RAD_S_PER_RPM)
    figure = figures.plot(response, title=rig.source, rpm=True, beside=approximations(response))
    save_figure(figure, HERE / "rig-2-response.png")


def hand_drawn_pictures() -> None:
    """Draw the pictures of docs/hand-drawn-to-fmu.md."""
    import numpy as np

    from analysis.cli.slider import drive_figure
    from analysis.figures import Curve, Panel, plot_curves
    from analysis.files.io import save_figure
    from analysis.motion.cases import load_slider_case
    from analysis.synthesis import TargetPath
    from analysis.synthesis.cases import load_synthesis_case

    examples = HERE.parent / "examples"

    def closed(points: np.ndarray, **look: object) -> Curve:
        x, y = 1e3 * np.vstack([points, points[:1]]).T
        return Curve(x=x, y=y, **look)

    def picture(name: str, title: str, curves: list[Curve]) -> None:
        panel = Panel(x_label="x [mm]", y_label="y [mm]", curves=curves, equal=True, legend_at="outside")
        save_figure(plot_curves([panel], title=title, size=(6.4, 3.0)), HERE / name, dpi=110)

    case = load_synthesis_case(examples / "hand-drawn.toml")
    drawn = TargetPath.from_file(examples / "hand-drawn.svg")
    points = closed(drawn.points, label="drawn", line="", marker=".", colour="0.55")
    smooth = closed(case.task.path.points, label="smoothed", width=1.0)
    picture("hand-drawn-curve.png", "A curve drawn by hand", [points, smooth])
    save_figure(case.solve().best.plot(title="The linkage that was found"), HERE / "hand-drawn-linkage.png", dpi=90)
    small = load_slider_case(examples / "hand-drawn-slider.toml")
    four_bar = small.four_bar()
    moved = [four_bar]
    for harmonics in small.harmonics:
        moved.append(small.move(four_bar, harmonics, tuple(moved[1:]), progress=False).best)
    curves = [closed(four_bar.task.path.points, label="wanted", width=3.0, colour="0.8")]
    curves.append(closed(four_bar.curve(), label="four-bar", line="--"))
    curves.append(closed(moved[-1].curve(), label="slider moved,\n3 harmonics"))
    picture("hand-drawn-moved.png", "Links of at most 150 mm", curves)
    figure = drive_figure("The slider's drive at 60 rpm", small.driven(moved[-1]))
    save_figure(figure, HERE / "hand-drawn-motion.png", dpi=90)


def slider_crank_pictures() -> None:
    """Draw the pictures of docs/slider-crank.md."""
    from dataclasses import replace
    from math import radians

    import numpy as np

    from analysis.figures.slider_crank import plot_tolerances
    from analysis.figures.slider_crank_picture import plot_mechanism, plot_range
    from analysis.files.io import save_figure
    from analysis.slider_crank.forces import force_turn
    from analysis.slider_crank.tolerances import Tolerance, monte_carlo
    from linkwork.slider_crank.published import CRANK_SPEED, INCH, SETS, parameters

    case = SETS["rahman-a4-10-s1-3.5"]
    shift = case.initial.shift_position
    figure = plot_mechanism(case.parameters, radians(30.0), shift, unit="in", title=case.source)
    save_figure(figure, HERE / "slider-crank.png", dpi=110)
    short = replace(parameters(20.0), rod_length=30.0 * INCH)
    figure = plot_range(short, unit="in", title="A rod of 30 in at a4 = 20 in, S1 = 0")
    save_figure(figure, HERE / "slider-crank-range.png", dpi=90)
    turn = force_turn(parameters(20.0), crank_speed=CRANK_SPEED, angles=np.linspace(0.0, 2.0 * np.pi, 73))
    names = ("crank.length", "rod.length", "guide.offset", "shift.position")
    allowed = [Tolerance(name, half_width=0.25e-3) for name in names]
    allowed.append(Tolerance("guide.twist", half_width=radians(0.1)))
    found = monte_carlo(turn, allowed, samples=100_000)
    title = "Lengths within 0.25 mm and the twist within 0.1 deg, a4 = 20 in, S1 = 0"
    save_figure(
        plot_tolerances(found.scene(angle=radians(30.0)), title=title), HERE / "slider-crank-tolerances.png", dpi=90
    )


def main(arguments: list[str]) -> int:
    """Write what is asked for."""
    if "--figures" in arguments:
        from analysis.files.io import save_figure
        from analysis.studies import load

        (HERE / "youssef-figures.md").write_text(youssef_figures(), encoding="utf-8")
        (HERE / "rahman-figures.md").write_text(rahman_figures(), encoding="utf-8")
        study = load("linkage")
        save_figure(study.draw(study.compute()), HERE / "linkage.png")
        rig_2_pictures()
        hand_drawn_pictures()
        slider_crank_pictures()
    (HERE / "nomenclature.md").write_text(nomenclature(), encoding="utf-8")
    README.write_text(readme(README.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
