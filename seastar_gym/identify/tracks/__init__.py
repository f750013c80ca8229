"""Tracks of cameras, from the files of trackers to what `identify` reads.

track.py    points and orientations over time, and how they become those of nodes from a robot at rest
plane.py    from pixels to metres
pose.py, deeplabcut.py, sleap.py, motive.py    readers, one per format
command.py  `seastar track2csv`
"""
