"""The figures of Youssef's thesis: a module for each chapter, listed here."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ..contents import Entry

#: Each figure by its number in the thesis, and each study of ours by its name.
FIGURES: Mapping[str, Entry] = MappingProxyType(
    {
        "3.1": Entry("The linkage with its loads", place="3.2.1, L1804"),
        "3.2": Entry(
            "Slider without a spring over the crank angle, five dampers; Table 3.1, 420 rpm",
            "youssef.chapter_3",
            "3.2.1, L1871",
        ),
        "3.3": Entry(
            "Slider without a spring and gravity, five dampers; Table 3.1, 420 rpm", "youssef.chapter_3", "3.2.1, L1925"
        ),
        "3.4": Entry(
            "Slider over the crank angle, three springs; Table 3.1, 420 rpm", "youssef.chapter_3", "3.2.1, L1936"
        ),
        "3.5": Entry(
            "Torque that holds the speed, three springs; Table 3.1, 420 rpm", "youssef.chapter_3", "3.2.1, L1987"
        ),
        "3.6": Entry(
            "Launch with three torques: crank speed; Table 3.1, k = 1e6 dyn/cm", "youssef.chapter_3", "3.2.2, L2116"
        ),
        "3.7": Entry(
            "Torque of a launch over its time to 1 rad; Table 3.1, k = 1e6 dyn/cm", "youssef.chapter_3", "3.2.2, L2134"
        ),
        "3.8": Entry(
            "Launch with three torques: slider; Table 3.1, k = 1e6 dyn/cm", "youssef.chapter_3", "3.2.2, L2153"
        ),
        "3.9": Entry("Launch with three springs: crank speed; T0 = 1e8 dyn.cm", "youssef.chapter_3", "3.2.2, L2169"),
        "3.10": Entry("Launch with three springs: slider; T0 = 1e8 dyn.cm", "youssef.chapter_3", "3.2.2, L2191"),
        "3.11": Entry(
            "Free motion: crank speed; Table 3.1, k = 5e5 dyn/cm",
            "youssef.chapter_3",
            "3.3, L2228",
        ),
        "3.12": Entry(
            "Free motion: crank speed; Table 3.1, k = 2e6 dyn/cm",
            "youssef.chapter_3",
            "3.3, L2228",
        ),
        "3.13": Entry(
            "Free motion: phase plane of the slider; Table 3.1, k = 5e5 dyn/cm", "youssef.chapter_3", "3.3, L2260"
        ),
        "3.14": Entry(
            "Free motion: phase plane of the slider; Table 3.1, k = 2e6 dyn/cm", "youssef.chapter_3", "3.3, L2260"
        ),
        "4.1": Entry("Datum and perturbed linkage (sketch)", place="4.1, L2395"),
        "4.2": Entry("Linkage with spring and damper (sketch)", place="4.2, L2481"),
        "4.3": Entry(
            "First harmonic over the speed, undamped; three inertia ratios",
            "youssef.chapter_4",
            "4.5.1, L3128-3168",
        ),
        "4.4": Entry(
            "Second harmonic over the speed, undamped; three inertia ratios",
            "youssef.chapter_4",
            "4.5.1, L3128-3168",
        ),
        "4.5": Entry("Deviation of the resonance over the inertia ratio", "youssef.chapter_4", "4.5.1, L3146-3156"),
        "4.6": Entry("Amplitude over the speed with dampers; I4 = 1", "youssef.chapter_4", "4.5.2, L3172-3184"),
        "4.7": Entry("Amplitude over the speed with dampers; I4 = 0.5", "youssef.chapter_4", "4.5.2, L3172-3184"),
        "5.1": Entry(
            "First region of instability over the inertia ratio, undamped", "youssef.chapter_5", "5.3.1, L3756-3770"
        ),
        "5.2": Entry(
            "First region of instability over the crank's length, undamped", "youssef.chapter_5", "5.3.1, L3772-3884"
        ),
        "5.3": Entry(
            "First region of instability over the coupler's length, undamped", "youssef.chapter_5", "5.3.1, L3886-3900"
        ),
        "5.4": Entry(
            "First region of instability over the inertia ratio, damped", "youssef.chapter_5", "5.3.2, L3910-3921"
        ),
        "6.1": Entry("The four-bar with its coupler point", place="6.3.2, L4446"),
        "6.2": Entry("Flow chart of the search", place="6.3.3, L4555"),
        "6.3": Entry(
            "Area between curves of many points (a); the two closures of a four-bar (b)", place="6.4.1, L4716, L4804"
        ),
        "6.4": Entry("Ellipse (a), timed", "youssef.chapter_6", "6.4.2 A, L4848"),
        "6.5": Entry("Ellipse (b), timed", "youssef.chapter_6", "6.4.2 A, L4848"),
        "6.6": Entry("Ellipse (a), timed, with bounds on the lengths", "youssef.chapter_6", "6.4.2 A, L4903"),
        "6.7": Entry("Rocker function, unweighted", "youssef.chapter_6", "6.4.2 B, L4938"),
        "6.8": Entry("Rocker function, weighted, and with a mounting angle", "youssef.chapter_6", "6.4.2 B, L4938"),
        "6.9": Entry("Path (a): least area between the curves", "youssef.chapter_6", "6.4.3, L5022"),
        "6.10": Entry("Path (b): least area between the curves", "youssef.chapter_6", "6.4.3, L5022"),
        "6.11": Entry("Packaging machine: its region (a), its linkage (b)", "youssef.packaging", "6.4.3, L5095"),
        "7.1": Entry("The five-bar slider: a four-bar whose rocker pivot moves", place="7.0, L5213"),
        "7.2": Entry("Coupler curves at fixed U and isochronous curves", "youssef.chapter_7", "7.0, L5234"),
        "7.3": Entry("The mechanism with an inclined guide", place="7.3, L5540"),
        "7.4": Entry("Series 1: desired curve", "youssef.chapter_7", "7.3.1, L5567"),
        "7.5": Entry("Series 1: the two positions of the rocker", "youssef.chapter_7", "7.3.1, L5656"),
        "7.6": Entry("Series 1: motion U of the slider", "youssef.chapter_7", "7.3.1, L5726"),
        "7.7": Entry("Series 1: error over a turn", "youssef.chapter_7", "7.3.1, L5728"),
        "7.8": Entry("Series 1: paths", "youssef.chapter_7", "7.3.1, L5736"),
        "7.9": Entry("Series 1: motion U of the slider, p1 p2 weighted", "youssef.chapter_7", "7.3.1, L5808"),
        "7.10": Entry("Series 1: path, p1 p2 weighted", "youssef.chapter_7", "7.3.1, L5808"),
        "7.11": Entry("Series 2: weighted rocker function, slider moved", "youssef.series_2", "7.3.2, L5940"),
        "7.12": Entry("Series 2: path (b), slider moved", "youssef.series_2", "7.3.2, L5972"),
        "8.1": Entry("Rig 1, a side plate of the guide removed", "", "8.2.1.1, L6118"),
        "8.2": Entry("Rig 1 from above: coupling to the motor, slider and guide", "", "8.2.1.1, L6124"),
        "8.3": Entry("Rig 1: exploded views of linkage (a) and guide (b)", "", "8.2.1.1, L6126"),
        "8.4": Entry("Circuits of photocell (a) and displacement transducer (b)", "", "8.2.1.2, L6248, L6281"),
        "8.5": Entry("Rig 2", "", "8.2.2, L6291"),
        "8.6": Entry(
            "Impulse response of the disconnected slider: the logarithmic decrement",
            "youssef.chapter_8",
            "8.3.3, L6393",
        ),
        "8.7": Entry("Steady motion of the slider; rig 1, spring A, 360 rpm", "youssef.chapter_8", "8.4.1.1, L6441"),
        "8.8": Entry(
            "Motion of the slider, theory and experiment; rig 1, spring A, 390 rpm",
            "youssef.chapter_8",
            "8.4.1.1, L6463",
        ),
        "8.9": Entry(
            "Motion of the slider, theory and experiment; rig 1, spring A, 420 rpm",
            "youssef.chapter_8",
            "8.4.1.1, L6463",
        ),
        "8.10": Entry(
            "Motion of the slider, theory and experiment; rig 1, spring A, 450 rpm",
            "youssef.chapter_8",
            "8.4.1.1, L6463",
        ),
        "8.11": Entry(
            "Motion of the slider, theory and experiment; rig 1, spring B, 600 rpm",
            "youssef.chapter_8",
            "8.4.1.1, L6516",
        ),
        "8.12": Entry(
            "Motion of the slider, theory and experiment; rig 1, spring B, 660 rpm",
            "youssef.chapter_8",
            "8.4.1.1, L6516",
        ),
        "8.13": Entry(
            "Motion of the slider, theory and experiment; rig 1, spring B, 720 rpm",
            "youssef.chapter_8",
            "8.4.1.1, L6516",
        ),
        "8.14": Entry(
            "Motion of the slider; rig 1, spring A, 240, 260, 280 rpm", "youssef.chapter_8", "8.4.1.2, L6569"
        ),
        "8.15": Entry(
            "Motion of the slider; rig 1, spring A, 300, 360, 500 rpm", "youssef.chapter_8", "8.4.1.2, L6569"
        ),
        "8.16": Entry(
            "Motion of the slider; rig 1, spring B, 500, 540, 580 rpm", "youssef.chapter_8", "8.4.1.2, L6744"
        ),
        "8.17": Entry(
            "Motion of the slider; rig 1, spring B, 620, 680, 780 rpm", "youssef.chapter_8", "8.4.1.2, L6744"
        ),
        "8.18": Entry("Oscillations of the slider; rig 2", "youssef.chapter_8", "8.4.2.1, L6804"),
        "8.19": Entry("Resonance curve of the slider; rig 2, spring C", "youssef.chapter_8", "8.4.2.2, L6830"),
        "8.20": Entry("Resonance curve of the slider; rig 2, spring D", "youssef.chapter_8", "8.4.2.2, L6830"),
        "8.21": Entry(
            "Resonance curves of the second harmonic; rig 2, springs C and D", "youssef.chapter_8", "8.4.2.2, L6877"
        ),
        "quality": Entry("Combined quality function; ellipse (a)", "youssef.quality", "6.2, 6.3"),
        "control": Entry("Methods of controlling the slider; weighted rocker function", "youssef.control", "7.1, 7.4"),
        "rig-1-resonance": Entry(
            "Rig 1 about resonance: amplitude over the speed, springs A and B", "youssef.chapter_8"
        ),
        "rig-1-friction": Entry(
            "What friction explains of the amplitudes; rig 1, springs A and B", "youssef.chapter_8"
        ),
        "rig-2-forces": Entry("Crank torque and pin forces over the speed; rig 2", "youssef.chapter_8"),
        "linkage": Entry("The five-bar slider of Table 3.1 at 420 rpm", "youssef.linkage"),
    }
)
