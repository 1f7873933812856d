"""The figures of each frame: flicker, nearest obstacle and errors, and their table."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from pairs import texture

from stereolag import Calibration, StereoSGBM
from stereolag.core.arrays import FloatMap
from stereolag.geometry.scene import ground_of, nearest_obstacle
from stereolag.io.disparities import kitti_png, pfm
from stereolag.sequences.frames import (
    COLUMNS,
    FrameMap,
    FrameRecord,
    as_stored,
    figures_of,
    read_back,
    read_records,
    table_lines,
)
from stereolag.sequences.motion import flicker, still_pixels

CALIBRATION = Calibration(focal_px=700.0, baseline_m=0.5)


def road(rows: int = 200, cols: int = 300, *, horizon: float = 80.0, slope: float = 0.35) -> FloatMap:
    """Return the disparity of level ground and a far wall above the horizon, with noise and holes."""
    random = np.random.default_rng(0)
    ground = np.maximum(slope * (np.arange(rows) - horizon), 0.5)
    disparity = np.repeat(ground[:, None], cols, axis=1) + random.normal(0, 0.2, (rows, cols))
    disparity[random.random((rows, cols)) < 0.3] = np.nan
    return disparity.astype(np.float32)


def test_flicker_is_the_change_where_the_picture_stays() -> None:
    picture = np.rint(np.clip(texture(60, 80), 0, 255)).astype(np.uint8)
    later = picture.copy()
    later[:, 40:] = 255 - later[:, 40:]
    before, now = np.full((60, 80), 10, np.float32), np.full((60, 80), 10, np.float32)
    now[:, 40:] = 50  # the picture changed there
    still = still_pixels(picture, later)
    assert still[:, :36].all() and not still[:, 48:].any()
    assert flicker(before, now, still) == 0
    now[:30, :20] = 14
    assert flicker(before, now, still) == pytest.approx(4 * 600 / still.sum())
    now[:, :30] = np.nan
    assert flicker(before, now, still) == 0
    assert math.isnan(flicker(before, np.full_like(now, np.nan), still))
    with pytest.raises(ValueError, match="all must be one"):
        flicker(before, now[1:], still)


@pytest.mark.parametrize("unit", [np.uint8(1), np.uint16(257)])
def test_noise_of_a_camera_is_no_change(unit: np.unsignedinteger) -> None:
    noise = np.random.default_rng(1).normal(0, 1.5, (2, 80, 90))
    frames = np.clip(texture(80, 90) + noise, 0, 255).astype(np.uint8) * unit
    assert still_pixels(*frames).mean() > 0.99


@pytest.mark.parametrize(
    ("things", "nearest", "within"),
    [
        # Only the far wall stands on the ground.
        ([], 1.5, 1.5),
        # Two cars, whose wheels touch the ground at rows 114 and 126.
        ([(np.s_[90:115, 50:90], 12.0), (np.s_[80:127, 180:230], 16.1)], 16.1, 0.6),
        # A bridge, three times as high as the camera, and a few wrong matches: the far wall is left.
        ([(np.s_[:12], 12.0), (np.s_[100:105, 100:110], 60.0)], 1.5, 1.5),
        # Many wrong matches, each patch of them smaller than an obstacle.
        ([(np.s_[100:107, col : col + 8], 60.0) for col in range(0, 300, 20)], 1.5, 1.5),
    ],
)
def test_the_nearest_obstacle_stands_on_the_ground(things, nearest: float, within: float) -> None:
    disparity = road()
    for place, near in things:
        disparity[place] = near
    assert nearest_obstacle(disparity) == pytest.approx(nearest, abs=within)
    ground = ground_of(road())
    assert ground.slope == pytest.approx(0.35, abs=0.01) and ground.horizon == pytest.approx(80, abs=2)


def test_the_ground_is_that_of_the_filled_pixels_where_too_little_is_measured() -> None:
    disparity, measured = road(), np.random.default_rng(1).random((200, 300)) < 0.05
    measured[80:127, 180:230], disparity[80:127, 180:230] = True, 16.1
    measured &= np.isfinite(disparity)
    assert ground_of(disparity, measured) is None
    assert nearest_obstacle(disparity, measured) == pytest.approx(16.1, abs=0.1)


def test_without_a_ground_everything_counts() -> None:
    disparity = np.full((100, 100), 5, np.float32)
    disparity[20:40, 20:40] = 9
    assert ground_of(disparity) is None
    assert nearest_obstacle(disparity) == 9
    assert math.isnan(nearest_obstacle(np.full((10, 10), np.nan)))
    with pytest.raises(ValueError, match="allowed is"):
        nearest_obstacle(np.zeros(5))


def test_figures_of_a_frame() -> None:
    wide = np.rint(np.clip(texture(80, 152), 0, 255)).astype(np.uint8)
    result = StereoSGBM(num_disparities=16).compute(wide[:, :120].copy(), wide[:, 7:127].copy())
    truth = np.full((80, 120), 7, np.float32)
    figures = figures_of(result, truth, CALIBRATION)
    assert figures["nearest_px"] == pytest.approx(7, abs=0.2)
    assert figures["nearest_m"] == pytest.approx(700 * 0.5 / figures["nearest_px"])
    assert figures["coverage"] == result.coverage
    assert figures["bad_2_percent"] == pytest.approx(100 * (1 - result.coverage), abs=1)
    assert figures["epe_px"] < 0.2 and figures["milliseconds"] == result.elapsed_s * 1e3
    blind = figures_of(result, truth[:, 1:], None)
    assert "epe_px" not in blind and math.isnan(blind["nearest_m"])


@pytest.mark.parametrize(("encode", "ending"), [(kitti_png, ".png"), (pfm, ".pfm")])
@pytest.mark.parametrize("missing", [0.0, 0.3, 1.0])
def test_a_map_is_what_is_read_back_from_its_file(encode, ending, missing):
    rng = np.random.default_rng(0)
    disparity = rng.uniform(-0.3, 255, (40, 50)).astype(np.float32)
    disparity[rng.random((40, 50)) < missing] = np.nan
    stored = as_stored(disparity, ending)
    assert np.array_equal(stored, read_back(encode(disparity)), equal_nan=True)
    assert (stored is disparity) == (ending == ".pfm")


def test_a_map_travels_as_its_file() -> None:
    disparity = as_stored(np.random.default_rng(0).uniform(0, 60, (40, 50)).astype(np.float32), ".png")
    one = FrameMap(disparity, kitti_png(disparity), {"coverage": 0.5})
    packed = pickle.dumps(one)
    assert len(packed) < len(one.data) + 500
    other = pickle.loads(packed)
    assert np.array_equal(other.disparity, disparity) and other.data == one.data and other.figures == one.figures


def test_a_table_is_read_back_up_to_where_it_was_cut(tmp_path: Path) -> None:
    records = [FrameRecord(n, f"a, {n}", n / 10, "fast", 0.5, 12.25, 30.0, 11.5) for n in range(3)]
    records.append(FrameRecord(3, "d", 0.3, "fast", problem='cut "short"'))
    text = table_lines(records, header=True)
    assert text.splitlines()[0].split(",") == list(COLUMNS)
    table = tmp_path / "frames.csv"
    table.write_text(text)
    read = read_records(table)
    assert list(map(repr, read)) == list(map(repr, records))
    for cut in range(text.index("\n") + 1, len(text)):
        table.write_text(text[:cut])
        assert list(map(repr, read_records(table))) == list(map(repr, records[: text[:cut].count("\n") - 1]))
    table.write_text("another,table\n1,2\n")
    assert read_records(table) == []
