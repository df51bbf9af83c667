"""Exit codes of the commands, beside 0 for done and Click's own 2 for a wrong command line."""

#: An input was wrong; one sentence says which.
WRONG = 1
#: A run ended early; its data are kept.
ENDED_EARLY = 3
#: A check failed.
CHECK_FAILED = 4
#: Interrupted from the keyboard; what was computed is kept.
INTERRUPTED = 130
