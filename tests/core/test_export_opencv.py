"""The exported OpenCV-only program, run in its own process, makes the same map bit for bit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pairs import shifted_pair

import stereolag as sl
from stereolag.io.disparities import image_png, image_tiff
from stereolag.io.programs import opencv_script
from stereolag.stereo.opencv import BlockMatcher


@pytest.mark.parametrize(
    ("matcher", "kind"),
    [
        (sl.StereoBM(num_disparities=16, block_size=9), "grey"),
        (
            sl.StereoBM(
                num_disparities=32,
                min_disparity=-3,
                block_size=7,
                uniqueness_ratio=5,
                speckle_window_size=20,
                speckle_range=4,
                disp12_max_diff=2,
                pre_filter_cap=20,
                texture_threshold=30,
            ),
            "colour",
        ),
        (sl.StereoSGBM(num_disparities=16, min_disparity=2, disp12_max_diff=-1), "transparent"),
        (sl.StereoSGBM(num_disparities=16, mode="hh", p1=8, p2=90, pre_filter_cap=31), "deep"),
        (sl.StereoSGBM(num_disparities=16, mode="sgbm_3way"), "float"),
    ],
    ids=["BM", "BM all set", "SGBM unchecked", "HH", "3WAY"],
)
def test_the_program_of_opencv_alone_measures_the_same(matcher: BlockMatcher, kind: str, tmp_path: Path) -> None:
    left, right = (made_of(image, kind) for image in shifted_pair(80, 120, 0, -5.3))
    ending, written = ("tif", image_tiff) if kind == "float" else ("png", image_png)
    for side, image in (("left", left), ("right", right)):
        (tmp_path / f"{side}.{ending}").write_bytes(written(image))
    program = opencv_script(matcher, f"left.{ending}", f"right.{ending}")
    assert "import stereolag" not in program
    assert max(map(len, program.splitlines())) <= 120
    (tmp_path / "opencv.py").write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-I", str(tmp_path / "opencv.py")], cwd=tmp_path.parent, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    found, expected = np.load(tmp_path / "disparity.npy"), matcher.compute(left, right).disparity
    assert found.dtype == expected.dtype
    assert np.isfinite(expected).mean() > 0.3
    np.testing.assert_array_equal(found, expected)


def made_of(image: np.ndarray, kind: str) -> np.ndarray:
    """Return an 8-bit grey image as another kind of image."""
    colour = np.stack([image, image // 2, 255 - image], axis=-1)
    match kind:
        case "colour":
            return colour
        case "transparent":
            return np.concatenate([colour, np.full((*image.shape, 1), 200, np.uint8)], axis=-1)
        case "deep":
            return colour.astype(np.uint16) * 14 + 1000
        case "float":
            return image.astype(np.float32) * 0.37
    return image


def test_a_name_is_never_code_nor_a_folder() -> None:
    program = opencv_script(sl.StereoBM(), '../left") + evil("', "C:\\right.png")
    assert "grey_image('left\") + evil(\"')" in program
    assert 'grey_image("right.png")' in program
