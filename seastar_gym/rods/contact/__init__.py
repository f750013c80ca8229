"""Contact of limbs with each other and with a body.

In come places of all nodes; out go the pairs that are near each other (pairs.py), their forces (forces.py), and the
linear system that they couple (coupled.py). Limbs that touch are no chains of neighbours any more, so only scenes with
contact pay for it.
"""
