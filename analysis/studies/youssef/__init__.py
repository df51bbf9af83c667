"""List of the figures of Youssef's thesis and of the modules that compute them.

In these modules th2, th3 and th4 are the angles of crank, coupler and rocker, and u is the slider position; a prime denotes
a derivative. L and a number denote a line of the scanned text.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ..contents import Entry

#: Figures in the order of the thesis, and our own studies. Each row has the number or name, the module (empty if there is
#: nothing to compute), the place in the thesis, and the title.
_ROWS = (
    ("3.1", "formulation", "II, 3.1, L554-1804", "The linkage with its loads: equations and integration"),
    ("3.2", "chapter_3", "3.2.1, L1871", "Slider without a spring, five dampers; Table 3.1, 420 rpm"),
    ("3.3", "chapter_3", "3.2.1, L1925", "Slider without spring and gravity, five dampers; Table 3.1, 420 rpm"),
    ("3.4", "chapter_3", "3.2.1, L1936", "Slider over the crank angle, three springs; Table 3.1, 420 rpm"),
    ("3.5", "chapter_3", "3.2.1, L1987", "Torque that holds the speed, three springs; Table 3.1, 420 rpm"),
    ("3.6", "chapter_3", "3.2.2, L2116", "Launch with three torques: crank speed; Table 3.1, k = 1e6 dyn/cm"),
    ("3.7", "chapter_3", "3.2.2, L2134", "Torque of a launch over its time to 1 rad; Table 3.1, k = 1e6 dyn/cm"),
    ("3.8", "chapter_3", "3.2.2, L2153", "Launch with three torques: slider; Table 3.1, k = 1e6 dyn/cm"),
    ("3.9", "chapter_3", "3.2.2, L2169", "Launch with three springs: crank speed; T0 = 1e8 dyn.cm"),
    ("3.10", "chapter_3", "3.2.2, L2191", "Launch with three springs: slider; T0 = 1e8 dyn.cm"),
    ("3.11", "chapter_3", "3.3, L2228", "Free motion: crank speed; Table 3.1, k = 5e5 dyn/cm"),
    ("3.12", "chapter_3", "3.3, L2228", "Free motion: crank speed; Table 3.1, k = 2e6 dyn/cm"),
    ("3.13", "chapter_3", "3.3, L2260", "Free motion: phase plane of the slider; Table 3.1, k = 5e5 dyn/cm"),
    ("3.14", "chapter_3", "3.3, L2260", "Free motion: phase plane of the slider; Table 3.1, k = 2e6 dyn/cm"),
    ("4.1", "", "4.1, L2395", "Datum and perturbed linkage (sketch)"),
    ("4.2", "linearised", "4.1 to 4.4, L2387-3107", "Linkage with spring and damper: the linearised equations"),
    ("4.3", "chapter_4", "4.5.1, L3128-3168", "First harmonic over the speed, undamped; three inertia ratios"),
    ("4.4", "chapter_4", "4.5.1, L3128-3168", "Second harmonic over the speed, undamped; three inertia ratios"),
    ("4.5", "chapter_4", "4.5.1, L3146-3156", "Deviation of the resonance over the inertia ratio"),
    ("4.6", "chapter_4", "4.5.2, L3172-3184", "Amplitude over the speed with dampers; I4 = 1"),
    ("4.7", "chapter_4", "4.5.2, L3172-3184", "Amplitude over the speed with dampers; I4 = 0.5"),
    ("5.1", "chapter_5", "5.3.1, L3756-3770", "First region of instability over the inertia ratio, undamped"),
    ("5.2", "chapter_5", "5.3.1, L3772-3884", "First region of instability over the crank's length, undamped"),
    ("5.3", "chapter_5", "5.3.1, L3886-3900", "First region of instability over the coupler's length, undamped"),
    ("5.4", "damping", "5.3.2, L3910-3921", "First region of instability over the inertia ratio, damped"),
    ("6.1", "", "6.3.2, L4446", "The four-bar with its coupler point"),
    ("6.2", "search", "6.3.3, L4555", "The search, of which the figure has the flow chart"),
    (
        "6.3",
        "search",
        "6.4.1, L4717, L4804",
        "Area between curves of many points (a); the two closures of a four-bar (b)",
    ),
    ("6.4", "chapter_6", "6.4.2 A, L4848", "Ellipse (a), timed"),
    ("6.5", "chapter_6", "6.4.2 A, L4848", "Ellipse (b), timed"),
    ("6.6", "chapter_6", "6.4.2 A, L4903", "Ellipse (a), timed, with bounds on the lengths"),
    ("6.7", "chapter_6", "6.4.2 B, L4937", "Rocker function, unweighted"),
    ("6.8", "chapter_6", "6.4.2 B, L4937", "Rocker function, weighted, and with a mounting angle"),
    ("6.9", "chapter_6", "6.4.3, L5022", "Path (a): least area between the curves"),
    ("6.10", "chapter_6", "6.4.3, L5022", "Path (b): least area between the curves"),
    ("6.11", "packaging", "6.4.3, L5095", "Packaging machine: its region (a), its linkage (b)"),
    ("7.1", "", "7.0, L5213", "The five-bar slider: a four-bar whose rocker pivot moves"),
    ("7.2", "chapter_7", "7.0, L5234", "Coupler curves at fixed U and isochronous curves"),
    ("7.3", "", "7.3, L5540", "The mechanism with an inclined guide"),
    ("7.4", "series_1", "7.3.1, L5567", "Series 1: desired curve"),
    ("7.5", "series_1", "7.3.1, L5657", "Series 1: the two positions of the rocker"),
    ("7.6", "series_1", "7.3.1, L5726", "Series 1: motion U of the slider"),
    ("7.7", "series_1", "7.3.1, L5728", "Series 1: error over a turn"),
    ("7.8", "series_1", "7.3.1, L5733", "Series 1: paths"),
    ("7.9", "series_1", "7.3.1, L5828", "Series 1: motion U of the slider, p1 p2 weighted"),
    ("7.10", "series_1", "7.3.1, L5834", "Series 1: path, p1 p2 weighted"),
    ("7.11", "series_2", "7.3.2, L5941", "Series 2: weighted rocker function, slider moved"),
    ("7.12", "series_2", "7.3.2, L5973", "Series 2: path (b), slider moved"),
    ("8.1", "", "8.2.1.1, L6118", "Rig 1, a side plate of the guide removed"),
    ("8.2", "", "8.2.1.1, L6122", "Rig 1 from above: coupling to the motor, slider and guide"),
    ("8.3", "", "8.2.1.1, L6126", "Rig 1: exploded views of linkage (a) and guide (b)"),
    (
        "8.4",
        "instruments",
        "8.2.1.2, L6248, L6281",
        "Circuits of photocell and transducer: the crank speed by its pulses",
    ),
    ("8.5", "", "8.2.2, L6291", "Rig 2"),
    ("8.6", "instruments", "8.3.3, L6393", "Impulse response of the disconnected slider: the logarithmic decrement"),
    ("8.7", "chapter_8", "8.4.1.1, L6441", "Steady motion of the slider; rig 1, spring A, 360 rpm"),
    ("8.8", "chapter_8", "8.4.1.1, L6463", "Motion of the slider, theory and experiment; rig 1, spring A, 390 rpm"),
    ("8.9", "chapter_8", "8.4.1.1, L6463", "Motion of the slider, theory and experiment; rig 1, spring A, 420 rpm"),
    ("8.10", "chapter_8", "8.4.1.1, L6463", "Motion of the slider, theory and experiment; rig 1, spring A, 450 rpm"),
    ("8.11", "chapter_8", "8.4.1.1, L6516", "Motion of the slider, theory and experiment; rig 1, spring B, 600 rpm"),
    ("8.12", "chapter_8", "8.4.1.1, L6516", "Motion of the slider, theory and experiment; rig 1, spring B, 660 rpm"),
    ("8.13", "chapter_8", "8.4.1.1, L6516", "Motion of the slider, theory and experiment; rig 1, spring B, 720 rpm"),
    ("8.14", "chapter_8", "8.4.1.2, L6569", "Motion of the slider; rig 1, spring A, 240, 260, 280 rpm"),
    ("8.15", "chapter_8", "8.4.1.2, L6569", "Motion of the slider; rig 1, spring A, 300, 360, 500 rpm"),
    ("8.16", "chapter_8", "8.4.1.2, L6744", "Motion of the slider; rig 1, spring B, 500, 540, 580 rpm"),
    ("8.17", "chapter_8", "8.4.1.2, L6744", "Motion of the slider; rig 1, spring B, 620, 680, 780 rpm"),
    ("8.18", "chapter_8", "8.4.2.1, L6804", "Oscillations of the slider; rig 2"),
    ("8.19", "rig_2", "8.4.2.2, L6830", "Resonance curve of the slider; rig 2, spring C"),
    ("8.20", "rig_2", "8.4.2.2, L6830", "Resonance curve of the slider; rig 2, spring D"),
    ("8.21", "rig_2", "8.4.2.2, L6877", "Resonance curves of the second harmonic; rig 2, springs C and D"),
    ("quality", "quality", "6.2, 6.3, 6.5", "Combined quality function; ellipse (a)"),
    ("control", "control", "7.1, 7.3.1, 7.4", "Methods of controlling the slider; weighted rocker function"),
    ("rig-1-resonance", "rig_1", "", "Rig 1 about resonance: amplitude over the speed, springs A and B"),
    ("rig-1-friction", "rig_1", "", "What friction explains of the amplitudes; rig 1, springs A and B"),
    ("rig-2-forces", "rig_2", "", "Crank torque and pin forces over the speed; rig 2"),
    ("conclusions", "conclusions", "8.0, 9.1", "Conclusions of the thesis"),
    ("linkage", "linkage", "", "The five-bar slider of Table 3.1 at 420 rpm"),
)

#: Each figure by its number in the thesis, and each study of ours by its name.
FIGURES: Mapping[str, Entry] = MappingProxyType(
    {number: Entry(title, module and f"youssef.{module}", place) for number, module, place, title in _ROWS}
)
