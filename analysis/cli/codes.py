"""Exit codes of the commands, in addition to 0 for done and Click's 2 for a wrong command line."""

#: An input was wrong; a message says which.
WRONG = 1
#: A run ended early; the data so far are kept.
ENDED_EARLY = 3
#: A check failed.
CHECK_FAILED = 4
#: Interrupted from the keyboard; what was computed is kept.
INTERRUPTED = 130
