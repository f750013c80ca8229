"""Studies: measurements of the simulator, each run as `python -m seastar_gym.studies.NAME` (extra `studies`)."""
