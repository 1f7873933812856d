"""Calibrations as Middlebury, KITTI, OpenCV, ROS and this project write them."""

from __future__ import annotations

import io
import json

import cv2
import numpy as np
import pytest

from stereolag.geometry.rectification import rectified_calibration
from stereolag.reading import read_calibration

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

M1 = np.array([[532.8, 0, 342.5], [0, 532.9, 234.1], [0, 0, 1]])
M2 = np.array([[537.4, 0, 327.1], [0, 537.0, 250.0], [0, 0, 1]])
D1 = np.array([[-0.28, 0.07, 0.001, 0.0002, 0]])
D2 = np.array([[-0.29, 0.1, -0.0005, 0.0001, 0]])
R = cv2.Rodrigues(np.array([0.01, 0.02, -0.005]))[0]
T = np.array([[-0.0834], [0.001], [0.0002]])
SIZE = (640, 480)


def opencv_file(ending: str, **entries) -> bytes:
    storage = cv2.FileStorage(ending, cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    for name, value in entries.items():
        storage.write(name, value)
    return storage.releaseAndGetString().encode()


def ros(side: str, projection: np.ndarray, matrix=M1, distortion=D1, rotation=R, model="plumb_bob") -> bytes:
    def entry(name: str, values: np.ndarray) -> str:
        numbers = ", ".join(f"{value:.12g}" for value in values.ravel())
        return f"{name}:\n  rows: {values.shape[0]}\n  cols: {values.shape[1]}\n  data: [{numbers}]\n"

    return (
        f"image_width: 640\nimage_height: 480\ncamera_name: {side}\n{entry('camera_matrix', matrix)}"
        f"distortion_model: {model}\n{entry('distortion_coefficients', distortion)}"
        f"{entry('rectification_matrix', rotation)}{entry('projection_matrix', projection)}"
    ).encode()


@pytest.fixture(scope="module")
def rectification():
    return cv2.stereoRectify(M1, D1, M2, D2, SIZE, R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)


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


@pytest.mark.parametrize("ending", [".yml", ".json"])
def test_opencv_with_both_cameras(ending, rectification):
    data = opencv_file(ending, M1=M1, D1=D1, M2=M2, D2=D2, R=R, T=T, image_width=640, image_height=480)
    calibration = read_calibration(data)
    rig = calibration.rig
    for found, expected in ((rig.left_matrix, M1), (rig.right_matrix, M2), (rig.rotation, R)):
        np.testing.assert_allclose(found, expected)
    np.testing.assert_allclose(rig.left_distortion, D1[0])
    np.testing.assert_allclose(rig.right_distortion, D2[0])
    np.testing.assert_allclose(rig.translation, T[:, 0])
    assert calibration.focal_px == pytest.approx(rectification[2][0, 0])
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(T))


def test_opencv_in_two_files_and_in_millimetres(rectification):
    intrinsics = opencv_file(".yml", M1=M1, D1=D1, M2=M2, D2=D2)
    extrinsics = opencv_file(".yml", R=R, T=T * 1000, Q=rectification[4])
    calibration = read_calibration(intrinsics, io.BytesIO(extrinsics), length_unit_m=0.001)
    assert calibration.rig.width is None
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(T))
    assert calibration.focal_px == pytest.approx(rectification[2][0, 0], rel=0.1)
    assert rectified_calibration(calibration.rig, SIZE).focal_px == pytest.approx(rectification[2][0, 0])
    with pytest.raises(ValueError, match=r"lacks rotation \(R\), translation \(T\); give the file"):
        read_calibration(intrinsics)


def test_other_names_for_the_cameras():
    data = opencv_file(".yml", cameraMatrix1=M1, distCoeffs1=D1, cameraMatrix2=M2, distCoeffs2=D2, R=R, T=T)
    np.testing.assert_allclose(read_calibration(data).rig.right_matrix, M2)


def test_opencv_of_the_rectified_pair(rectification):
    _, _, p1, p2, q, *_ = rectification
    for data in (opencv_file(".yml", Q=q), opencv_file(".yml", P1=p1, P2=p2), opencv_file(".json", Q=q)):
        calibration = read_calibration(data)
        assert calibration.rig is None
        assert calibration.focal_px == pytest.approx(p1[0, 0])
        assert calibration.baseline_m == pytest.approx(np.linalg.norm(T))
        assert (calibration.cx, calibration.cy) == pytest.approx((p1[0, 2], p1[1, 2]))
        assert calibration.doffs_px == pytest.approx(0, abs=1e-9)


def test_doffs_from_q_agrees_with_opencv():
    _, _, p1, p2, q, *_ = cv2.stereoRectify(M1, D1, M2, D2, SIZE, R, T, flags=0, alpha=0)
    expected = p2[0, 2] - p1[0, 2]
    assert abs(expected) > 1
    for data in (opencv_file(".yml", Q=q), opencv_file(".yml", P1=p1, P2=p2)):
        assert read_calibration(data).doffs_px == pytest.approx(expected)
    disparity = np.full((2, 2), 40, np.float32)
    depth = cv2.reprojectImageTo3D(disparity, q)[:, :, 2]
    np.testing.assert_allclose(read_calibration(opencv_file(".yml", Q=q)).depth(disparity), depth, rtol=1e-5)


def test_ros_right_camera_alone_and_both(rectification):
    r1, r2, p1, p2, *_ = rectification
    left, right = ros("left", p1, M1, D1, r1), ros("right", p2, M2, D2, r2)
    alone = read_calibration(right)
    assert alone.rig is None
    assert alone.focal_px == pytest.approx(p2[0, 0])
    assert alone.baseline_m == pytest.approx(np.linalg.norm(T))
    assert (alone.width, alone.height) == SIZE
    for sources in ((left, right), (right, left)):
        both = read_calibration(*sources)
        assert both.baseline_m == pytest.approx(alone.baseline_m)
        np.testing.assert_allclose(both.rig.left_matrix, M1)
        np.testing.assert_allclose(both.rig.rotation, R, atol=1e-9)
        np.testing.assert_allclose(both.rig.translation, T[:, 0], atol=1e-9)
    with pytest.raises(ValueError, match="left camera alone"):
        read_calibration(left)
    with pytest.raises(ValueError, match="allowed are plumb_bob"):
        read_calibration(ros("left", p1, M1, D1, r1, "equidistant"), right)


def test_yaml_as_a_yaml_library_prints_it():
    rows = "\n".join(f"  - {value}" for value in (700, 0, 320, -70, 0, 700, 240, 0, 0, 0, 1, 0))
    data = f"# a camera\nimage_width: 640\nprojection_matrix:\n  cols: 4\n  data:\n{rows}\n  rows: 3\n".encode()
    calibration = read_calibration(data)
    assert (calibration.focal_px, calibration.cx, calibration.cy) == (700, 320, 240)
    assert calibration.baseline_m == pytest.approx(0.1)


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
        (opencv_file(".yml", Q=np.zeros((4, 4))), "infinite baseline"),
        (opencv_file(".yml", M1=M1, D1=D1, M2=M2, D2=D2, R=R, T=-T), "stands to the right of the first"),
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
