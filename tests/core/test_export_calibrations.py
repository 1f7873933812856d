"""Exported calibrations are read back unchanged by OpenCV, by ROS's rules and by this library."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import stereolag as sl
from stereolag.geometry.calibration import StereoRig
from stereolag.geometry.rectification import rectified_calibration
from stereolag.io.calibrations import calibration_json, opencv_calibration, ros_calibration

SIZE = (640, 480)


def calibration(coefficients: int = 5) -> sl.Calibration:
    distortion = np.zeros(coefficients)
    distortion[:4] = [-0.28, 0.09, 0.0005, -0.0004]
    distortion[-1] = 0.01
    rig = StereoRig(
        left_matrix=np.array([[530, 0, 325], [0, 532, 237], [0, 0, 1.0]]),
        left_distortion=distortion,
        right_matrix=np.array([[533, 0, 313], [0, 534, 244], [0, 0, 1.0]]),
        right_distortion=0.9 * distortion,
        rotation=cv2.Rodrigues(np.array([0.01, -0.02, 0.008]))[0],
        translation=np.array([-0.1, 0.001, 0.002]),
        width=640,
        height=480,
    )
    return replace(rectified_calibration(rig, SIZE), rig=rig, rms=0.2)


def check_same(read: sl.Calibration, written: sl.Calibration) -> None:
    assert read.rig is not None
    assert written.rig is not None
    for name in ("left_matrix", "right_matrix", "left_distortion", "right_distortion", "rotation", "translation"):
        np.testing.assert_allclose(getattr(read.rig, name), getattr(written.rig, name), rtol=1e-9, atol=1e-12)
    assert (read.width, read.height) == SIZE
    assert read.focal_px == pytest.approx(written.focal_px)
    assert read.baseline_m == pytest.approx(written.baseline_m)


@pytest.mark.parametrize("coefficients", [5, 8, 12])
def test_opencv_reads_its_yaml_and_so_do_we(tmp_path: Path, coefficients: int) -> None:
    written = calibration(coefficients)
    assert written.rig is not None
    text = opencv_calibration(written)
    check_same(sl.read_calibration(text.encode()), written)
    file = tmp_path / "stereo.yml"
    file.write_text(text, encoding="utf-8")
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ)
    read = {
        name: storage.getNode(name).mat() for name in ("M1", "D1", "M2", "D2", "R", "T", "R1", "R2", "P1", "P2", "Q")
    }
    storage.release()
    np.testing.assert_allclose(read["T"].ravel(), written.rig.translation)
    expected = cv2.stereoRectify(
        read["M1"], read["D1"], read["M2"], read["D2"], SIZE, read["R"], read["T"], flags=1024, alpha=0
    )
    for name, matrix in zip(("R1", "R2", "P1", "P2", "Q"), expected[:5], strict=True):
        np.testing.assert_allclose(read[name], matrix, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("coefficients", [5, 8])
def test_the_ros_pair_is_read_back(coefficients: int) -> None:
    written = calibration(coefficients)
    left, right = ros_calibration(written)
    check_same(sl.read_calibration(left.encode(), right.encode()), written)
    assert f"distortion_model: {'plumb_bob' if coefficients == 5 else 'rational_polynomial'}" in left


def test_ros_has_no_name_for_more_coefficients() -> None:
    with pytest.raises(ValueError, match="12 distortion coefficients"):
        ros_calibration(calibration(12))


def test_our_json_is_read_back_with_and_without_cameras() -> None:
    written = calibration()
    check_same(sl.read_calibration(calibration_json(written).encode()), written)
    plain = sl.Calibration(700.0, 0.12, 3.0, 320.0, 240.0, width=640, height=480, num_disparities=96)
    assert sl.read_calibration(calibration_json(plain).encode()) == plain


def test_our_json_is_in_metres_whatever_unit_is_said_of_other_files() -> None:
    written = replace(calibration(), num_disparities=96)
    read = sl.read_calibration(calibration_json(written).encode(), length_unit_m=0.001)
    check_same(read, written)
    assert read.num_disparities == 96
    assert sl.read_calibration(calibration_json(calibration()).encode()).num_disparities is None


@pytest.mark.parametrize("write", [opencv_calibration, ros_calibration])
def test_what_has_no_cameras_cannot_be_written_as_such(write) -> None:
    with pytest.raises(ValueError, match="no rig"):
        write(sl.Calibration(700.0, 0.12))
