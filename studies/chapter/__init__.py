"""The chapter's figures, recomputed, and its statements beside the computed numbers."""

REAL_TIME_FROM = 3e-3
"""Time step [s] from which the chapter's code runs faster than real time."""
ISSUES_FROM = 20e-3
"""Time step [s] from which the chapter reports numerical issues."""
