"""Tracks of cameras, from the files of trackers to what `identify` reads.

track.py    points and orientations over time, and how they become those of nodes from a robot at rest
plane.py    from pixels to metres
hdf5.py     what a file of HDF5 declares, before it is read
table.py    any CSV file, by the names of its columns
videos.py, motive.py    files of DeepLabCut and SLEAP, and of OptiTrack
command.py  `seastar track2csv`
"""

from seastar_gym.identify.tracks.motive import read_motive
from seastar_gym.identify.tracks.table import read_table
from seastar_gym.identify.tracks.track import Track
from seastar_gym.identify.tracks.videos import read_deeplabcut, read_sleap

__all__ = ["Track", "read_deeplabcut", "read_motive", "read_sleap", "read_table"]
