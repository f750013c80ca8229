"""Tracks of cameras, from the files of trackers to what `identify` reads.

In come tables of any tracker and files of OptiTrack (table.py), DeepLabCut and SLEAP (videos.py); out go points and
orientations over time, in metres, as those of nodes from a robot at rest (track.py). command.py is `seastar track2csv`.
"""

from seastar_gym.identify.tracks.table import read_motive, read_table
from seastar_gym.identify.tracks.track import Track
from seastar_gym.identify.tracks.videos import read_deeplabcut, read_sleap

__all__ = ["Track", "read_deeplabcut", "read_motive", "read_sleap", "read_table"]
