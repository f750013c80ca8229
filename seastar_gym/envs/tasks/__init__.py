"""Tasks in which there is more to gain than a greedy rule gains, by measurement; see docs/tasks.md.

numbered.py    episodes by split and number
challenge.py   what a task is made of
miswired.py    limbs whose wires may be swapped
prey.py        prey that is faster than the robot, course.py its courses
station.py     a place to keep in a current that shows in the velocities
fail_blind.py  dead limbs of a robot that sees its way alone
obst_trap.py   a goal behind discs, most of which may form a horseshoe, discs.py the ways around them
prizes.py      more prizes than can be reached, rounds.py the best choice of them
sim_to_real.py a robot that a late camera sees, and whose stiffness and drag are not known
envs.py        the environments
"""
