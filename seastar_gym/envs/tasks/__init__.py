"""Tasks in which there is more to gain than a greedy rule gains, by measurement; see docs/tasks.md.

numbered.py    episodes by split and number
challenge.py   what a task is made of
miswired.py    limbs whose wires may be swapped
prey.py        prey that is faster than the robot, course.py its courses
station.py     a place to keep in an unknown current
envs.py        the environments
"""
