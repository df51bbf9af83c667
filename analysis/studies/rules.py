"""Rule by which all studies convert words of degree in the theses, such as "about" and "slightly", to numbers."""

from __future__ import annotations

#: "About", "approximately", "nearly", "almost", "near", "around", "similar", "in the region of" a number: largest
#: departure relative to it.
ABOUT = 0.15
#: Largest departure from "about" an angle, which has no natural zero (deg).
ABOUT_DEG = 10.0
#: "Slightly", "a little": a change by no more than this, relative to what changes, and by more than `ALIKE`.
SLIGHTLY = 0.15
#: "Small", "negligible", "insignificant": no more than this, relative to the quantity that it is compared with.
SMALL = 0.05
#: "The same", "constant", "linear", "straight", "steady": a difference that cannot be seen on a graph, relative to its scale.
ALIKE = 0.05
#: Words that studies print for a visible fall: a fall by more than "the same".
SEEN_FALL = f"below {1.0 - ALIKE:g}, a fall that can be seen by the rule for *the same*"
#: Accuracy to which a place on a graph can be read: relative to the scale, and for a crank angle (deg).
READ, READ_DEG = 0.02, 3.0

#: "Very close" to an angle: largest departure (deg). "Abnormally" high: least ratio to what it is compared with.
VERY_CLOSE_DEG, ABNORMAL = 1.0, 10.0

#: The rule as the pages print it.
RULE = (
    "**Words of degree.** Both pages convert these words to numbers by one rule; a row that departs from it gives the reason. "
    "*About*, *approximately*, *nearly*, *almost*, *near*, *around*, *in the region of*, *similar*: within "
    f"{100 * ABOUT:g} % of the number; for an angle within {ABOUT_DEG:g} deg; for a number of whole cycles within half a "
    f"cycle. *Slightly*, *a little*: a change by at most {100 * SLIGHTLY:g} % and by more than {100 * ALIKE:g} %. *Small*, "
    f"*negligible*: at most {100 * SMALL:g} % of what it is compared with. *The same*, *constant*, *linear*, *straight*, "
    f"*steady*: within {100 * ALIKE:g} % of the scale, a difference that cannot be seen on a graph. A number that was "
    f"read from a graph: within {100 * READ:g} % of its scale, or {READ_DEG:g} deg. *Very close*: within "
    f"{VERY_CLOSE_DEG:g} deg. *Abnormally*: at least {ABNORMAL:g} times as much. A "
    "printed number: within half a unit of its last digit. *Increases*, *reduces*, *greater*, *sooner*: only the sign decides."
)
