"""Calibrations: one camera is read from every format, and what is written is read back, by OpenCV too."""

import io
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml

from benchmarks import camera_files as files
from stereolag.geometry.calibration import Calibration, StereoRig
from stereolag.geometry.rectification import calibration_for, rectified_calibration
from stereolag.io.calibrations import calibration_json, opencv_calibration, read_calibration, ros_calibration

M1, M2, D1, D2, R, T, SIZE = files.M1, files.M2, files.D1, files.D2, files.R, files.T, files.SIZE
R1, R2, P1, P2, Q = files.R1, files.R2, files.P1, files.P2, files.Q
RAW, RECTIFYING, RECTIFIED, BOTH_CAMERAS, opencv = (
    files.RAW, files.RECTIFYING, files.RECTIFIED, files.BOTH_CAMERAS, files.opencv
)  # fmt: skip
BASELINE = float(np.linalg.norm(T))
MIDDLEBURY = b"""cam0=[3979.911 0 1244.772; 0 3979.911 1019.507; 0 0 1]
cam1=[3979.911 0 1369.115; 0 3979.911 1019.507; 0 0 1]
doffs=124.343
baseline=193.001
width=2964
height=1988
ndisp=270
isint=0
"""


def is_this_camera(calibration: Calibration, tolerance: float = 1e-9) -> None:
    rig = calibration.rig
    for name, expected in {"left_matrix": M1, "right_matrix": M2, "rotation": R, "translation": T[:, 0]}.items():
        np.testing.assert_allclose(getattr(rig, name), expected, atol=tolerance, err_msg=name)
    for found, expected in ((rig.left_distortion, D1[0]), (rig.right_distortion, D2[0])):
        np.testing.assert_allclose(found, np.pad(expected, (0, max(0, found.size - 5)))[: found.size])


def is_rectified_as_here(calibration: Calibration, tolerance: float = 1e-6) -> None:
    assert calibration.focal_px == pytest.approx(P1[0, 0], rel=tolerance)
    assert calibration.baseline_m == pytest.approx(BASELINE, rel=tolerance)
    assert calibration.doffs_px == pytest.approx(P2[0, 2] - P1[0, 2], abs=1e-6)
    assert (calibration.cx, calibration.cy) == pytest.approx((P1[0, 2], P1[1, 2]), rel=tolerance)


@pytest.mark.parametrize("name", RAW | files.OF_MAKERS)
def test_both_cameras(name):
    calibration = read_calibration(*(RAW | files.OF_MAKERS)[name]())
    is_this_camera(calibration)
    assert calibration.rig.rectification is None
    assert (calibration.width, calibration.height) == SIZE
    # The fifth coefficient is 0 here, so Kalibr's four describe the whole lens.
    is_rectified_as_here(calibration)


@pytest.mark.parametrize("name", RECTIFYING | files.OF_MAKERS_RECTIFYING)
def test_both_cameras_and_how_to_rectify_them(name):
    calibration = read_calibration(*(RECTIFYING | files.OF_MAKERS_RECTIFYING)[name]())
    is_this_camera(calibration, 1e-6)
    is_rectified_as_here(calibration)
    how = calibration.rig.rectification
    found = how.left_rotation, how.right_rotation, how.left_projection, how.right_projection
    for one, expected in zip(found, (R1, R2, P1, P2), strict=True):
        np.testing.assert_allclose(one, expected, atol=1e-6)


@pytest.mark.parametrize("name", RECTIFIED | files.OF_MAKERS_RECTIFIED)
def test_the_rectified_pair(name):
    calibration = read_calibration(*(RECTIFIED | files.OF_MAKERS_RECTIFIED)[name]())
    assert calibration.rig is None
    is_rectified_as_here(calibration)


@pytest.mark.parametrize("name", files.WIDE)
def test_a_fisheye_that_is_declared_is_read_as_one(name):
    rig = read_calibration(*files.WIDE[name]()).rig
    assert rig.fisheye
    for lens in (rig.left_distortion, rig.right_distortion):
        np.testing.assert_allclose(lens, files.FISHEYE[0])
    np.testing.assert_allclose(rig.translation, T[:, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("data", "sizes", "raw"),
    [
        (files.zed(), {(1280, 720): 2.0, (1920, 1080): 3.0, (672, 376): 1.05}, True),
        (files.zed((D1, D2)), {(1280, 720): 2.0, (1920, 1080): 3.0, (672, 376): 1.05}, True),
        (files.realsense(), {(640, 480): 1.0, (1920, 1080): 3.0, (320, 240): 0.5}, False),
    ],
)
def test_of_several_sizes_that_of_the_pictures_is_taken(data, sizes, raw):
    calibration = read_calibration(data)
    assert calibration.baseline_m == pytest.approx(BASELINE, rel=1e-6)
    assert {(one.width, one.height) for one in calibration.modes} == {*sizes}
    for (width, height), factor in sizes.items():
        fitted = calibration_for(calibration, width, height)
        assert (fitted.width, fitted.height) == (width, height)
        found = fitted.rig.left_matrix[0, 0] / M1[0, 0] if raw else fitted.focal_px / P1[0, 0]
        assert found == pytest.approx(factor)
        if raw:
            np.testing.assert_allclose(fitted.rig.right_distortion[:5], D2[0])
            np.testing.assert_allclose(fitted.rig.translation, T[:, 0])


def test_kitti_as_taken_is_rectified_with_its_own_cameras():
    more = {"S_02": np.array([800, 500]), "K_02": M1, "D_02": D1, "R_rect_02": R1}
    calibration = read_calibration(files.kitti(**more, K_03=M2, D_03=D2, R_rect_03=R2))
    assert calibration.rig is None and calibration.notes == ()
    raw = calibration_for(calibration, 800, 500)
    np.testing.assert_allclose(raw.rig.translation, T[:, 0], atol=1e-6)


def test_cameras_one_above_the_other_are_read_as_such():
    below = np.array([[0.001], [-0.12], [0.0]])
    read = read_calibration(files.npz(**(BOTH_CAMERAS | {"T": below})))
    assert (read.turn, read.rig.turn, read.baseline_m) == (1, 1, pytest.approx(0.12, rel=1e-3))
    _, _, p1, p2, q, *_ = cv2.stereoRectify(M1, D1, M2, D2, SIZE, R, -below, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)
    read = read_calibration(opencv(".yml", P1=p1, P2=p2, Q=q, image_size=np.array(SIZE)))
    assert (read.turn, read.focal_px) == (-1, p1[0, 0])
    assert read.baseline_m == pytest.approx(np.linalg.norm(below))
    assert read_calibration(calibration_json(read).encode()) == read


def test_what_was_assumed_and_what_has_no_effect_is_noted():
    def notes(**entries):
        return " ".join(read_calibration(files.npz(**entries)).notes)

    assert notes(**BOTH_CAMERAS, length_unit=np.array("m"), rms=0.2, E=np.eye(3)).startswith("The file does not state")
    assert "metres are assumed" in notes(**BOTH_CAMERAS)
    assert "unknown here: distortoin, colour." in notes(**BOTH_CAMERAS, colour=np.ones(3), distortoin=np.ones(5))
    straight = {name: value for name, value in BOTH_CAMERAS.items() if not name.startswith("D")}
    assert "free of distortion" in notes(**straight)
    assert "add camera_model: fisheye" in notes(**(BOTH_CAMERAS | {"D1": D1[:, :4], "D2": D2[:, :4]}))
    for given, unit in ((files.npz(**BOTH_CAMERAS), False), (files.kalibr(), True), (MIDDLEBURY, True)):
        assert read_calibration(given).unit_stated is unit
    assert read_calibration(files.ros("left"), files.ros("right")).notes == ()


def test_lengths_of_matlab_are_millimetres_unless_another_unit_is_said():
    data = files.OF_MAKERS["Bouguet's toolbox"]()
    assert read_calibration(*data).notes == ("The file does not state its unit of length: millimetres are assumed.",)
    assert read_calibration(*data, length_unit_m=0.01).baseline_m == pytest.approx(10 * BASELINE)
    stated = files.OF_MAKERS["MATLAB, a newer struct, inside another"]()
    assert read_calibration(*stated, length_unit_m=0.01).baseline_m == pytest.approx(BASELINE)


def test_what_a_calibration_means_is_said_and_doubted_beyond_any_stereo_camera():
    camera = Calibration(676.13, 0.12)
    assert "baseline 0.12 m, 64 disparities reach from 1.3 m" in camera.in_words()
    assert camera.plausible and "millimetres" not in camera.in_words()
    in_millimetres = replace(camera, baseline_m=120.0)
    assert not in_millimetres.plausible
    assert "in millimetres, the baseline is 0.12 m" in in_millimetres.in_words()
    assert not Calibration(80_000, 0.5).plausible
    in_metres = replace(camera, baseline_m=0.00012)  # taken for millimetres, as the toolbox of MATLAB counts
    assert not in_metres.plausible and "a thousand times as long, the baseline is 0.12 m" in in_metres.in_words()


def test_rows_of_numbers_state_no_unit_and_a_unit_that_is_given_in_vain_is_noted():
    rows = b"700 0 320 0 700 240 0 0 1\n63\n"  # mm, as nothing says
    assert not read_calibration(rows).unit_stated
    read = read_calibration(rows, length_unit_m=0.001)
    assert read.baseline_m == pytest.approx(0.063) and read.notes == ()
    known = read_calibration(MIDDLEBURY, length_unit_m=1.0)
    assert known.baseline_m == pytest.approx(0.193001) and "in millimetres" in known.notes[0]
    assert read_calibration(MIDDLEBURY, length_unit_m=0.001).notes == ()


def test_middlebury_has_millimetres_and_a_right_centre_by_doffs_or_by_both_cameras():
    assert read_calibration(MIDDLEBURY) == Calibration(
        3979.911, 193.001 / 1000, 124.343, 1244.772, 1019.507, width=2964, height=1988, num_disparities=270
    )
    without = MIDDLEBURY.replace(b"doffs=124.343\n", b"")
    assert read_calibration(without).doffs_px == pytest.approx(1369.115 - 1244.772)
    lone = b"\n".join(line for line in without.splitlines() if not line.startswith(b"cam1"))
    assert "neither doffs nor cam1" in read_calibration(lone).notes[0]


def test_the_colour_cameras_of_kitti_come_before_the_grey_ones():
    row = "{}: 720 0 600 {} 0 720 170 0 0 0 1 0\n"
    text = "".join(row.format(f"P{camera}", x) for camera, x in enumerate((0, -387, 45, -339)))
    text += "R0_rect 1 0 0 0 1 0 0 0 1\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n"
    assert read_calibration(text.encode()).baseline_m == pytest.approx(384 / 720)
    grey = "".join(text.splitlines(keepends=True)[:2])
    assert read_calibration(grey.encode()).baseline_m == pytest.approx(387 / 720)


def test_lengths_without_a_unit_are_in_that_which_is_said():
    millimetres = BOTH_CAMERAS | {"T": T * 1000, "R1": R1, "R2": R2, "P1": P1, "P2": P2 * [[1, 1, 1, 1000]]}
    is_this_camera(read_calibration(files.npz(**millimetres), length_unit_m=0.001))
    is_rectified_as_here(read_calibration(io.BytesIO(files.npz(**millimetres)), length_unit_m=0.001))
    for metres in ([files.kalibr()], [files.ros("left"), files.ros("right")]):
        assert read_calibration(*metres, length_unit_m=0.001).baseline_m == pytest.approx(BASELINE)
    with pytest.raises(ValueError, match="length_unit_m is 0"):
        read_calibration(MIDDLEBURY, length_unit_m=0)


def test_cameras_of_unknown_size_are_rectified_at_the_size_of_the_images():
    calibration = read_calibration(opencv(".yml", M1=M1, D1=D1, M2=M2, D2=D2), opencv(".yml", R=R, T=T, Q=Q))
    assert calibration.rig.width is None
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


def test_aliases_of_yaml_are_followed_a_second_document_is_not_read_and_a_comma_may_be_forgotten():
    matrix = M1.tolist()
    data = yaml.safe_dump({"K1": matrix, "K2": matrix, "R": R.tolist(), "T": T.ravel().tolist()})
    assert "*id" in data
    np.testing.assert_array_equal(read_calibration(data.encode()).rig.right_matrix, M1)
    is_this_camera(read_calibration(opencv(".yml", **BOTH_CAMERAS) + b"...\n---\nM1: 3\n"))
    data = (
        b"projection_matrix:\n  rows: 3\n  cols: 4\n  data: [700, 0, 320, -70\n    0, 700, 240, 0,\n    0, 0, 1, 0]\n"
    )
    assert read_calibration(data).baseline_m == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        ([], "at least one file"),
        ([b""], "empty file"),
        ([b'{"focal_px": 700}'], "has no baseline_m"),
        ([b'{"focal_px": [1, 2], "baseline_m": 1}'], "must hold 1 numbers; it holds 2"),
        ([b"cam0=[1 0 2; 0 1 2]\nbaseline=3"], "“cam0” in the calibration must hold 9 numbers; it holds 6"),
        ([b"P2: 1 2 3\nP3: 1 2 3"], "“P2” in the calibration must hold 12 numbers"),
        ([files.kitti(P_rect_02=0 * P1)], "focal length 0 px"),
        ([files.kitti(P_rect_03=P2 * [[1, 1, 1, -1]])], "baseline_m is -"),
        ([b"%YAML:1.0\n---\nM1: !!opencv-matrix\n  rows: 3\n  data: [1, 2"], "cut short at line 6"),
        ([b"%YAML:1.0\n---\nM1: !!opencv-matrix\n  rows: 3\n  cols: 3\n  data: [1, 2]"], "announces 3 × 3"),
        ([files.npz(P1=M1 @ np.eye(3, 4), P2=M2 @ np.hstack([R, T]))], "“P1” and “P2” are not of a rectified pair"),
        ([files.orb_slam_2().partition(b"LEFT.height")[0].replace(b"k1: 0.0", b"k1: -0.28")],
         r"has a lens with distortion \(Camera.k1\).*cannot be rectified"),
        ([files.basalt("ds", (D1, D2))], "“ds” for “value0.intrinsics.0.came…”"),
        ([opencv(".yml", Q=np.zeros((4, 4)))], "infinite baseline"),
        ([opencv(".yml", M1=M1, D1=D1, M2=M2, D2=D2, R=R, T=-T)], "stands to the right of the first"),
        ([files.npz(M1=M1, D1=D1, M2=M2, D2=D2)], r"has M1, D1, M2, D2, but lacks rotation \(R\), translation \(T\)"),
        ([files.npz(mtxL=M1, distL=D1, R=R, T=T)], r"lacks right camera matrix \(M2\)"),
        ([files.npz(mtx=M1, dist=D1, rms=np.array(0.2))], r"of one camera alone \(mtx, dist, rms\); give the file of"),
        ([files.ros("left")], "left camera alone: “projection_matrix” has no baseline"),
        ([files.ros("left", model="equidistant"), files.ros("right")], "declares a pinhole and a fisheye"),
        ([files.ros(side).replace(b"coefficients", b"coefficents") for side in ("left", "right")],
         r"declares a lens \(pinhole\), but its .* not found.*unknown here: distortion_coefficents"),
        ([files.npz(**{name: value for name, value in BOTH_CAMERAS.items() if name != "D2"}, dist_rihgt=D2)],
         r"lacks the other \(D2\).*unknown here: dist_rihgt"),
        ([files.vins()[0], *[one.replace(b"PINHOLE", b"MEI") for one in files.vins()[1:]]], "“MEI” for “model_type”"),
        ([files.as_json(CameraParameters1={"Intrinsics": {"MappingCoefficients": [1, 2]}})], "“scaramuzza”"),
        ([files.as_json(**BOTH_CAMERAS, unit="feet")], "“feet” as its unit of length; allowed are m, cm and mm"),
        ([files.zed().replace(b"CV_", b"CW_")], "has no STEREO.CV_HD"),
        ([b"1 2 3\n4 5 6\n7 8 9\n"], "9 numbers without names"),
        ([b"0.063\n700 0 320\n0 700 240\n0 0 1\n"], r"the first row” in the calibration is not \[\[f, 0, cx\]"),
        ([b"700 0 0\n0 700 0\n320 240 1\n0.063\n"], r"the first row” in the calibration is not \[\[f, 0, cx\]"),
        (files.vins()[:2], r"\(VINS\) is of 1 camera; give the files of both"),
        ([b"MATLAB 7.3 MAT-file, Platform: GLNXA64"], "save it with -v7"),
        ([files.mat(x=np.eye(3))[:150]], "MAT file that is damaged"),
        ([files.npz(mtx=M1, dist=D1)] * 3, "3 files hold the calibration of one camera each"),
        ([files.npz(stereoMapL_x=np.zeros((480, 640)))], "holds no names with values"),
        ([files.npz(E=np.eye(3), F=np.eye(3))], "holds E, F: it is in no known format, or lacks both cameras"),
        ([files.npz(K1=np.array([None]), K2=M2, R=R, T=T)], "lacks left camera matrix"),
        ([files.kalibr(distortion_model="equidistant")], "declares a pinhole and a fisheye"),
        ([files.kalibr(camera_model="omni")], "“omni” for “cam1.camera_model”.*allowed are pinhole"),
        ([files.as_json(fx=700, fy=700, cx=3)], "has no baseline_m; .* It has fx, fy, cx"),
        ([files.npz(**(BOTH_CAMERAS | {"R1": np.eye(3)[::-1] * [1, -1, 1], "R2": R2, "P1": P1, "P2": P2}))], "R1"),
        ([files.npz(**(BOTH_CAMERAS | {"R1": R1, "R2": R2, "P1": P1, "P2": P2 + np.eye(3, 4) * 9}))], "second row"),
        ([opencv(".xml", M1=M1)[:150]], "XML: it is broken or cut short at line"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_sentence(sources, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_calibration(*sources)
    assert "\n" not in str(caught.value)


def test_cameras_with_their_poses_are_left_and_right_in_any_order_and_names_of_tutorials_are_understood():
    left, right = files.OF_MAKERS["EuRoC"]()
    read = read_calibration(right, left)
    is_this_camera(read)
    assert read.notes == ()
    is_this_camera(read_calibration(files.npz(Kl=M1, Dl=D1, Kr=M2, Dr=D2, Rot=R, Trns=T)))


def test_an_empty_list_of_coefficients_is_a_lens_without_distortion():
    read = read_calibration(*(files.ros(side, distortion=np.zeros((1, 0))) for side in ("left", "right")))
    assert not read.rig.left_distortion.any() and "free of distortion" in read.notes[0]


def test_real_calibrations(data_dir):
    folder = data_dir / "sequences" / "kitti_seq1"
    from_text, from_json = read_calibration(folder / "calib.txt"), read_calibration(folder / "calib.json")
    assert from_text == from_json
    assert from_text.baseline_m == pytest.approx(0.53715, abs=1e-5)
    motorcycle = read_calibration(data_dir / "stereo" / "motorcycle_q" / "calib.json")
    assert (motorcycle.focal_px, motorcycle.baseline_m, motorcycle.doffs_px) == (999.421, 0.193001, 32.778)
    with pytest.raises(ValueError, match="no known format"):
        read_calibration(data_dir / "stereo" / "teddy" / "calib.json")


def calibrated(coefficients: int = 5) -> Calibration:
    distortion = np.zeros(coefficients)
    distortion[:4] = [-0.28, 0.09, 0.0005, -0.0004]
    distortion[-1] = 0.01
    rig = StereoRig(M1, distortion, M2, 0.9 * distortion, R, T, *SIZE)
    return replace(rectified_calibration(rig, SIZE), rig=rig, rms=0.2)


def check_same(read: Calibration, written: Calibration) -> None:
    for name in ("left_matrix", "right_matrix", "left_distortion", "right_distortion", "rotation", "translation"):
        np.testing.assert_allclose(getattr(read.rig, name), getattr(written.rig, name), rtol=1e-9, atol=1e-12)
    assert (read.width, read.height) == SIZE
    assert read.focal_px == pytest.approx(written.focal_px)
    assert read.baseline_m == pytest.approx(written.baseline_m)


@pytest.mark.parametrize("coefficients", [5, 8, 12])
def test_opencv_reads_its_yaml_and_so_do_we(coefficients):
    written = calibrated(coefficients)
    text = opencv_calibration(written)
    check_same(read_calibration(text.encode()), written)
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    names = ("M1", "D1", "M2", "D2", "R", "T", "R1", "R2", "P1", "P2", "Q")
    read = {name: storage.getNode(name).mat() for name in names}
    np.testing.assert_allclose(read["T"].ravel(), written.rig.translation)
    cameras = [read[name] for name in names[:4]]
    expected = cv2.stereoRectify(*cameras, SIZE, read["R"], read["T"], flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)
    for name, matrix in zip(names[6:], expected[:5], strict=True):
        np.testing.assert_allclose(read[name], matrix, atol=1e-6, err_msg=name)


@pytest.mark.parametrize(("coefficients", "model"), [(5, "plumb_bob"), (8, "rational_polynomial")])
def test_the_ros_pair_is_read_back(coefficients, model):
    written = calibrated(coefficients)
    left, right = ros_calibration(written)
    check_same(read_calibration(left.encode(), right.encode()), written)
    assert f"distortion_model: {model}" in left


def test_our_json_is_read_back_in_metres_whatever_unit_is_said_of_other_files():
    written = replace(calibrated(), num_disparities=96)
    read = read_calibration(calibration_json(written).encode(), length_unit_m=0.001)
    check_same(read, written)
    assert read.num_disparities == 96
    plain = Calibration(700.0, 0.12, 3.0, 320.0, 240.0, width=640, height=480, num_disparities=96)
    assert read_calibration(calibration_json(plain).encode()) == plain


def test_what_a_format_cannot_hold_is_refused():
    with pytest.raises(ValueError, match="12 distortion coefficients"):
        ros_calibration(calibrated(12))
    for write in (opencv_calibration, ros_calibration):
        with pytest.raises(ValueError, match="no rig"):
            write(Calibration(700.0, 0.12))
