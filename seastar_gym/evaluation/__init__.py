"""Evaluation: agents swim, and what they did becomes numbers, pictures and pages.

In come agents by name and paths or tasks; out go swims, tables with intervals, films and reports. There is one loop,
`rollout`, one robot or many side by side, nominal or disturbed, so that every number of every table is of the same
swim.
"""
