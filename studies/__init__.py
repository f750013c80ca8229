"""Studies: measurements of the simulator and of learning, each run as `python -m studies.NAME` (extra `studies`)."""
