"""Maps as files: read as their makers intended, written for this library, OpenCV, Pillow and PLY readers."""

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image
from ply_reader import read_ply

import stereolag as sl
from stereolag import read_disparity, read_image, write_disparity
from stereolag.io.arrays import npy
from stereolag.io.depths import ply, too_far
from stereolag.io.disparities import (
    DISPARITY_FORMATS,
    FORMATS,
    check_kitti,
    confidence_png,
    kitti_png,
    pfm,
)
from stereolag.io.images import image_png, image_tiff

DISPARITY = np.array([[1.5, np.nan, 30.25], [255.99, 1 / 1024, 0.0]], dtype=np.float32)
QUANTUM = 1 / 256
NAN = st.just(float("nan"))

shapes = st.tuples(st.integers(1, 12), st.integers(1, 12))


def opencv(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def png(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def pfm_of(disparity: np.ndarray, scale: str = "-1.0") -> bytes:
    rows, cols = disparity.shape
    body = disparity[::-1].astype("<f4" if scale.startswith("-") else ">f4")
    return f"Pf\n{cols} {rows}\n{scale}\n".encode() + body.tobytes()


def flo(motion: np.ndarray) -> bytes:
    return b"PIEH" + np.array(motion.shape[1::-1], "<i4").tobytes() + motion.astype("<f4").tobytes()


def exr(channels: list[bytes], values: np.ndarray, dtype: str) -> bytes:
    """Return an OpenEXR file without compression, all of whose channels hold the same values."""
    rows, cols = values.shape
    window, kind = struct.pack("<4i", 0, 0, cols - 1, rows - 1), struct.pack("<4i", 1 + (dtype == "<f4"), 0, 1, 1)
    entries = [
        (b"channels\0chlist", b"".join(name + b"\0" + kind for name in channels) + b"\0"),
        (b"compression\0compression", b"\0"),
        (b"dataWindow\0box2i", window),
        (b"displayWindow\0box2i", window),
        (b"lineOrder\0lineOrder", b"\0"),
        (b"pixelAspectRatio\0float", struct.pack("<f", 1)),
        (b"screenWindowCenter\0v2f", bytes(8)),
        (b"screenWindowWidth\0float", struct.pack("<f", 1)),
    ]
    header = b"".join(name + b"\0" + struct.pack("<i", len(value)) + value for name, value in entries)
    head = b"v/1\x01\2\0\0\0" + header + b"\0"
    lines = [len(channels) * line.astype(dtype).tobytes() for line in values]
    size = 8 + len(lines[0])
    table = b"".join(struct.pack("<Q", len(head) + 8 * rows + row * size) for row in range(rows))
    return head + table + b"".join(struct.pack("<2i", row, size - 8) + line for row, line in enumerate(lines))


@pytest.mark.parametrize("channels", [[b"Y"], [b"B", b"G", b"R"]])
@pytest.mark.parametrize("dtype", ["<f4", "<f2"])
def test_a_map_in_an_exr_is_read_and_one_under_another_name_refused(channels: list[bytes], dtype: str) -> None:
    values = np.random.default_rng(3).uniform(1, 60, (5, 9)).astype(dtype)
    np.testing.assert_array_equal(read_disparity(exr(channels, values, dtype)), values.astype(np.float32))
    with pytest.raises(ValueError, match="OpenEXR file without a channel Y or channels RGB"):
        read_disparity(exr([b"V"], values, dtype))


@pytest.mark.parametrize("suffix", [*DISPARITY_FORMATS, ".PNG"])
@given(disparity=hnp.arrays(np.float32, shapes, elements=NAN | st.floats(QUANTUM, 255.75, width=32)))
def test_a_map_comes_back(tmp_path_factory: pytest.TempPathFactory, suffix: str, disparity: np.ndarray) -> None:
    disparity = np.pad(disparity, 1, constant_values=np.nan)
    disparity[0, 0] = 5.0
    path = tmp_path_factory.getbasetemp() / f"disparity{suffix}"
    write_disparity(path, disparity)
    back = read_disparity(path)
    assert back.dtype == np.float32
    np.testing.assert_allclose(back, disparity, atol=QUANTUM / 2 if suffix.lower() == ".png" else 0, rtol=0)


@pytest.mark.parametrize("suffix", DISPARITY_FORMATS)
@pytest.mark.parametrize("shape", [(3,), (2, 2, 3), (0, 4)])
def test_anything_but_a_map_is_refused(tmp_path: Path, suffix: str, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"disparity has shape .*allowed is \(rows, cols\)"):
        write_disparity(tmp_path / f"map{suffix}", np.ones(shape))


@pytest.mark.parametrize(
    ("write", "suffixes", "says"),
    [
        (write_disparity, [".tiff", "", ".npz"], r"a disparity map is written as \.pfm, \.npy, \.png"),
        (sl.write_depth, [".pfm", "", ".jpg"], r"a depth map is written as \.tif, \.tiff, \.png"),
    ],
)
def test_another_suffix_is_refused(write: Callable[..., None], suffixes: list[str], says: str, tmp_path: Path) -> None:
    for suffix in suffixes:
        with pytest.raises(ValueError, match=rf"path ends in '{suffix}'; {says}"):
            write(tmp_path / f"map{suffix}", np.ones((2, 2)))
    assert not list(tmp_path.iterdir())


def test_the_documentation_names_every_format() -> None:
    pages = (Path(__file__).parents[2] / "docs" / "pages.md").read_text(encoding="utf-8")
    row = next(line for line in pages.splitlines() if line.startswith("| ground truth |"))
    assert all(suffix.upper() in row for one in FORMATS for suffix in one.suffixes)


def test_a_failure_leaves_the_file_that_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "map.pfm"
    write_disparity(path, np.full((2, 2), 7.0))
    with pytest.raises(FileNotFoundError, match=r"nowhere.*map"):
        write_disparity(tmp_path / "nowhere" / "map.npy", np.ones((2, 2)))
    with pytest.raises(ValueError, match=r"from -40.25 to 300.50 px; KITTI's PNG holds 0 to 255.99"):
        write_disparity(tmp_path / "wide.png", [[-40.25, 300.5]])

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_disparity(path, np.full((2, 2), 9.0))
    assert (read_disparity(path) == 7).all()
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.parametrize("first", [-9, 1, 2, 9])
def test_what_opencv_writes_below_its_search_is_unknown_wherever_that_begins(first):
    wide = np.random.default_rng(first + 99).integers(0, 256, (60, 120), np.uint8)
    wide = cv2.resize(cv2.GaussianBlur(wide, (0, 0), 1), (240, 120), interpolation=cv2.INTER_CUBIC)
    shift = first + 8 + 5 * np.sin(np.arange(120) / 20).astype(np.float32)
    rows, cols = np.mgrid[:120, 60:180].astype(np.float32)
    views = [cv2.remap(wide, cols + places, rows, cv2.INTER_LINEAR) for places in (np.zeros(120, np.float32), shift)]
    stored = cv2.StereoSGBM.create(first, 16, 5, uniquenessRatio=10).compute(*views)
    expected = np.where(stored > 16 * (first - 1), stored / np.float32(16), np.float32(np.nan))
    assert np.isfinite(expected).mean() > 0.5
    files = [npy(stored), npy(stored / np.float32(16))] + [png(stored.view(np.uint16))] * (first < 1)
    for data in files:
        np.testing.assert_array_equal(read_disparity(data), expected)


@pytest.mark.parametrize(
    ("data", "divisor", "expected"),
    [
        (b"P5 2 1 15\n\x05\x0f", 1, [[5, 15]]),  # not stretched to 255
        (b"P5\n# made by hand\n2 1\n255\n\0\7", 4, [[np.nan, 1.75]]),
        (png(np.array([[0, 7]], np.uint8)), 4, [[np.nan, 1.75]]),
        (png(np.array([[0, 640]], np.uint16)), None, [[np.nan, 2.5]]),
        (
            pfm_of(np.array([[7, 0.25], [3, 1]]), "0.003922"),
            None,
            [[7, 0.25], [3, 1]],
        ),
        (npy(np.array([[5, 5, 7.5]])), None, [[5, 5, 7.5]]),  # no background of whole pixels is unknown
        (npy(np.array([[80, 80, 120]], np.int16)), None, [[5, 5, 7.5]]),
        (b"P5 2 1 4095\n" + np.array([512, 4095], ">u2").tobytes(), None, [[2, 4095 / 256]]),
        (png(np.array([[65520, 96, 97]], np.uint16)), None, [[np.nan, 6, 97 / 16]]),  # OpenCV's, with unknown pixels
        (png(np.array([[65520, 40000]], np.uint16)), None, [[65520 / 256, 40000 / 256]]),
        (npy(np.array([[0, 7]])), None, [[0, 7]]),  # 0 is a disparity here
        (npy(np.array([[0, 0, 0.5, 3]])), None, [[0, 0, 0.5, 3]]),
        (pfm_of(np.array([[0, 0, 2.5, 3]])), None, [[np.nan, np.nan, 2.5, 3]]),
        (npy(np.array([[0, 0, 40, 48]], np.int16)), None, [[np.nan, np.nan, 2.5, 3]]),
        (npy(np.array([[9999.0, 9999, 2, 3]])), None, [[np.nan, np.nan, 2, 3]]),
        (npy(np.array([[0, 0, -2.5, -3]])), -1, [[np.nan, np.nan, 2.5, 3]]),
        (png(np.full((1, 2, 3), 8, np.uint8)), 4, [[2, 2]]),  # grey, saved in colours
        (pfm_of(np.array([[7, 1e10, 1e20, np.finfo(np.float32).max]])), None, [[7, *[np.nan] * 3]]),
        (npy(np.array([[6.0, 8.0]])), 4, [[1.5, 2.0]]),
        (npy(np.array([[1e300, 7]])), None, [[np.nan, 7]]),
        (npy(np.array([[24, 8]], np.uint8)), 4, [[6, 2]]),
        (npy(np.array([[3.5, np.nan, -1, -1]], np.float16)), None, [[3.5, np.nan, np.nan, np.nan]]),
        (npy(np.array([[[[3.5, 1], [7, 2]]]])), None, [[3.5, 1], [7, 2]]),  # (1, 1, rows, cols), as networks save it
        (b"Pf\n2 1\n-1\n\x00\x00\xa0\x7f" + np.float32(3).tobytes(), None, [[np.nan, 3]]),  # a signalling NaN
        (b"Pf\r\n1 1\r\n-1\r\n" + np.float32(3).tobytes(), None, [[3]]),
        (pfm(np.array([[3, 7]], np.uint8)), None, [[3, 7]]),
        (b"PF\n2 1\n-1\n" + np.repeat([3, 7], 3).astype("<f4").tobytes(), None, [[3, 7]]),
        (png(np.repeat(np.array([[[24], [8]]], np.uint8), 3, axis=2)), 4, [[6, 2]]),
        (png(np.full((100, 3), [65535, 0, 512], np.uint16)), None, np.full((100, 3), [np.nan, np.nan, 2])),
        (flo(np.array([[[-3.5, 0.1], [1e10, 1e10]]])), None, [[3.5, np.nan]]),
        (npy(np.repeat([[0, 7.5]], 100, axis=0)), None, np.repeat([[np.nan, 7.5]], 100, axis=0)),
        (npy(np.repeat([[0, 0.5]], 100, axis=0)), None, np.repeat([[0, 0.5]], 100, axis=0)),  # near others
    ],
)
def test_special_files(data, divisor, expected):
    np.testing.assert_array_equal(read_disparity(data, divisor=divisor), expected)


@pytest.mark.parametrize(
    ("data", "options", "message"),
    [
        (b"", {}, "empty file"),
        (
            b"words",
            {},
            r"accepted are PFM, EXR or FLO, PNG, PGM or TIFF of 16 bits .*, and NPY, NPZ or MAT\. This is not an image",
        ),
        (png(np.full((2, 2), 9, np.uint8)), {}, "8 bits per pixel: its divisor must be given"),
        (b"P5 1 1 255\n\x07", {}, "8 bits per pixel: its divisor must be given"),
        (npy(np.full((2, 2), 9, np.uint8)), {}, "8 bits per pixel: its divisor must be given"),
        (b"\x89HDF\r\n\x1a\n", {}, r"HDF5 file, as those of Spring \(.dsp5\)"),
        (b"MATLAB 7.3 MAT-file", {}, "version 7.3, which is not read: save it by"),
        (png(np.arange(12, dtype=np.uint16).reshape(2, 2, 3)), {}, r"shape \(2, 2, 3\); allowed is one channel"),
        (png(np.zeros((2, 2), np.uint16)), {}, "no disparity at all"),
        (png(np.ones((2, 2), np.uint16)), {"divisor": 0}, "divisor is 0"),
        (pfm_of(np.ones((3, 3)))[:-1], {}, "cut short: 3 × 3 pixels need 36 bytes, it has 35"),
        (pfm_of(np.ones((3, 3)), "1e"), {}, "scale 1e"),
        (b"PF\n1 1\n-1\n" + bytes(11), {}, "cut short"),
        (b"v/1\x01" + bytes(90), {}, "OpenEXR file without a channel Y"),
        (flo(np.full((2, 3, 2), 2)), {}, "holds motion down or up"),
        (flo(np.ones((2, 3, 2)))[:-1], {}, "cut short"),
        (b"Pf\n0 5\n-1\n", {}, "0 × 5 pixels: it holds none"),
        (b"Pf\n30000 30000\n-1\n", {}, "30000 × 30000 pixels.*at most 50 megapixels"),
        (b"P5\n2 2\n255\n\x01", {}, "cut short: 2 × 2 pixels need 4 bytes, it has 1"),
        (b"P5\n2 2\n70000\n", {}, "70000 for its largest value; allowed are 1 to 65535"),
        (b"P5 1 1 7\n\x09", {}, "holds 9, above the 7"),
        (b"P2 1 1 7\n1", {}, "8 bits per pixel"),
        (npy(np.ones(4)), {}, r"shape \(4,\)"),
    ],
)
def test_bad_files_are_one_clear_sentence(data, options, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_disparity(data, **options)
    assert "\n" not in str(caught.value)


def saved_by(save: Callable[..., None], *args: object, **arrays: object) -> bytes:
    stream = io.BytesIO()
    save(stream, *args, **arrays)
    return stream.getvalue()


def test_the_map_among_the_arrays_of_an_npz_or_mat_is_read_and_of_two_alike_none() -> None:
    disparity, rate = np.random.default_rng(0).uniform(1, 60, (9, 11)), np.array(60.0)
    for data in (
        saved_by(np.savez, disparity),
        saved_by(np.savez_compressed, left=disparity + 1, right=disparity + 2, disp=disparity[None], fps=rate),
        saved_by(scipy.io.savemat, {"GT": disparity, "focal": 700.0, "name": "scene"}),
        saved_by(np.savez, disp_left=disparity, disp_right=disparity + 1),
    ):
        np.testing.assert_array_equal(read_disparity(data), disparity.astype(np.float32))
    with pytest.raises(ValueError, match=r"not the only one in its file, which holds “left” \(9, 11\), “right”"):
        read_disparity(saved_by(np.savez, left=disparity, right=disparity))


def test_disparities_that_are_all_behind_infinity_are_said_and_can_be_turned():
    data = pfm_of(np.array([[-3.0, -4.5]]))
    with pytest.warns(UserWarning, match="divisor=-1 gives the other sign"):
        read_disparity(data)
    np.testing.assert_array_equal(read_disparity(data, divisor=-1), [[3, 4.5]])


def test_every_real_ground_truth(data_dir):
    truths = sorted((data_dir / "stereo").glob("*/gt.*"))
    assert len(truths) == 10
    for path in truths:
        notes = json.loads((path.parent / "calib.json").read_text())
        disparity = read_disparity(path, divisor=notes["disparity_divisor"])
        assert 4 < np.nanmin(disparity) < np.nanmax(disparity) < notes["max_disparity"]
        assert 0.1 < np.isfinite(disparity).mean() < 1


def test_opencv_and_pillow_read_the_pfm_as_it_is_and_no_answer_as_infinite_as_middlebury_has_it():
    disparity = np.random.default_rng(0).uniform(-40, 300, (40, 50)).astype(np.float32)
    disparity[3, 4:6] = np.nan, -np.inf
    data = pfm(disparity)
    expected = np.where(np.isfinite(disparity), disparity, np.inf)
    np.testing.assert_array_equal(opencv(data), expected)
    np.testing.assert_array_equal(np.array(Image.open(io.BytesIO(data))), expected)


def test_kitti_png_is_the_disparity_times_256_for_everyone():
    expected = np.array([[384, 0, 7744], [65533, 1, 1]], dtype=np.uint16)
    data = kitti_png(DISPARITY)
    for pixels in (opencv(data), np.array(Image.open(io.BytesIO(data))), read_image(data)):
        assert pixels.dtype == np.uint16
        np.testing.assert_array_equal(pixels, expected)
    assert not opencv(kitti_png(np.full((2, 3), np.nan))).any()
    # The sub-pixel fit may end half a pixel behind infinity.
    assert opencv(kitti_png(np.array([[-0.5, np.nextafter(-0.5, -1), 3]]))).tolist() == [[1, 1, 768]]


@pytest.mark.parametrize("value", [-0.51, -3.0, 256.0, 255.9985, 1e6])
def test_what_kitti_png_cannot_hold_is_told_before_it_is_written(value):
    for act in (check_kitti, kitti_png):
        with pytest.raises(ValueError, match=f"{min(value, 9.0):.2f} to {max(value, 9.0):.2f} px; KITTI's PNG holds"):
            act([[9.0, value]])
    check_kitti(DISPARITY)
    check_kitti(np.full((2, 2), np.nan))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(5, 4), (5, 4, 3), (5, 4, 4)])
def test_pictures_come_back_without_loss(dtype, shape):
    image = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    back = read_image(image_png(image))
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, image)
    opencv_order = image if len(shape) == 2 else image[:, :, [2, 1, 0, 3][: shape[2]]]
    np.testing.assert_array_equal(opencv(image_png(image)), opencv_order)


def test_floats_come_back_from_a_tiff_and_masks_and_confidence_are_of_8_and_16_bits():
    image = np.random.default_rng(0).normal(0, 1e3, (7, 9)).astype(np.float32)
    np.testing.assert_array_equal(read_image(image_tiff(image)), image)
    for bad in (image.astype(np.uint8), np.stack([image] * 3, axis=-1)):
        with pytest.raises(ValueError, match="allowed is"):
            image_tiff(bad)
    with pytest.raises(ValueError, match="float32"):
        image_png(image)
    np.testing.assert_array_equal(opencv(image_png([[True, False]])), [[255, 0]])
    sure = opencv(confidence_png([[np.nan, 0, 0.5, 1]]))
    assert sure.dtype == np.uint16
    np.testing.assert_array_equal(sure, [[0, 1, 32768, 65535]])


@given(
    hnp.arrays(np.float32, st.tuples(st.integers(0, 20), st.just(3)), elements=st.floats(-1e6, 1e6, width=32)),
    st.integers(0, 255),
)
def test_ply_holds_the_points_and_their_colours(points, shade):
    colours = np.arange(points.size, dtype=np.uint8).reshape(points.shape) + np.uint8(shade)
    vertices = read_ply(ply(points, colours))
    assert list(vertices) == ["x", "y", "z", "red", "green", "blue"]
    np.testing.assert_array_equal(np.array([vertices[axis] for axis in "xyz"], dtype=np.float32).T, points)
    np.testing.assert_array_equal(np.array([vertices[name] for name in ("red", "green", "blue")]).T, colours)


@pytest.mark.parametrize(
    ("points", "colours", "message"),
    [
        (np.zeros((4, 3)), np.zeros((3, 3), np.uint8), "shape"),
        (np.zeros((4, 2)), np.zeros((4, 2), np.uint8), "shape"),
        (np.zeros((4, 3)), np.zeros((4, 3)), "float64"),
        ([[0, 0, np.nan], [0, 0, 1]], np.zeros((2, 3), np.uint8), "1 points that are NaN"),
    ],
)
def test_ply_refuses_what_is_no_cloud(points, colours, message):
    with pytest.raises(ValueError, match=message):
        ply(points, colours)


# Depth maps: metres as floats, millimetres as ROS has them, and what either cannot say.

CAMERA = sl.Calibration(focal_px=700.0, baseline_m=0.12, doffs_px=-2.0)
GIVEN_PX = np.array([[30.0, np.nan, 2.0], [1.0, 3.25, 3.0]], np.float32)
"""Px: near, none, at infinity, beyond it, at 67.2 m and at 84 m."""

METRES = np.array([[700 * 0.12 / 28, np.nan, np.nan], [np.nan, 700 * 0.12 / 1.25, 700 * 0.12 / 1]], np.float32)


@pytest.mark.parametrize("suffix", [".tif", ".TIFF"])
def test_a_tiff_holds_metres_and_nan_where_there_is_no_depth(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"depth{suffix}"
    sl.write_depth(path, CAMERA.depth(GIVEN_PX))
    np.testing.assert_array_equal(sl.read_depth(path), METRES)
    theirs = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert theirs.dtype == np.float32
    np.testing.assert_array_equal(theirs, METRES)


def test_a_png_holds_whole_millimetres_and_0_where_there_is_no_depth_or_it_is_beyond(tmp_path: Path) -> None:
    path = tmp_path / "depth.png"
    sl.write_depth(path, CAMERA.depth(GIVEN_PX))
    theirs = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert theirs.dtype == np.uint16
    np.testing.assert_array_equal(theirs, [[3000, 0, 0], [0, 0, 0]])
    assert too_far(CAMERA.depth(GIVEN_PX)) == 2
    edge = np.array([[0.0001, 0.0014, 65.5349, 65.5352, 65.536, -1.0, np.inf]])
    sl.write_depth(path, edge)
    np.testing.assert_array_equal(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), [[1, 1, 65535, 65535, 0, 0, 0]])
    none = np.nan
    np.testing.assert_allclose(sl.read_depth(path), [[0.001, 0.001, 65.535, 65.535, none, none, none]], rtol=1e-6)
    assert too_far(edge) == 1


@pytest.mark.parametrize("stored", [np.zeros((4, 5), np.uint8), np.zeros((4, 5, 3), np.uint16)])
def test_what_is_no_depth_map_is_refused(stored: np.ndarray) -> None:
    with pytest.raises(ValueError, match="The depth map has shape"):
        sl.read_depth(image_png(stored))
    with pytest.raises(ValueError, match="depth has shape"):
        sl.write_depth("never.tif", np.zeros((2, 2, 2)))
