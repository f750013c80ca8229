"""Sends where an AprilTag on the hub is to `seastar drive`, from a camera that looks straight down, by OpenCV.

    pip install opencv-python-headless
    python examples/april_tags.py --camera 0 --metres-per-pixel 5e-4
    seastar drive policy.safetensors --plant serial:/dev/ttyACM0 --tracker serial:/dev/pts/7   # as it says

The tag is of the family 36h11, its x-axis along limb 1. The time of a picture is when it was read: by how much a camera
is late before that, `seastar identify --delay` finds. Places are from the middle of the picture, x right and y up.
"""

import math
import os
import time
import tty
from argparse import ArgumentParser
from contextlib import suppress

import cv2

from seastar_gym.plant.lines import Lines, line_of
from seastar_gym.plant.plant import PlantError, Sighting

parser = ArgumentParser(description=__doc__)
parser.add_argument("--camera", default="0", help="number of the camera, or a film")
parser.add_argument("--tag", type=int, default=0, help="number of the tag")
parser.add_argument("--metres-per-pixel", type=float, required=True, help="size of a pixel at the tag [m]")
options = parser.parse_args()

ours, theirs = os.openpty()  # the two ends of a serial line within this computer
tty.setraw(theirs)
print(f"--tracker serial:{os.ttyname(theirs)}", flush=True)
line, family = (
    Lines(os.fdopen(ours, "rb+", buffering=0)),
    cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11),
)
camera = cv2.VideoCapture(int(options.camera) if options.camera.isdigit() else options.camera)
detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
while (taken := camera.read())[0]:
    captured = time.monotonic()
    squares, numbers, _ = detector.detectMarkers(taken[1])
    for square, number in zip(squares, [] if numbers is None else numbers.ravel(), strict=True):
        if number == options.tag:
            height, width = taken[1].shape[:2]
            x, y = options.metres_per_pixel * (square[0].mean(axis=0) - [width / 2, height / 2])
            along = square[0][1] - square[0][0]  # from the tag's upper left corner to its upper right one
            pose = float(x), -float(y), math.atan2(-along[1], along[0])
            with suppress(PlantError):  # while nobody reads
                line.send(line_of(Sighting(captured, time.monotonic(), pose)))
