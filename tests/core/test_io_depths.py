"""Depth maps as files: metres as floats, millimetres as ROS has them, and what either cannot say."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

import stereolag as sl
from stereolag.io.disparities import too_far
from stereolag.io.images import image_png

CAMERA = sl.Calibration(focal_px=700.0, baseline_m=0.12, doffs_px=-2.0)
DISPARITY = np.array([[30.0, np.nan, 2.0], [1.0, 3.25, 3.0]], np.float32)
"""Px: near, none, at infinity, beyond it, at 67.2 m and at 84 m."""

METRES = np.array([[700 * 0.12 / 28, np.nan, np.nan], [np.nan, 700 * 0.12 / 1.25, 700 * 0.12 / 1]], np.float32)


@pytest.mark.parametrize("suffix", [".tif", ".TIFF"])
def test_a_tiff_holds_metres_and_nan_where_there_is_no_depth(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"depth{suffix}"
    sl.write_depth(path, CAMERA.depth(DISPARITY))
    np.testing.assert_array_equal(sl.read_depth(path), METRES)
    theirs = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert theirs.dtype == np.float32
    np.testing.assert_array_equal(theirs, METRES)


def test_a_png_holds_whole_millimetres_and_0_where_there_is_no_depth_or_it_is_beyond(tmp_path: Path) -> None:
    path = tmp_path / "depth.png"
    sl.write_depth(path, CAMERA.depth(DISPARITY))
    theirs = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert theirs.dtype == np.uint16
    np.testing.assert_array_equal(theirs, [[3000, 0, 0], [0, 0, 0]])
    assert too_far(CAMERA.depth(DISPARITY)) == 2
    edge = np.array([[0.0001, 0.0014, 65.5349, 65.5352, 65.536, -1.0, np.inf]])
    sl.write_depth(path, edge)
    np.testing.assert_array_equal(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), [[1, 1, 65535, 65535, 0, 0, 0]])
    none = np.nan
    np.testing.assert_allclose(sl.read_depth(path), [[0.001, 0.001, 65.535, 65.535, none, none, none]], rtol=1e-6)
    assert too_far(edge) == 1


@pytest.mark.parametrize("name", ["depth.pfm", "depth", "depth.jpg"])
def test_another_suffix_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a depth map is written as \.tif, \.tiff, \.png"):
        sl.write_depth(tmp_path / name, METRES)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("stored", [np.zeros((4, 5), np.uint8), np.zeros((4, 5, 3), np.uint16)])
def test_what_is_no_depth_map_is_refused(stored: np.ndarray) -> None:
    with pytest.raises(ValueError, match="The depth map has shape"):
        sl.read_depth(image_png(stored))
    with pytest.raises(ValueError, match="depth has shape"):
        sl.write_depth("never.tif", np.zeros((2, 2, 2)))
