"""Actuators: from the commands of limbs to their rotations over time.

In come commands and times; out go rotations [rad], and the state of wires that remember. What an actuator of one's own
has to give is in `base.py`; curves without memory, wires with heat, and limbs that bend as measured are the others.
"""
