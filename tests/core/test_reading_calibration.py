"""Calibrations as written by Middlebury, KITTI, OpenCV, ROS and this project."""

from __future__ import annotations

import io
import json

import cv2
import numpy as np
import pytest
from camera_files import D1, D2, M1, M2, P1, SIZE, Q, R, T, opencv, ros

from stereolag.geometry.rectification import rectified_calibration
from stereolag.io.calibrations import read_calibration

MIDDLEBURY = b"""cam0=[3979.911 0 1244.772; 0 3979.911 1019.507; 0 0 1]
cam1=[3979.911 0 1369.115; 0 3979.911 1019.507; 0 0 1]
doffs=124.343
baseline=193.001
width=2964
height=1988
ndisp=270
isint=0
"""

KITTI = b"""calib_time: 09-Jan-2012 13:57:47
P_rect_02: 7.2e+02 0 6.0e+02 4.5e+01 0 7.2e+02 1.7e+02 2.1e-01 0 0 1 2.7e-03
R_rect_02: 1 0 0 0 1 0 0 0 1
P_rect_03: 7.2e+02 0 6.0e+02 -3.39e+02 0 7.2e+02 1.7e+02 2.2e+00 0 0 1 2.7e-03
"""


def test_middlebury_baseline_is_in_millimetres():
    calibration = read_calibration(MIDDLEBURY)
    assert calibration.focal_px == 3979.911
    assert calibration.baseline_m == pytest.approx(0.193001)
    assert (calibration.doffs_px, calibration.cx, calibration.cy) == (124.343, 1244.772, 1019.507)
    assert (calibration.width, calibration.height, calibration.num_disparities) == (2964, 1988, 270)


def test_kitti_baseline_is_between_the_colour_cameras():
    calibration = read_calibration(KITTI)
    assert (calibration.focal_px, calibration.cx, calibration.cy, calibration.doffs_px) == (720, 600, 170, 0)
    assert calibration.baseline_m == pytest.approx((45 + 339) / 720)


def test_kitti_object_and_odometry_files():
    row = "{}: 720 0 600 {} 0 720 170 0 0 0 1 0\n"
    text = "".join(row.format(f"P{camera}", x) for camera, x in enumerate((0, -387, 45, -339)))
    text += "R0_rect 1 0 0 0 1 0 0 0 1\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n"
    assert read_calibration(text.encode()).baseline_m == pytest.approx(384 / 720)
    grey = "".join(text.splitlines(keepends=True)[:2])
    assert read_calibration(grey.encode()).baseline_m == pytest.approx(387 / 720)


def test_opencv_in_two_files_and_in_millimetres():
    intrinsics = opencv(".yml", M1=M1, D1=D1, M2=M2, D2=D2)
    extrinsics = opencv(".yml", R=R, T=T * 1000, Q=Q)
    calibration = read_calibration(intrinsics, io.BytesIO(extrinsics), length_unit_m=0.001)
    assert calibration.rig.width is None
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(T))
    assert calibration.focal_px == pytest.approx(P1[0, 0], rel=0.1)
    assert rectified_calibration(calibration.rig, SIZE).focal_px == pytest.approx(P1[0, 0])


def test_doffs_from_q_agrees_with_opencv():
    _, _, p1, p2, q, *_ = cv2.stereoRectify(M1, D1, M2, D2, SIZE, R, T, flags=0, alpha=0)
    expected = p2[0, 2] - p1[0, 2]
    assert abs(expected) > 1
    for data in (opencv(".yml", Q=q), opencv(".yml", P1=p1, P2=p2)):
        assert read_calibration(data).doffs_px == pytest.approx(expected)
    disparity = np.full((2, 2), 40, np.float32)
    depth = cv2.reprojectImageTo3D(disparity, q)[:, :, 2]
    np.testing.assert_allclose(read_calibration(opencv(".yml", Q=q)).depth(disparity), depth, rtol=1e-5)


def test_ros_right_camera_alone_and_both():
    alone = read_calibration(ros("right"))
    assert alone.rig is None
    assert (alone.width, alone.height) == SIZE
    assert read_calibration(ros("left"), ros("right")).baseline_m == pytest.approx(alone.baseline_m)
    with pytest.raises(ValueError, match="allowed are plumb_bob"):
        read_calibration(ros("left", model="equidistant"), ros("right"))


def test_yaml_as_a_yaml_library_prints_it():
    rows = "\n".join(f"  - {value}" for value in (700, 0, 320, -70, 0, 700, 240, 0, 0, 0, 1, 0))
    data = f"# a camera\nimage_width: 640\nprojection_matrix:\n  cols: 4\n  data:\n{rows}\n  rows: 3\n".encode()
    calibration = read_calibration(data)
    assert (calibration.focal_px, calibration.cx, calibration.cy) == (700, 320, 240)
    assert calibration.baseline_m == pytest.approx(0.1)


def test_a_comma_forgotten_at_the_end_of_a_line():
    data = (
        b"projection_matrix:\n  rows: 3\n  cols: 4\n  data: [700, 0, 320, -70\n    0, 700, 240, 0,\n    0, 0, 1, 0]\n"
    )
    assert read_calibration(data).baseline_m == pytest.approx(0.1)


def test_json_of_this_project():
    values = {
        "focal_px": 900.5, "baseline_m": 0.12, "doffs_px": 3, "cx": 440.0, "cy": 199.5,
        "width": 881, "height": 400, "num_disparities": 64, "units": "px", "nested": {"a": 1}, "nothing": None,
    }  # fmt: skip
    calibration = read_calibration(json.dumps(values).encode())
    assert (calibration.focal_px, calibration.baseline_m, calibration.doffs_px) == (900.5, 0.12, 3)
    assert (calibration.cx, calibration.cy, calibration.width, calibration.height) == (440, 199.5, 881, 400)
    assert calibration.num_disparities == 64
    lists = {
        "K1": M1.tolist(),
        "D1": D1.tolist(),
        "K2": M2.tolist(),
        "D2": [],
        "R": R.tolist(),
        "T": T.ravel().tolist(),
    }
    np.testing.assert_allclose(read_calibration(json.dumps(lists).encode()).rig.left_matrix, M1)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty file"),
        (b"\x89PNG\r\n", "not a text file"),
        (b"a: 1\nb\x00: 2", "Line 2 of the calibration holds a NUL byte"),
        (
            b"hello",
            "holds no names with values: it is in no known format, or lacks both cameras; accepted are files of",
        ),
        (b"{", "cannot be parsed"),
        (b"{" * 50_000, "cannot be parsed"),
        (b'{"a":' * 50_000, "cannot be parsed"),
        (b"x" * 2**21, "at most 1,048,576 are accepted"),
        (b'{"focal_px": 700}', "has no baseline_m"),
        (b'{"focal_px": "much", "baseline_m": 1}', "“focal_px” in the calibration must hold numbers, not “much”"),
        (b'{"focal_px": [1, 2], "baseline_m": 1}', "must hold 1 numbers; it holds 2"),
        (b'{"focal_px": NaN, "baseline_m": 1}', "finite numbers only"),
        (b'{"focal_px": 1e999, "baseline_m": 1}', "finite numbers only"),
        (b'{"focal_px": 700, "baseline_m": -1}', "baseline_m is -1"),
        (b'{"focal_px": 700, "baseline_m": 1, "width": -1}', "allowed are 1 to 100000"),
        (b"cam0=[1 0 2; 0 1 2]\nbaseline=3", "“cam0” in the calibration must hold 9 numbers; it holds 6"),
        (b"P2: 1 2 3\nP3: 1 2 3", "“P2” in the calibration must hold 12 numbers"),
        (KITTI.replace(b"7.2e+02", b"0"), "focal length 0 px"),
        (KITTI.replace(b"-3.39e+02", b"9e+02"), "baseline_m is -"),
        (b"%YAML:1.0\n---\nM1: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [1, 2", "cut short at line 8"),
        (b"%YAML:1.0\n---\nM1: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [1, 2]", "announces 3 × 3"),
        (b"%YAML:1.0\n---\nQ: !!opencv-matrix\n  rows: .Nan\n  cols: 3\n  dt: d\n  data: [1, 2]", "finite numbers"),
        (opencv(".yml", Q=np.zeros((4, 4))), "infinite baseline"),
        (opencv(".yml", M1=M1, D1=D1, M2=M2, D2=D2, R=R, T=-T), "stands to the right of the first"),
        (b"1 2 3\n4 5 6\n", "must hold 12 numbers"),
    ],
)
def test_bad_files_are_one_clear_sentence(data, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_calibration(data)
    assert "\n" not in str(caught.value)


def test_arguments_are_checked():
    with pytest.raises(ValueError, match="at least one file"):
        read_calibration()
    with pytest.raises(ValueError, match="length_unit_m is 0"):
        read_calibration(MIDDLEBURY, length_unit_m=0)


def test_real_calibrations(data_dir):
    folder = data_dir / "sequences" / "kitti_seq1"
    from_text, from_json = read_calibration(folder / "calib.txt"), read_calibration(folder / "calib.json")
    assert from_text == from_json
    assert from_text.baseline_m == pytest.approx(0.53715, abs=1e-5)
    motorcycle = read_calibration(data_dir / "stereo" / "motorcycle_q" / "calib.json")
    assert (motorcycle.focal_px, motorcycle.baseline_m, motorcycle.doffs_px) == (999.421, 0.193001, 32.778)
    with pytest.raises(ValueError, match="no known format"):
        read_calibration(data_dir / "stereo" / "teddy" / "calib.json")
