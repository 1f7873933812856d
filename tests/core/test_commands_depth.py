"""``stereolag depth``: the same figures as the library, the same files as the page."""

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from commanded import Command, assert_refused
from pairs import bundled
from ply_reader import read_ply
from straight_and_raw import DISPARITY, P1, RIG, SIZE, T, raw_pair

import stereolag as sl
from benchmarks import camera_files
from stereolag.core.inputs import Image
from stereolag.figures.legends import cloud_ply, coloured_png
from stereolag.figures.pictures import VIRIDIS
from stereolag.io.arrays import npy
from stereolag.io.calibrations import calibration_json
from stereolag.io.depths import depth_png, depth_tiff
from stereolag.io.disparities import kitti_png, pfm
from stereolag.io.images import image_png
from stereolag.io.results import figures_of
from stereolag.io.settings import settings_json

Change = Callable[[Image, Image], tuple[Image, Image]]

SHIFT = 7
MAP_FILES = ["disparity.npy", "disparity.pfm", "disparity_coloured.png", "disparity_kitti.png", "settings.json"]


PAIR = "left.png", "right.png"
TRUSTED = ("depth", *PAIR, "--trust")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a pair of one known disparity, its ground truth and its calibration."""
    folder = tmp_path_factory.mktemp("pair")
    noise = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 255, (60, 127, 3), dtype=np.uint8), (3, 3), 0)
    written(folder, noise[:, :-SHIFT], noise[:, SHIFT:])
    sl.write_disparity(folder / "truth.pfm", np.full((60, 120), SHIFT, np.float32))
    (folder / "calibration.json").write_text(json.dumps({"focal_px": 100.0, "baseline_m": 0.2}))
    (folder / "phone.heic").write_bytes(b"\0\0\0\x18ftypheic" + bytes(99))
    (folder / "other.json").write_text(json.dumps({"focal_px": 1.0, "baseline_m": 1.0, "width": 50, "height": 50}))
    return folder


@pytest.fixture(autouse=True)
def _in_the_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)


def written(folder: Path, left: Image, right: Image) -> tuple[Path, Path]:
    """Write a pair of pictures to a folder and return their paths."""
    pair = folder / "left.png", folder / "right.png"
    for path, image in zip(pair, (left, right), strict=True):
        path.write_bytes(image_png(np.ascontiguousarray(image)))
    return pair


def test_the_figures_are_those_of_the_library(ran: Command) -> None:
    command = (*TRUSTED, "--preset", "fast", "--num-disparities", 16, "--truth", "truth.pfm")
    told = ran(*command, "--json")
    assert (told.code, told.err) == (0, "")
    result = sl.preset("fast", num_disparities=16).compute(*map(sl.read_image, PAIR))
    judged = figures_of(sl.evaluate(result.disparity, sl.read_disparity("truth.pfm")))
    figures = told.figures
    assert figures["coverage"] == result.coverage == float((result.valid & ~result.filled).mean())
    assert figures["filled"] == float(result.filled.mean())
    assert figures["findings"] == []
    assert (figures["width"], figures["height"], figures["range_px"]) == (120, 60, [0, 16])
    assert figures["bad_2_percent"] == judged["bad_2_percent"] < 10
    assert figures["epe_px"] == judged["epe_px"]
    assert 0 < figures["elapsed_s"] < 60
    in_words = ran(*command).out
    assert f"bad-2 {judged['bad_2_percent']:.2f} %" in in_words
    assert "0 to 15 px searched" in in_words


@pytest.mark.parametrize("preset", ["accurate", "report"])
def test_the_files_are_those_of_the_page(preset: str, tmp_path: Path, ran: Command) -> None:
    out = tmp_path / "new" / "folder"
    given = ("--preset", preset, "--calibration", "calibration.json", "--out", out, "--json")
    told = ran(*TRUSTED, *given).figures
    left, right = map(sl.read_image, PAIR)
    result = sl.preset(preset).compute(left, right)
    disparity, palette = result.disparity, VIRIDIS[::-1] if preset == "report" else VIRIDIS
    low, high = (-9, 11) if preset == "report" else (0, 64)
    known = sl.read_calibration("calibration.json")
    expected = {
        "disparity.pfm": pfm(disparity),
        "disparity.npy": npy(disparity),
        "disparity_kitti.png": kitti_png(disparity),
        "disparity_coloured.png": coloured_png(disparity, low, high, palette),
        "settings.json": settings_json(result.settings).encode(),
        "cloud.ply": cloud_ply(known, disparity, left),
        "depth.tif": depth_tiff(known.depth(disparity)),
        "depth_mm.png": depth_png(known.depth(disparity)),
        "calibration.json": calibration_json(known).encode(),
    }
    assert {path.name: path.read_bytes() for path in out.iterdir()} == expected
    assert sorted(told["files"]) == sorted(expected)
    assert np.median(read_ply(expected["cloud.ply"])["z"]) == pytest.approx(100 * 0.2 / SHIFT, rel=0.02)


def test_a_format_that_cannot_hold_the_map_is_left_out_and_said(tmp_path: Path, ran: Command) -> None:
    told = ran("depth", *PAIR[::-1], "--trust", "--min-disparity", -16, "--out", tmp_path)
    assert told.code == 0
    assert "disparity_kitti.png is left out: disparity reaches from -" in told.out
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted({*MAP_FILES} - {"disparity_kitti.png"})


def test_without_a_folder_nothing_is_written(folder: Path, ran: Command) -> None:
    before = sorted(folder.iterdir())
    assert ran(*TRUSTED).code == 0
    assert sorted(folder.iterdir()) == before


def test_the_range_of_the_calibration_is_searched_unless_another_is_given(tmp_path: Path, ran: Command) -> None:
    calibration = tmp_path / "calibration.json"
    calibration.write_text(json.dumps({"focal_px": 100.0, "baseline_m": 0.2, "num_disparities": 27}))
    for given, count in (
        ((), 27),
        (("--method", "bm"), 32),
        (("--num-disparities", 40), 40),
        (("--num-disparities", 64), 64),  # the initial number
    ):
        figures = ran("depth", *PAIR, "--calibration", calibration, *given, "--json").figures
        assert figures["range_px"] == [0, count]


def test_a_raw_pair_is_rectified_and_a_straight_one_is_not(rig: Path, tmp_path: Path, ran: Command) -> None:
    raw, straight = ([rig / kind / side / "0.png" for side in ("left", "right")] for kind in ("raw", "straight"))
    arguments = ("--trust", "--method", "bm", "--num-disparities", 32, "--calibration", rig / "rig.json", "--json")
    judged = (*straight, *arguments, "--truth", rig / "truth/0.png")
    figures = ran("depth", *judged, "--out", tmp_path).figures
    assert figures["rectified_here"] is False and "bad_2_percent" in figures
    assert "as you said) and the ground truth belongs to them before" in ran("depth", *judged, "--rectify", "yes").err
    assert not (tmp_path / "left.png").exists()
    depth = tmp_path / "metres.tif"
    assert ran("depth", *raw, *arguments, "--out", tmp_path, "--depth", depth).figures["rectified_here"] is True
    made = sl.rectify(*raw_pair(), sl.read_calibration(rig / "rig.json"))
    np.testing.assert_array_equal(sl.read_image(tmp_path / "left.png"), made.left)
    np.testing.assert_array_equal(sl.read_image(tmp_path / "right.png"), made.right)
    assert sl.read_calibration(tmp_path / "calibration.json") == made.calibration
    known = sl.read_disparity(tmp_path / "disparity.npy")
    assert np.nanmedian(np.abs(known - 14)) < 0.5
    np.testing.assert_array_equal(sl.read_depth(depth), made.calibration.depth(known))
    assert depth.read_bytes() == (tmp_path / "depth.tif").read_bytes()


@pytest.mark.parametrize(("focal_px", "beyond"), [(100.0, False), (1e4, True)])
def test_depth_in_millimetres_tells_what_is_beyond(focal_px: float, beyond: bool, tmp_path: Path, ran: Command) -> None:
    calibration, depth = tmp_path / "calibration.json", tmp_path / "depth.png"
    calibration.write_text(calibration_json(sl.Calibration(focal_px, 0.2)))
    command = (*TRUSTED, "--method", "bm", "--calibration", calibration, "--depth", depth)
    figures = ran(*command, "--json").figures
    assert sorted(tmp_path.iterdir()) == [calibration, depth]
    stored = cv2.imread(str(depth), cv2.IMREAD_UNCHANGED)
    if beyond:
        assert not stored.any()
    else:
        assert np.median(stored[stored > 0]) == pytest.approx(1000 * focal_px * 0.2 / SHIFT, rel=0.02)
    assert figures["depth"] == str(depth)
    assert (stored > 0).sum() + figures["too_far_for_png"] == round(figures["depth_coverage"] * stored.size)
    said = f"{figures['too_far_for_png']:,} pixels are beyond 65.535 m: 0 in a PNG of depth"
    assert (figures["too_far_for_png"] > 1000) == beyond == (said in ran(*command).out)


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        ("no.png right.png", 4, "no.png: No such file or directory."),
        ("left.png", 4, "left.png: The image holds one view"),
        ("left.png right.png third.png", 2, "'third.png' is one argument too many."),
        (". right.png", 4, ".: Is a directory."),
        ("other.json right.png", 4, "other.json: This is not an image that can be read"),
        ("phone.heic right.png", 4, "phone.heic: The image (HEIC) is damaged or cut short and cannot be decoded"),
        ("left.png right.png --truth left.png", 4, "left.png: The disparity map has shape (60, 120, 3)"),
        ("left.png right.png --calibration left.png", 4, "left.png: The calibration"),
        ("left.png right.png --calibration other.json", 4, "The calibration is for 50 × 50 pixels"),
        ("left.png right.png --rectify yes --calibration calibration.json", 4, "holds no cameras"),
        ("left.png right.png --settings truth.pfm", 4, "truth.pfm: The settings file is not JSON"),
        ("left.png right.png --preset best", 2, "choose from 'report', 'fast', 'accurate'"),
        ("left.png right.png --preset fast --method bm", 2, "not allowed with argument"),
        ("left.png right.png --preset fast --search.kind round", 2, "--search.kind is 'round'; allowed are 'centred',"),
        ("left.png right.png --block-size 9", 2, "There is one with --method bm or sgbm."),
        ("left.png right.png --method bm --block-size 61", 4, "block_size is 61 px and the images"),
        ("left.png right.png --out truth.pfm", 4, "truth.pfm: File exists."),
        ("left.png right.png --depth depth.tif", 4, "Depth in metres needs a calibration: give --calib"),
        ("left.png right.png --depth depth.pfm", 2, "its name ends in .tif, .tiff or .png."),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(arguments: str, code: int, said: str, ran: Command) -> None:
    assert_refused(ran("depth", *arguments.split()), "depth", code, said)


def test_a_wall_before_cameras_one_above_the_other_is_as_far_as_it_is(tmp_path: Path, ran: Command) -> None:
    upper = RIG.turned(1, SIZE)
    matrices = {"M1": upper.left_matrix, "M2": upper.right_matrix, "R": upper.rotation, "T": 1000 * upper.translation}
    lenses = {"D1": upper.left_distortion, "D2": upper.right_distortion, "image_size": np.array(SIZE[::-1])}
    (tmp_path / "camera").write_bytes(camera_files.npz(**matrices, **lenses))
    pair = written(tmp_path, *(np.rot90(image) for image in raw_pair()))
    arguments = ("--calibration", tmp_path / "camera", "--unit", "mm", "--num-disparities", 32, "--out", tmp_path)
    told = ran("depth", *pair, "--trust", *arguments)
    assert told.code == 0, told.err
    assert "baseline 0.12 m" in told.out
    distance = pytest.approx(P1[0, 0] * np.linalg.norm(T) / DISPARITY, rel=0.01)
    points = read_ply((tmp_path / "cloud.ply").read_bytes())
    assert np.median(points["z"]) == distance
    assert abs(np.median(points["x"])) < 0.2 and abs(np.median(points["y"])) < 0.2
    disparity = sl.read_disparity(tmp_path / "disparity.npy")
    assert disparity.shape == SIZE
    assert np.nanmedian(sl.read_calibration(tmp_path / "calibration.json").depth(disparity)) == distance


CUBE = bundled("cube", 0.5)[:2]


@pytest.mark.parametrize(("unit", "code"), [((), 3), (("--unit", "mm"), 0)])
def test_metres_of_no_stereo_camera_in_a_unit_that_nothing_states_are_doubted(unit, code, tmp_path, ran):
    left = np.array([[450.0, 0, 159.5, 0], [0, 450, 119.5, 0], [0, 0, 1, 0]])
    shift = np.zeros((3, 4))
    shift[0, 3] = -450 * 17.0  # mm
    (tmp_path / "camera").write_bytes(camera_files.npz(P1=left, P2=left + shift))
    told = ran("depth", *written(tmp_path, *CUBE), "--calibration", tmp_path / "camera", *unit)
    assert told.code == code, told.err
    assert ("metres are assumed" in told.out) == ("No stereo camera is like that" in told.out) == (code == 3)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda left, right: (left, right), None),
        (lambda left, right: (right, left), "swapped"),
        (lambda left, right: (left, np.pad(right[:-40], ((0, 40), (0, 0), (0, 0)))), "empty_border"),
    ],
)
def test_an_ill_pair_is_told_and_the_range_is_that_of_the_pair(change, code, tmp_path, ran):
    command = ("depth", *written(tmp_path, *change(*CUBE)), "--method", "bm")
    told = ran(*command, "--out", tmp_path / "out", "--json")
    codes = [finding["code"] for finding in told.figures["findings"]]
    assert (told.code, codes) == ((0, []) if code is None else (3, [code]))
    assert (tmp_path / "out" / "disparity.pfm").exists()
    if code is None:
        assert tuple(told.figures["range_px"]) == sl.diagnose(*CUBE).suggested_range
    if code == "swapped":
        sentence = told.figures["findings"][0]["sentence"]
        assert f"doubtful: {sentence}" in ran(*command).out.splitlines()
    trusted = ran(*command, "--trust", "--json")
    assert (trusted.code, trusted.figures["findings"], trusted.figures["range_px"]) == (0, [], [0, 64])
