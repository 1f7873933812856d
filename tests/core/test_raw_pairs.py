"""The input doctor on unrectified pairs: rotated cameras, distorting lenses, the same picture twice."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from diagnosed import diagnosed
from raw_views import barrel, through_barrel, truth_points, turned_camera, turning

from stereolag.assess.diagnosis import Diagnosis, Finding, FindingCode
from stereolag.assess.features import Correspondences
from stereolag.assess.orientation import best_rectification, find_correspondences, fit_rectification, robust_fit
from stereolag.assess.remedies import Remedy, apply_remedy
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs

Views = tuple[np.ndarray, np.ndarray]
SHAPE = (480, 640)


def bundled(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    example = stereo_pairs()[name]
    return read_image(example.left), read_image(example.right), np.asarray(read_disparity(example.disparity), float)


def finding(diagnosis: Diagnosis, code: FindingCode) -> Finding:
    found = diagnosis.finding(code)
    assert found is not None
    return found


def matched(left: np.ndarray, right: np.ndarray, shape: tuple[int, int] = SHAPE) -> Correspondences:
    inside = ((left >= 0) & (right >= 0) & (left < shape[::-1]) & (right < shape[::-1])).all(axis=1)
    return Correspondences(left[inside].astype(np.float32), right[inside].astype(np.float32), shape)


def covered(diagnosis: Diagnosis, disparities: np.ndarray) -> float:
    assert diagnosis.suggested_range is not None
    first, count = diagnosis.suggested_range
    return float(np.mean((disparities >= first) & (disparities < first + count)))


# The model


def scattered_points() -> Views:
    rng = np.random.default_rng(0)
    left = rng.uniform((40, 20), (620, 460), (400, 2))
    return left, left - np.column_stack([rng.uniform(5, 60, 400), np.zeros(400)])


def moved(points: np.ndarray, homography: np.ndarray) -> np.ndarray:
    return cv2.perspectiveTransform(points[:, None], homography)[:, 0]


@pytest.mark.parametrize("lens", [0.0, -0.25, 0.1])
@pytest.mark.parametrize("turns", [((0, 0, 0), (0, 0, 0)), ((0, 0.04, 0.01), (0.03, -0.05, -0.02))])
def test_rows_match_after_turning_and_freeing_of_the_lens(lens: float, turns: tuple) -> None:
    left, right = (moved(points, turning(SHAPE, turn)) for points, turn in zip(scattered_points(), turns, strict=True))
    views = matched(through_barrel(left, SHAPE, lens), through_barrel(right, SHAPE, lens))
    wrong = Correspondences(views.left[::-1][:60], views.right[:60], SHAPE)
    model = fit_rectification(views.joined(wrong), lens=True)
    assert np.percentile(np.abs(model.row_errors(views)), 90) < 0.5
    exchanged = Correspondences(views.right, views.left, SHAPE)
    swapped = fit_rectification(exchanged, lens=True)
    assert np.median(model.disparities(views)[0]) > 0 > np.median(swapped.disparities(exchanged)[0])


def test_images_are_warped_to_where_their_points_go() -> None:
    left, right = scattered_points()
    right = moved(right, turning(SHAPE, (0, 0, 0.02)))
    views = matched(through_barrel(left, SHAPE, -0.2), through_barrel(right, SHAPE, -0.2))
    model = fit_rectification(views, lens=True)
    rows = np.indices(SHAPE)[0].astype(np.float32)
    warped = model.applied(rows, rows)
    # The images contain their own row numbers, which are read where the model puts the matched points.
    for image, points, at in zip(warped, (views.left, views.right), model.places(views), strict=True):
        seen = cv2.remap(image, at.astype(np.float32)[:, None], None, cv2.INTER_LINEAR, borderValue=np.nan).ravel()
        there = np.isfinite(seen)
        assert there.mean() > 0.5
        assert np.abs(seen[there] - points[there, 1]).max() < 0.2


def test_a_fit_is_not_led_by_outliers() -> None:
    rng = np.random.default_rng(2)
    terms = np.column_stack([np.ones(200), rng.uniform(-1, 1, (200, 2))])
    values = terms @ [3.0, -2.0, 1.0] + rng.normal(0, 0.05, 200)
    values[:50] += rng.uniform(5, 50, 50)
    np.testing.assert_allclose(robust_fit(terms, values), [3.0, -2.0, 1.0], atol=0.05)


# Lenses


@pytest.mark.parametrize(("name", "k1"), [("cube", -0.05), ("road", -0.3), ("cube", -0.3), ("giraffes", -0.3)])
def test_bent_rows_are_measured_and_straightened_into_the_corners(name: str, k1: float) -> None:
    left, right, disparity = bundled(name)
    views, shape = (barrel(left, k1), barrel(right, k1)), left.shape[:2]
    true = matched(*(through_barrel(points, shape, k1) for points in truth_points(disparity)), shape)
    diagnosis = diagnosed(*views)
    bent = finding(diagnosis, FindingCode.BENT_ROWS)
    assert covered(diagnosis, -true.dx) > 0.998
    assert finding(diagnosis, FindingCode.SWAPPED).healthy
    assert bent.healthy == (k1 > -0.1)
    if not bent.healthy:
        assert bent.remedy is Remedy.RECTIFY
        assert bent.numbers["lens"] == pytest.approx(k1, abs=0.1)
        assert bent.numbers["spread_px"] == pytest.approx(float(np.std(true.dy)), rel=0.4)
        found = best_rectification(find_correspondences(*views))
        assert found is not None
        errors = np.abs(found.row_errors(true))
        assert np.sqrt(np.mean(errors**2)) < 0.35
        again = diagnosed(*apply_remedy(*views, bent.remedy))
        assert finding(again, FindingCode.BENT_ROWS).healthy
        assert finding(again, FindingCode.ROWS).healthy
        assert finding(again, FindingCode.SWAPPED).healthy


# Rotated cameras


@pytest.mark.parametrize("order", [1, -1], ids=["right", "swapped"])
def test_turned_cameras_are_turned_back_and_their_sides_told(order: int) -> None:
    left, right, _ = bundled("cube")
    views = (turned_camera(left, (0.0, 0.05, 0.0)), turned_camera(right, (0.02, -0.03, 0.01)))[::order]
    diagnosis = diagnosed(*views)
    bent, sides = finding(diagnosis, FindingCode.BENT_ROWS), finding(diagnosis, FindingCode.SWAPPED)
    assert bent.remedy is Remedy.RECTIFY
    assert finding(diagnosis, FindingCode.ROWS).remedy is None  # one remedy for both
    assert sides.numbers["known"]
    assert sides.healthy == (order == 1)
    again = diagnosed(*apply_remedy(*views, Remedy.RECTIFY))
    assert {
        finding(again, code).healthy for code in (FindingCode.ROWS, FindingCode.ROTATION, FindingCode.BENT_ROWS)
    } == {True}


def test_a_rectified_pair_is_not_rectified_from_its_images() -> None:
    left, right, _ = bundled("cube")
    with pytest.raises(ValueError, match="hardly better than moving, rotating and scaling"):
        apply_remedy(left, right, Remedy.RECTIFY)


# The same picture twice


@pytest.mark.parametrize("quality", [None, 70])
def test_one_picture_twice_is_told_and_nothing_else_of_its_geometry(quality: int | None) -> None:
    left, right, _ = bundled("cube")
    again = (
        left
        if quality is None
        else cv2.imdecode(cv2.imencode(".jpg", left, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], -1)
    )
    diagnosis = diagnosed(left, again)
    assert not finding(diagnosis, FindingCode.IDENTICAL).healthy
    assert not {FindingCode.SWAPPED, FindingCode.ROWS, FindingCode.BENT_ROWS, FindingCode.RANGE} & {
        found.code for found in diagnosis.findings
    }
    assert diagnosis.suggested_range is None
    assert finding(diagnosed(left, right), FindingCode.IDENTICAL).healthy


# Ranges


@pytest.mark.parametrize("name", ["road", "cube", "giraffes", "square"])
def test_the_suggested_range_covers_the_pair(name: str) -> None:
    left, right, disparity = bundled(name)
    diagnosis = diagnosed(left, right)
    known = disparity[np.isfinite(disparity)]
    assert covered(diagnosis, known) > 0.999
    assert diagnosis.suggested_range is not None
    assert diagnosis.suggested_range[1] <= 1.3 * known.max() + 16


def test_real_raw_pairs(data_dir: Path) -> None:
    for number in ("02", "06", "08"):
        folder = data_dir / "calibration" / "opencv_chessboard"
        left, right = (read_image(folder / f"{side}{number}.jpg") for side in ("left", "right"))
        diagnosis = diagnosed(left, right)
        assert finding(diagnosis, FindingCode.MATCHES).numbers["count"] > 100
        bent = finding(diagnosis, FindingCode.BENT_ROWS)
        assert bent.remedy is Remedy.RECTIFY
        assert bent.numbers["rectified_px"] < 0.7
        assert finding(diagnosis, FindingCode.SWAPPED).healthy
        assert diagnosis.suggested_range is not None
        first, count = diagnosis.suggested_range
        assert first <= 30
        assert first + count >= 145
    assert finding(diagnosed(right, left), FindingCode.SWAPPED).remedy is Remedy.SWAP_SIDES
