"""The bundled stereo pairs: ground truth, checked against the pictures independently of the renderer."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest

STEREO = Path(__file__).resolve().parents[2] / "assets" / "stereo"
SIZES = {"cube": (640, 480), "fence": (640, 480), "giraffes": (640, 480), "square": (480, 480), "road": (881, 400)}
CALIBRATION_KEYS = {
    "focal_px", "baseline_m", "doffs_px", "cx", "cy", "width", "height", "num_disparities", "title", "description",
}  # fmt: skip
MAX_BYTES = 9_000_000


@dataclass(frozen=True)
class Sample:
    left: np.ndarray
    right: np.ndarray
    codes: np.ndarray
    mask: np.ndarray
    calibration: dict[str, float | int | str]

    @property
    def disparity(self) -> np.ndarray:
        return self.codes / np.float32(256)

    @property
    def matchable(self) -> np.ndarray:
        return (self.codes > 0) & (self.mask == 0)


@lru_cache
def load(name: str) -> Sample:
    folder = STEREO / name
    left, right, codes, mask = (
        cv2.imread(str(folder / f"{part}.png"), cv2.IMREAD_UNCHANGED)
        for part in ("left", "right", "disparity", "occlusion")
    )
    return Sample(left, right, codes, mask, json.loads((folder / "calibration.json").read_text()))


@pytest.fixture(params=SIZES)
def sample(request: pytest.FixtureRequest) -> Sample:
    return load(request.param)


@pytest.mark.parametrize("name", SIZES)
def test_files_have_the_promised_formats(name: str) -> None:
    sample, (width, height) = load(name), SIZES[name]
    for picture in (sample.left, sample.right):
        assert picture.shape == (height, width, 3)
        assert picture.dtype == np.uint8
    assert (sample.codes.shape, sample.codes.dtype) == ((height, width), np.uint16)
    assert (sample.mask.shape, sample.mask.dtype) == ((height, width), np.uint8)
    assert set(np.unique(sample.mask)) <= {0, 255}


@pytest.mark.parametrize("name", SIZES)
def test_calibration_describes_the_pictures(name: str) -> None:
    calibration, (width, height) = load(name).calibration, SIZES[name]
    assert set(calibration) == CALIBRATION_KEYS
    assert (calibration["width"], calibration["height"]) == (width, height)
    assert (calibration["cx"], calibration["cy"]) == ((width - 1) / 2, (height - 1) / 2)
    assert calibration["focal_px"] > 0
    assert calibration["baseline_m"] > 0
    assert calibration["num_disparities"] % 16 == 0


def test_all_pairs_together_stay_small() -> None:
    assert sum(file.stat().st_size for file in STEREO.rglob("*") if file.is_file()) <= MAX_BYTES


def test_disparities_lie_within_the_search_range(sample: Sample) -> None:
    known = sample.disparity[sample.codes > 0]
    assert known.size > 0.6 * sample.codes.size
    assert known.max() <= sample.calibration["num_disparities"] - 1
    assert np.ptp(known) > 8


def test_right_image_moved_by_the_truth_is_the_left_image(sample: Sample) -> None:
    rows, columns = np.mgrid[: sample.codes.shape[0], : sample.codes.shape[1]].astype(np.float32)

    def disagreement(shift: float) -> float:
        source = columns - sample.disparity + np.float32(shift)
        moved = cv2.remap(sample.right, source, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return float(cv2.absdiff(moved, sample.left).max(axis=2)[sample.matchable].mean())

    exact = disagreement(0.0)
    assert exact < 13
    assert min(disagreement(-2.0), disagreement(2.0)) > 1.3 * exact

    before, after = disagreement(-0.5), disagreement(0.5)
    best = 0.5 * (before - after) / (2 * (before - 2 * exact + after))  # the vertex of a parabola through the three
    assert abs(best) < 0.05


def test_occlusion_follows_from_the_disparities(sample: Sample) -> None:
    rows, columns = np.nonzero(sample.codes)
    disparity = sample.disparity[rows, columns]
    landing = np.round(columns - disparity).astype(int)
    inside = landing >= 0
    nearest = np.zeros(sample.codes.shape, dtype=np.float32)
    np.maximum.at(nearest, (rows[inside], landing[inside]), disparity[inside])

    hidden = sample.mask[rows, columns] > 0
    assert hidden[columns - disparity < -0.5].all()
    seen = inside & ~hidden
    in_front = nearest[rows[seen], landing[seen]] - disparity[seen] > 1.0
    assert in_front.mean() < 0.03

    covered = cv2.dilate(nearest, np.ones((1, 3), np.uint8))
    behind = inside & hidden
    explained = covered[rows[behind], landing[behind]] - disparity[behind] > 0
    assert explained.mean() > 0.8


@pytest.mark.parametrize(
    ("name", "allowed"), [("cube", 0.02), ("fence", 0.35), ("giraffes", 0.15), ("square", 0.05), ("road", 0.08)]
)
def test_semi_global_matching_agrees_with_the_truth(name: str, allowed: float) -> None:
    sample = load(name)
    matcher = cv2.StereoSGBM.create(
        numDisparities=int(sample.calibration["num_disparities"]),
        blockSize=5,
        P1=8 * 3 * 25,
        P2=32 * 3 * 25,
        uniquenessRatio=5,
    )
    found = matcher.compute(sample.left, sample.right) / np.float32(16)
    answered = sample.matchable & (found > 0)
    assert answered.sum() > 0.6 * sample.matchable.sum()
    assert (np.abs(found - sample.disparity)[answered] > 2).mean() < allowed
