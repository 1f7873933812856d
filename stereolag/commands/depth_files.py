"""The files of the depth command: those of the page section "Take it away", under the same names."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from stereolag.commands.depth_pair import DepthPair
from stereolag.core.inputs import Image
from stereolag.figures.legends import searched_range
from stereolag.figures.maps import cloud_ply, coloured_png
from stereolag.figures.pictures import VIRIDIS
from stereolag.io.calibrations import calibration_json
from stereolag.io.disparities import image_png, image_tiff, kitti_png, npy, pfm
from stereolag.io.settings import settings_json
from stereolag.io.sources import write_file
from stereolag.stereo.matcher import DisparityMap


class DepthFile(NamedTuple):
    """A file for a map: its name, its encoder, and whether it is made for a pair."""

    name: str
    make: Callable[[DepthPair, DisparityMap], bytes]
    wanted: Callable[[DepthPair], bool] = lambda pair: True


def _calibration(pair: DepthPair, result: DisparityMap) -> bytes:
    assert pair.calibration is not None
    return calibration_json(pair.calibration).encode()


def _cloud(pair: DepthPair, result: DisparityMap) -> bytes:
    assert pair.calibration is not None
    return cloud_ply(pair.calibration, result.disparity, pair.left)


FILES = (
    DepthFile("disparity.pfm", lambda pair, it: pfm(it.disparity)),
    DepthFile("disparity.npy", lambda pair, it: npy(it.disparity)),
    DepthFile("disparity_kitti.png", lambda pair, it: kitti_png(it.disparity)),
    DepthFile("cloud.ply", _cloud, lambda pair: pair.calibration is not None),
    DepthFile("settings.json", lambda pair, it: settings_json(it.settings).encode()),
    DepthFile("calibration.json", _calibration, lambda pair: pair.rectified_here),
)
"""All but the coloured map, whose palette is an argument, and rectified images, whose suffix depends on their type."""


def written_files(
    folder: str, pair: DepthPair, result: DisparityMap, *, far_is_bright: bool
) -> tuple[list[str], dict[str, str]]:
    """Write the files of a map into a folder, each whole or not at all.

    Parameters
    ----------
    folder
        An existing folder.
    pair, result
        The pair and its map.
    far_is_bright
        Whether to colour far points bright, as the source report does.

    Returns
    -------
    names
        Names of the files written.
    left_out
        Error of each format that cannot store the map, by file name.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    palette = VIRIDIS[::-1] if far_is_bright else VIRIDIS
    makers = {one.name: one.make for one in FILES if one.wanted(pair)}
    makers["disparity_coloured.png"] = lambda _, it: coloured_png(it.disparity, *searched_range([it]), palette)
    if pair.rectified_here:
        for side, image in (("left", pair.left), ("right", pair.right)):
            name = f"{side}.tif" if image.dtype.kind == "f" else f"{side}.png"
            makers[name] = partial(_image_file, image)
    place = Path(folder)
    names: list[str] = []
    left_out: dict[str, str] = {}
    for name, make in makers.items():
        try:
            data = make(pair, result)
        except ValueError as error:
            left_out[name] = str(error)
            continue
        write_file(place / name, data)
        names.append(name)
    return names, left_out


def _image_file(image: Image, *_: object) -> bytes:
    return image_tiff(image) if image.dtype.kind == "f" else image_png(image)
