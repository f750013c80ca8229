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
from typing import NoReturn

import cv2

from seastar_gym.command import run_command
from seastar_gym.plant.lines import Lines, line_of
from seastar_gym.plant.plant import PlantError, Sighting

parser = ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--camera", default="0", help="number of the camera, or a film")
parser.add_argument("--tag", type=int, default=0, help="number of the tag (default: 0)")
parser.add_argument("--metres-per-pixel", type=float, required=True, help="size of a pixel at the tag [m]")


def main() -> NoReturn:
    """Send what the camera sees until it ends, or Ctrl-C."""
    options = parser.parse_args()
    pixel = options.metres_per_pixel
    if not 0.0 < pixel < math.inf:
        parser.error(f"--metres-per-pixel must be positive, not {pixel:g}.")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what is wrong is said here, in a sentence
    camera = cv2.VideoCapture(int(options.camera) if options.camera.isdigit() else options.camera)
    if not camera.isOpened():
        raise SystemExit(f"There is no camera {options.camera}: give another --camera.")
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    ours, theirs = os.openpty()  # the two ends of a serial line within this computer
    tty.setraw(theirs)
    line = Lines(os.fdopen(ours, "rb+", buffering=0))
    print(f"--tracker serial:{os.ttyname(theirs)}", flush=True)
    while (taken := camera.read())[0]:
        captured = time.monotonic()
        squares, numbers, _ = detector.detectMarkers(taken[1])
        for square, number in zip(squares, [] if numbers is None else numbers.ravel(), strict=True):
            if number == options.tag:
                height, width = taken[1].shape[:2]
                x, y = pixel * (square[0].mean(axis=0) - [width / 2, height / 2])
                along = square[0][1] - square[0][0]  # from the tag's upper left corner to its upper right one
                pose = float(x), -float(y), math.atan2(-along[1], along[0])
                with suppress(PlantError):  # while nobody reads
                    line.send(line_of(Sighting(captured, time.monotonic(), pose)))
    raise SystemExit(f"Camera {options.camera} gives no more pictures.")


if __name__ == "__main__":
    run_command(main)
