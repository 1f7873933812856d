"""The arguments that name the files of a stereo pair."""

from __future__ import annotations

import argparse

AUTO, YES, NO = "auto", "yes", "no"
"""Whether the images are to be rectified."""


def add_pair(parser: argparse.ArgumentParser) -> None:
    """Tell a parser of the files of a pair, and of where its map goes."""
    parser.add_argument("left", metavar="LEFT", help="the left image: PNG, JPEG, WEBP, BMP, TIFF, PPM, PGM or GIF")
    parser.add_argument("right", metavar="RIGHT", help="the right image, of the same size")
    files = parser.add_argument_group("files")
    files.add_argument("--truth", metavar="FILE", help="ground truth to judge the map by: PFM, NPY, PNG or PGM")
    files.add_argument(
        "--calibration",
        metavar="FILE",
        nargs="+",
        help="of OpenCV, ROS, Kalibr, Middlebury, KITTI or JSON, in one file or two",
    )
    files.add_argument(
        "--rectify",
        choices=[AUTO, YES, NO],
        default=AUTO,
        help="with a calibration of both cameras: whether the images are raw (default: auto, as their rows tell)",
    )
    files.add_argument(
        "--out",
        metavar="DIR",
        help="write the map there: disparity as .pfm, .npy, _kitti.png (16 bits, × 256) and _coloured.png, "
        "settings.json, and with a calibration cloud.ply; nothing is written unless given",
    )
