"""One camera in every format: the same calibration is read from every file."""

from __future__ import annotations

import camera_files as files
import numpy as np
import pytest
import yaml
from camera_files import BOTH_CAMERAS, D1, D2, M1, M2, P1, P2, R1, R2, RAW, RECTIFIED, RECTIFYING, SIZE, R, T

from stereolag.geometry.calibration import Calibration
from stereolag.io.calibrations import read_calibration

BASELINE = float(np.linalg.norm(T))


def is_this_camera(calibration: Calibration, tolerance: float = 1e-9) -> None:
    rig = calibration.rig
    assert rig is not None
    for found, expected in (
        (rig.left_matrix, M1),
        (rig.right_matrix, M2),
        (rig.rotation, R),
        (rig.translation, T[:, 0]),
    ):
        np.testing.assert_allclose(found, expected, atol=tolerance)
    for found, expected in ((rig.left_distortion, D1[0]), (rig.right_distortion, D2[0])):
        np.testing.assert_allclose(found, expected[: found.size])


def is_rectified_as_here(calibration: Calibration, tolerance: float = 1e-6) -> None:
    assert calibration.focal_px == pytest.approx(P1[0, 0], rel=tolerance)
    assert calibration.baseline_m == pytest.approx(BASELINE, rel=tolerance)
    assert calibration.doffs_px == pytest.approx(P2[0, 2] - P1[0, 2], abs=1e-6)
    assert (calibration.cx, calibration.cy) == pytest.approx((P1[0, 2], P1[1, 2]), rel=tolerance)


@pytest.mark.parametrize("name", RAW)
def test_both_cameras(name):
    calibration = read_calibration(*RAW[name]())
    is_this_camera(calibration)
    assert calibration.rig.rectification is None
    assert (calibration.width, calibration.height) == SIZE
    # The fifth coefficient is 0 here, so Kalibr's four describe the whole lens.
    is_rectified_as_here(calibration)


@pytest.mark.parametrize("name", RECTIFYING)
def test_both_cameras_and_how_to_rectify_them(name):
    calibration = read_calibration(*RECTIFYING[name]())
    is_this_camera(calibration, 1e-6)
    is_rectified_as_here(calibration)
    how = calibration.rig.rectification
    for found, expected in (
        (how.left_rotation, R1),
        (how.right_rotation, R2),
        (how.left_projection, P1),
        (how.right_projection, P2),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("name", RECTIFIED)
def test_the_rectified_pair(name):
    calibration = read_calibration(*RECTIFIED[name]())
    assert calibration.rig is None
    is_rectified_as_here(calibration)


def test_lengths_without_a_unit_are_in_that_which_is_said():
    millimetres = BOTH_CAMERAS | {"T": T * 1000, "R1": R1, "R2": R2, "P1": P1, "P2": P2 * [[1, 1, 1, 1000]]}
    is_this_camera(read_calibration(files.npz(**millimetres), length_unit_m=0.001))
    is_rectified_as_here(read_calibration(files.npz(**millimetres), length_unit_m=0.001))
    for metres in ([files.kalibr()], [files.ros("left"), files.ros("right")]):
        assert read_calibration(*metres, length_unit_m=0.001).baseline_m == pytest.approx(BASELINE)


def test_aliases_of_yaml_are_followed():
    matrix = M1.tolist()
    data = yaml.safe_dump({"K1": matrix, "K2": matrix, "R": R.tolist(), "T": T.ravel().tolist()})
    assert "*id" in data
    np.testing.assert_array_equal(read_calibration(data.encode()).rig.right_matrix, M1)


def test_a_document_after_the_first_is_not_read():
    data = files.opencv(".yml", **BOTH_CAMERAS)
    is_this_camera(read_calibration(data + b"...\n---\nM1: 3\n"))


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        ([files.npz(M1=M1, D1=D1, M2=M2, D2=D2)], r"has M1, D1, M2, D2, but lacks rotation \(R\), translation \(T\)"),
        ([files.npz(mtxL=M1, distL=D1, R=R, T=T)], r"lacks right camera matrix \(M2\)"),
        ([files.npz(mtx=M1, dist=D1, rms=np.array(0.2))], r"of one camera alone \(mtx, dist, rms\); give the file of"),
        ([files.ros("left")], "left camera alone: “projection_matrix” has no baseline"),
        ([files.npz(mtx=M1, dist=D1)] * 3, "3 files hold the calibration of one camera each"),
        ([files.npz(stereoMapL_x=np.zeros((480, 640)))], "holds no names with values"),
        ([files.npz(E=np.eye(3), F=np.eye(3))], "holds E, F: it is in no known format, or lacks both cameras"),
        ([files.npz(K1=np.array([None]), K2=M2, R=R, T=T)], "lacks left camera matrix"),
        ([files.kalibr(distortion_model="equidistant")], "“equidistant” for “cam1.distortion_model”.*are plumb"),
        ([files.kalibr(camera_model="omni")], "“omni” for “cam1.camera_model”.*allowed are pinhole"),
        ([files.as_json(fx=700, fy=700, cx=3)], "has no baseline_m; .* It has fx, fy, cx"),
        ([files.npz(**(BOTH_CAMERAS | {"R1": np.eye(3)[::-1] * [1, -1, 1], "R2": R2, "P1": P1, "P2": P2}))], "R1"),
        ([files.npz(**(BOTH_CAMERAS | {"R1": R1, "R2": R2, "P1": P1, "P2": P2 + np.eye(3, 4) * 9}))], "second row"),
        ([b"!!python/object/apply:os.system ['true']"], "no known format"),
        ([files.opencv(".xml", M1=M1)[:150]], "XML: it is broken or cut short at line"),
        ([np.arange(3).tobytes() + b"\xff"], "not a text file .* or an .npz"),
    ],
)  # fmt: skip
def test_what_is_missing_is_said_and_what_was_found(sources, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_calibration(*sources)
    assert "\n" not in str(caught.value)


def test_the_chessboard_cameras_of_opencv(data_dir):
    folder = data_dir / "calibration" / "opencv_chessboard"
    calibration = read_calibration(folder / "intrinsics.yml", folder / "extrinsics.yml")
    assert calibration.rig.left_matrix[0, 0] == pytest.approx(533.98795381630)
    assert calibration.rig.right_distortion.size == 14
    assert calibration.focal_px == pytest.approx(439.64859505829611)
    assert (calibration.cx, calibration.cy) == pytest.approx((319.32437133789062, 239.45363616943359))
    assert calibration.baseline_m == pytest.approx(1469.7622406427524 / 439.64859505829611)
    assert calibration.rig.rectification.left_projection[0, 0] == calibration.focal_px
