"""Published numbers for comparison: what the thesis prints and states, and the results of an independent derivation.

Source, unless said otherwise: A. H. Youssef, thesis on linkage mechanisms with two degrees of freedom, Newcastle upon
Tyne. Numbers are in cgs units, as printed, with the unit in the name; the factors to SI are at the top.
Nothing here is an output of this program.
"""

from typing import Mapping, NamedTuple

# One unit in SI
CM = 1e-2
GRAM = 1e-3
G_CM2 = 1e-7
DYN = 1e-5
DYN_CM = 1e-7
DYN_PER_CM = 1e-3
DYN_S_PER_CM = 1e-3
RPM = 0.10471975511965977


class CgsTable(NamedTuple):
    """A table of data of the thesis as printed, in cgs units."""

    lengths_cm: tuple[float, float, float, float]
    coupler_cog_cm: float
    rocker_cog_cm: float
    masses_g: tuple[float, float, float]
    coupler_inertia_g_cm2: float
    rocker_inertia_g_cm2: float
    stiffness_dyn_cm: float
    damping_dyn_s_cm: float
    speed_rpm: float


# Table 3.1, with k and mu of fig. 3.4; appendix 1; Tables 8.1 and 8.2 with their springs A to D
TABLES: Mapping[str, CgsTable] = {
    "table-3.1": CgsTable((15.35, 5, 15, 15), 9.82, 7.5, (209, 206, 590), 5250, 3863, 1e6, 3e4, 420),
    "appendix-1": CgsTable((15.35, 5, 15, 15), 9.82, 7.5, (209, 206, 590), 5250, 3863, 1.5e6, 2.8e4, 450),
    "rig-1-spring-a": CgsTable((15.37, 5, 15, 15), 9.55, 7.5, (222, 206, 600), 7064, 4797, 3e6, 9e3, 420),
    "rig-1-spring-b": CgsTable((15.37, 5, 15, 15), 9.55, 7.5, (222, 206, 600), 7064, 4797, 11e6, 9e3, 420),
    "rig-2-spring-c": CgsTable((25.4, 1.27, 25.4, 25.4), 14.2, 12.7, (324, 264, 856), 23784, 15100, 4e6, 5.5e3, 420),
    "rig-2-spring-d": CgsTable((25.4, 1.27, 25.4, 25.4), 14.2, 12.7, (324, 264, 856), 23784, 15100, 8e6, 5.5e3, 420),
}

# Table 3.1: I_A and g as printed (the notes give g = 981 cm/s2)
CRANK_INERTIA_G_CM2 = 12500.0
GRAVITY_CM_S2 = 981.0

# --- An independent derivation, cross-checked against two multibody engines: Table 3.1 at 420 rpm, k = 1e6 dyn/cm,
# --- mu = 3e4 dyn.s/cm, from u = u' = th2 = 0
U_CM_AT_CRANK_DEG: Mapping[int, float] = {90: 0.5091697521, 360: -1.0018190123, 720: -0.8902721383, 1080: -0.8955749071}
CRANK_TORQUE_AT_START_DYN_CM = -1.129656931e7
FORCE_AT_C_AT_360_DEG_DYN = (79534.254, 537313.426)
STEADY_U_CM = -0.89553115
STEADY_U_RATE_CM_S = -21.92156554

# The same from rest under the torque T = T0 (1 - th2) up to th2 = 1 rad, then T = 0; T0 = 1e8 dyn.cm, k = 1e6, mu = 3e4
TORQUE_T0_DYN_CM = 1e8
TORQUE_END_TIME_S = 0.02137446194
TORQUE_AT_0_25_S = {"th2_rad": 17.8051227, "u_cm": -0.61160400, "th2_rate_rad_s": 72.7805553}

# --- Statements of chapter III, as checked by that derivation
# fig. 3.2, k = 0: turns after which coupler and rocker reach sin(th4 - th3) = 0.3, by mu in dyn.s/cm. The thesis calls
# the drift linear; it accelerates, and is nearly linear only for mu of 5e5 and more
TURNS_TO_SINE_0_3: Mapping[float, float] = {1e4: 3.0, 5e4: 4.9, 1e5: 8.0, 5e5: 36.0}
# fig. 3.3: u after forty turns at mu = 1e6 dyn.s/cm, by gravity in m/s2; the thesis calls M "slightly reduced" without gravity
U_AFTER_40_TURNS_CM: Mapping[float, float] = {9.81: -1.93, 0.0: -2.38}
# fig. 3.4: crank angle of the least steady u, and mean u, by k in dyn/cm ("220" in the scan is 22 deg)
LEAST_STEADY_U_AT_DEG: Mapping[float, float] = {5e5: 23.45, 1e6: 17.5, 2e6: 5.2}
MEAN_STEADY_U_CM: Mapping[float, float] = {5e5: -0.611, 1e6: -0.280, 2e6: -0.142}
# fig. 3.5: the steady torque at k = 5e5 and at k = 2e6 differs by this fraction of its peak; where it reverses steeply
TORQUE_DIFFERENCE_OF_PEAK = 0.096
TORQUE_REVERSAL_DEG_DYN_CM = ((327.0, 1.46e7), (16.0, -2.00e7))
# fig. 3.14, k = 2e6: half the natural frequency with the mean effective mass (rad/s); the thesis has "around 27"
HALF_NATURAL_FREQUENCY_RAD_S = 25.55
# fig. 3.7: the thesis calls T0 hyperbolic in the time to 1 rad; T0 t^2 is nearly constant, exponent of t on T0
TORQUE_TIME_EXPONENT = -1.95

# --- Errors of the source in chapters II and III
# appendix 1, KINE: its "+ root" changes assembly once B passes D and divides by zero with B vertically above or below D:
# see tests/plant/test_kinematics.py
# appendix 1, FY45: the weight of the rocker enters the vertical force with the wrong sign: see tests/plant/test_dynamics.py

# --- Chapters IV and V: massless coupler, rocker's centre of mass on the slider pin, l3 = l4 = l1, horizontal; omega_c is
# --- mu/(m4 + m5). "Right" is the independent derivation; "thesis" what the code of appendices 2 to 4 gives
SIGMA2 = 0.05
P45 = 0.2
# the linearised slider equation for I4 = 1: mean, cosine and sine of the first harmonic of M, K and F
SLIDER_EQUATION: Mapping[str, tuple[float, float, float]] = {
    "mass": (1.0669267, -0.0022055, 0.0115374),
    "stiffness": (-0.0008213, 0.0020824, -0.003833),
    "force": (-0.0002234, -0.0033715, -0.0057687),
}


class ThesisAndRight(NamedTuple):
    """A result of the thesis's code, and the correct result."""

    thesis: float
    right: float


# undamped resonance (rad/s) by I4: the lower of two neighbouring speeds at which the determinant vanishes
RESONANCE: Mapping[float, ThesisAndRight] = {
    0.5: ThesisAndRight(31.0763, 31.0975),
    1.0: ThesisAndRight(30.5572, 30.5979),
    1.5: ThesisAndRight(30.0632, 30.1220),
}
# the upper one at I4 = 1.5 by the thesis's code
UPPER_RESONANCE_THESIS = 30.0645
# the same at I4 = 1 with the printed coefficients of (4.21) in the program's place
RESONANCE_PRINTED = 30.6120
# lower and upper end in lambda_k^2 of the first unstable region by I4: thesis's appendix 3, and about the periodic orbit
FIRST_REGION_THESIS = {0.5: (0.25786, 0.26031), 1.0: (0.26580, 0.27054), 1.5: (0.27382, 0.28069)}
FIRST_REGION = {0.5: (0.258298, 0.259203), 1.0: (0.266540, 0.268367), 1.5: (0.274727, 0.277501)}
# omega_c (1/s) that removes the region everywhere up to I4 = 1.5: stated by the thesis, by its appendix 4 when run, true
REMOVING_DAMPING_READ_OFF, REMOVING_DAMPING_THESIS, REMOVING_DAMPING = 0.45, 0.459, 0.167
# second harmonic near half the natural frequency: how many times too small that of appendix 2 is when run, "about"
SECOND_HARMONIC_TOO_SMALL = 7.0

# --- RIGS: chapter VIII, speeds in rpm by spring, of the thesis and right. Its natural frequencies 580 and 1160 are calculated,
# --- as 1 to 2 where the springs A and B are as 3 to 11 in their printed digits; 585 and 825 are measured, and calculated as
# --- 582 and 829
NATURAL_RPM = {
    "rig-1-spring-a": ThesisAndRight(580.0, 592.0),
    "rig-1-spring-b": ThesisAndRight(1160.0, 1133.0),
    "rig-2-spring-c": ThesisAndRight(585.0, 585.5),
    "rig-2-spring-d": ThesisAndRight(825.0, 828.0),
}
LOCAL_MAXIMUM_RPM = {"a": ThesisAndRight(290.0, 296.0), "b": ThesisAndRight(580.0, 564.0)}
MINIMUM_RPM = {"a": ThesisAndRight(345.0, 367.0)}

# --- Chapter VI. Linkages as printed: X0, Y0, l1, l2, l3, l4, r (cm), a1, th20, a2 (deg); of rocker functions l1 ... l4, th20.
# --- The packaging machine's th20 is not printed
CHAPTER_6: Mapping[str, tuple[float, ...]] = {
    "ellipse-a": (16.48, -47.89, 65.31, 5.04, 112.85, 104.34, 63.26, -92.82, 96.26, 114.02),
    "ellipse-b": (-60.48, 169.45, 165.65, 7.95, 179.09, 216.94, 174.32, -3.44, -27.05, -136.94),
    "ellipse-a-bounded": (19.6, 0.03, 16.4, 5.01, 26.5, 22.0, 15.4, 93.8, 93.2, 127.3),
    "rocker": (0.0, 0.0, 5.083, 2.615, 4.148, 3.75, 0.0, 0.0, 41.88, 0.0),
    "rocker-weighted": (0.0, 0.0, 15.65, 6.91, 11.77, 11.56, 0.0, 0.0, 42.74, 0.0),
    "path-a": (154.85, -62.54, 80.216, 5.03, 139.25, 129.46, 77.75, -93.22, 100.41, 113.83),
    "path-b": (-49.13, 144.98, 142.576, 8.18, 152.743, 183.443, 147.38, -3.062, -31.19, -136.04),
    "packaging": (94.53, -48.55, 137.54, 36.05, 134.05, 40.06, 435.15, 116.73, 0.0, 345.01),
}
# ERRATA: by problem, the index of a misprinted number in the row above, and the number that must be meant
CHAPTER_6_READ: Mapping[str, tuple[int, float]] = {
    "ellipse-a-bounded": (7, -93.8),
    "path-a": (0, 15.485),
    "path-b": (5, 184.443),
}


class PrintedAndTrue(NamedTuple):
    """An error as printed, the true error of the printed linkage with its tolerance, and the error that can be reached."""

    printed: float
    true: float
    digits: float
    goal: float


# cm2; of the rocker functions deg2, at N = 72 and, weighted and divided by the weight 1000, at N = 24
CHAPTER_6_ERRORS: Mapping[str, PrintedAndTrue] = {
    "ellipse-a": PrintedAndTrue(0.889, 5.64, 5e-3, 0.46),
    "ellipse-b": PrintedAndTrue(4.001, 9.15, 5e-3, 0.62),
    "ellipse-a-bounded": PrintedAndTrue(53.6, 30.4, 0.05, 6.4),
    "rocker": PrintedAndTrue(700.0, 1059.9, 0.05, 1025.0),
    "rocker-weighted": PrintedAndTrue(35.0, 35.8, 0.05, 35.6),
    "path-a": PrintedAndTrue(2.3, 3.11, 5e-3, 0.125),
    "path-b": PrintedAndTrue(12.6, 12.61, 5e-3, 0.31),
}
# the unweighted rocker function at N = 48: true and least error found; range of ellipse (a)'s error as its digits are rounded
ROCKER_AT_48 = (721.0, 695.8)
ELLIPSE_A_OVER_ROUNDING = (4.86, 6.54)
# weighted rocker function, N = 72: sum of squared errors from 60 to 260 deg, of the printed linkage and with a free mounting
WINDOW_SUM, WINDOW_SUM_MOUNTED = 104.9, 3.1
# packaging machine: travel, flatness (cm), area (cm2), least transmission angle (deg)
PACKAGING = (175.8, 6.99, 1444.0, 10.5)

# --- Characteristic values of Mathieu's equation y'' + (a - 2 q cos 2t) y = 0: M. Abramowitz, I. A. Stegun, Handbook of
# --- Mathematical Functions, National Bureau of Standards 1964, Table 20.1: by q, a_r and b_r by r, as printed
MATHIEU_A: Mapping[float, Mapping[int, float]] = {
    5.0: {0: -5.80004602, 1: 1.85818754, 2: 7.44910974, 5: 25.54997175},
    10.0: {0: -13.93697996, 1: -2.39914240, 2: 7.71736985, 5: 27.70376873},
    25.0: {0: -40.25677955, 1: -21.31489969, 2: -3.52216473},
}
MATHIEU_B: Mapping[float, Mapping[int, float]] = {
    5.0: {1: -5.79008060, 2: 2.09946045, 5: 25.51081605},
    10.0: {1: -13.93655248, 2: -2.38215824, 5: 26.76642636},
    25.0: {1: -40.25677898, 2: -21.31486062},
}

# --- Driven damped pendulum ph'' + 2 b ph' + w0^2 sin(ph) = g w0^2 cos(w t), w = 2 pi, w0 = 3 pi, b = w0 / 4: J. R. Taylor,
# --- Classical Mechanics, University Science Books 2005, Table 12.1: g at which the period doubles for the nth time
PENDULUM_DOUBLINGS = (1.0663, 1.0793, 1.0821, 1.0827)
# Ratio of successive intervals in the limit: M. J. Feigenbaum, J. Stat. Phys. 19 (1978) 25
FEIGENBAUM = 4.6692016

# --- What other continuation codes gave for the branches of tests/oracles/continued.py: fold or period doubling, and the
# --- parameter there: `python -m tests.oracles.continued`. Units: as there; the five-bar, rig 1 with spring B, in rad/s
CONTINUED: Mapping[str, Mapping[str, list[tuple[str, float]]]] = {
    # AUTO-07p as it is in bifpy 0.3.0, printed to 11 digits
    "AUTO-07p": {
        "duffing": [("fold", 1.522448029), ("fold", 1.2520149591)],
        "pendulum": [("period doubling", 1.0663728625)],
        "pendulum, 2 turns": [("period doubling", 1.0793139059)],
        "pendulum, 4 turns": [("period doubling", 1.0820843843)],
        "five-bar, small motion": [("fold", 108.48612255)],
        "five-bar, large motion": [("period doubling", 97.675574991)],
        "five-bar, 2 turns": [("period doubling", 95.991846905)],
    },
    # its folds are solved to residuals of 1e-6, its period doublings bisected to 1e-6
    "jaxcont 0.4.0": {
        "duffing": [("fold", 1.5224480603), ("fold", 1.2520149536)],
        "pendulum": [("period doubling", 1.066372665)],
    },
}
