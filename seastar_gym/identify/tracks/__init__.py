"""Tracks of cameras, from the files of trackers to what `identify` reads.

track.py    points and orientations over time, and how they become those of nodes from a robot at rest
plane.py    from pixels to metres
hdf5.py     what a file of HDF5 declares, before it is read
pose.py, deeplabcut.py, sleap.py, motive.py    readers, one per format
command.py  `seastar track2csv`
"""

from seastar_gym.identify.tracks.deeplabcut import read_deeplabcut
from seastar_gym.identify.tracks.motive import read_motive
from seastar_gym.identify.tracks.pose import read_pose
from seastar_gym.identify.tracks.sleap import read_sleap

__all__ = ["read_deeplabcut", "read_motive", "read_pose", "read_sleap"]
