"""The arguments that name the files of a stereo pair, or of a sequence of pairs."""

from __future__ import annotations

import argparse

from stereolag.io.disparities import DISPARITY_FORMATS

AUTO, YES, NO = "auto", "yes", "no"
"""Values of ``--rectify``: whether the images are to be rectified."""


def add_pair(parser: argparse.ArgumentParser) -> None:
    """Add the arguments for the files of a pair and the output of its map to a parser."""
    parser.add_argument("left", metavar="LEFT", help="the left image: PNG, JPEG, WEBP, BMP, TIFF, PPM, PGM or GIF")
    parser.add_argument("right", metavar="RIGHT", help="the right image, of the same size")
    files = parser.add_argument_group("files")
    files.add_argument("--truth", metavar="FILE", help="ground truth to judge the map by: PFM, NPY, PNG or PGM")
    _add_calibration(files, "")
    files.add_argument(
        "--out",
        metavar="DIR",
        help="write the map to this folder: disparity as .pfm, .npy, _kitti.png (16 bits, × 256) and _coloured.png, "
        "settings.json, and with a calibration cloud.ply; nothing is written unless given",
    )


def add_frames(parser: argparse.ArgumentParser) -> None:
    """Add the arguments for the files of a sequence and the output of its maps to a parser."""
    parser.add_argument(
        "left",
        metavar="LEFT",
        help="left pictures, as a folder or a pattern in quotes, or the left video; alone: a ZIP of both sides, or a "
        "video of both side by side",
    )
    parser.add_argument("right", metavar="RIGHT", nargs="?", help="the same for the right")
    files = parser.add_argument_group("files")
    files.add_argument(
        "--out",
        metavar="DIR",
        required=True,
        help="write the maps to this folder: METHOD/FRAME.png (disparity × 256 in 16 bits), frames.csv with figures of "
        "every frame, and sequence.json; frames that are finished there are not matched again",
    )
    files.add_argument(
        "--disparity-format",
        choices=[*DISPARITY_FORMATS],
        default=".png",
        help=f"format of the maps; {_held()} (default: %(default)s)",
    )
    files.add_argument(
        "--video",
        metavar="FILE.mp4",
        help="write a video of the left pictures beside the maps, in one range of colours",
    )
    files.add_argument("--truth", metavar="FILES", help="a folder or pattern of true disparities to judge the maps by")
    _add_calibration(files, "; gives the nearest obstacle in metres")
    files.add_argument(
        "--frame-rate", type=float, metavar="HZ", help="frames a second (default: that of the video; 10 for pictures)"
    )


def _add_calibration(files: argparse._ArgumentGroup, further: str) -> None:
    files.add_argument(
        "--calibration",
        metavar="FILE",
        nargs="+",
        help=f"calibration of OpenCV, ROS, Kalibr, Middlebury, KITTI or JSON, in one file or two{further}",
    )
    files.add_argument(
        "--rectify",
        choices=[AUTO, YES, NO],
        default=AUTO,
        help="with a calibration of both cameras: whether the images are raw (default: auto, judged by their rows)",
    )


def _held() -> str:
    """Return the disparities that each format holds, in words."""
    suffixes: dict[str, list[str]] = {}
    for suffix, kind in DISPARITY_FORMATS.items():
        suffixes.setdefault(kind.holds, []).append(suffix)
    return ", ".join(
        f"{' and '.join(some)}{' hold' if len(some) > 1 else ''} {held}" for held, some in suffixes.items()
    )
