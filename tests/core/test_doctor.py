"""The input doctor finds the fault of a pair, finds nothing wrong with a healthy one, and its remedies work."""

import json
import pickle
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pairs
import pytest
from ailing_pairs import ILLS, REMEDIES, barrel, darkened, through_barrel, turned, turned_camera, turning

from benchmarks.doctor import covered, true_matches
from stereolag import read_disparity, read_image
from stereolag.assess import diagnosis as examining
from stereolag.assess import orientation
from stereolag.assess.diagnosis import Diagnosis, apply_remedy, diagnose, judge_range
from stereolag.assess.features import Correspondences, mutual_matches
from stereolag.assess.findings import FindingCode, Remedy
from stereolag.assess.layout import Layout, likely_layout, pure_rotation_deg
from stereolag.assess.orientation import RowEvidence, best_rectification, find_correspondences, robust_fit
from stereolag.assess.uncalibrated import fit_rectification
from stereolag.geometry.rectification import scaled_disparity, scaled_image
from stereolag.io.ground_truth import DIVISORS, truth_fit
from stereolag.samples import drives, stereo_pairs

Pair = tuple[np.ndarray, np.ndarray]
SHAPE = (480, 640)
NAN = float("nan")
ROTATION = FindingCode.ROTATION
GEOMETRY = {FindingCode.SWAPPED, FindingCode.ROWS, FindingCode.ROTATION}


CUTS = slice(40, None), slice(-40)
"""Columns of the left and of the right picture, which move all disparities by 40 px."""

bundled = partial(pairs.bundled, size=0.5)
"""Half their size, which is fast."""


@cache
def healthy(name: str = "cube") -> Diagnosis:
    return diagnose(*bundled(name)[:2])


def amber(diagnosis: Diagnosis) -> set[FindingCode]:
    return {finding.code for finding in diagnosis.findings if not finding.healthy}


@pytest.fixture(scope="module", autouse=True)
def _matched_once() -> Iterator[None]:
    """Match each pair once: a diagnosis and its remedy ask for the same, which takes half of all time."""
    known: dict[tuple[object, ...], Correspondences] = {}

    def matched_once(left: np.ndarray, right: np.ndarray) -> Correspondences:
        pair = tuple((one.shape, one.dtype, one.tobytes()) for one in (left, right))
        if pair not in known:
            known[pair] = find_correspondences(left, right)
        return known[pair]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(examining, "find_correspondences", matched_once)
        patch.setattr(orientation, "find_correspondences", matched_once)
        yield


# Rectified pairs


@pytest.mark.parametrize("name", ["road", "cube"])
def test_a_rectified_pair_is_healthy_in_its_geometry(name: str) -> None:
    diagnosis = healthy(name)
    assert not amber(diagnosis) & {*GEOMETRY, FindingCode.EXPOSURE, FindingCode.MATCHES, FindingCode.IDENTICAL}
    assert abs(diagnosis.finding(FindingCode.ROWS).numbers["offset_px"]) < 0.3


@pytest.mark.parametrize(
    ("name", "damage", "code", "expected"),
    [
        ("road", lambda view: np.roll(view, -5, axis=0), FindingCode.ROWS, {"offset_px": (-5, 0.3)}),
        # getRotationMatrix2D takes anticlockwise as positive, but rows grow downwards.
        ("road", lambda view: turned(view, -2.0), ROTATION, {"rotation_deg": (2, 0.15), "scale": (1, 0.007)}),
        ("cube", lambda view: turned(view, 0, 1.02), ROTATION, {"rotation_deg": (0, 0.15), "scale": (1.02, 0.005)}),
        # Its rims, which only one picture shows, are of other greys.
        ("square", darkened, FindingCode.EXPOSURE, {"gain": (0.6, 0.01)}),
    ],
    ids=["offset", "rotation of the road", "scale", "exposure"],
)
def test_a_fault_is_measured_and_fixed(name: str, damage: Any, code: FindingCode, expected: dict[str, Any]) -> None:
    left, right, _ = bundled(name)
    diagnosis = diagnose(left, damage(right))
    finding = diagnosis.finding(code)
    assert amber(diagnosis) & {*GEOMETRY, FindingCode.BENT_ROWS, FindingCode.EXPOSURE} == {code}
    assert finding.remedy is REMEDIES[code]
    for number, (value, tolerance) in expected.items():
        assert finding.numbers[number] == pytest.approx(value, abs=tolerance)
    mended = apply_remedy(left, damage(right), REMEDIES[code])
    assert not amber(diagnose(*mended)) & {code, FindingCode.ROWS}
    assert mended[0] is left
    assert (mended[1].shape, mended[1].dtype) == (right.shape, right.dtype)


@pytest.mark.parametrize("upper_first", [True, False])
def test_cameras_above_each_other_are_told_and_turned(upper_first: bool) -> None:
    left, right, _ = bundled("road")
    upper, lower = (np.rot90(view, -1) for view in (left, right))
    diagnosis = diagnose(*((upper, lower) if upper_first else (lower, upper)))
    finding = diagnosis.finding(FindingCode.ABOVE_EACH_OTHER)
    assert amber(diagnosis) & {*GEOMETRY, FindingCode.ABOVE_EACH_OTHER} == {FindingCode.ABOVE_EACH_OTHER}
    assert finding.remedy is Remedy.TURN_UPRIGHT and finding.numbers["quarters"] == (1 if upper_first else -1)
    assert diagnosis.suggested_range is None
    mended = apply_remedy(*((upper, lower) if upper_first else (lower, upper)), Remedy.TURN_UPRIGHT)
    turned_by = 0 if upper_first else 2
    for view, as_seen in zip(mended, (left, right) if upper_first else (right, left), strict=True):
        np.testing.assert_array_equal(view, np.rot90(as_seen, turned_by))
    # Of the upper one first, nothing but the pair in the bundle is left.
    assert not amber(diagnose(*mended) if turned_by else healthy("road")) & {*GEOMETRY, FindingCode.ABOVE_EACH_OTHER}


@pytest.mark.parametrize("name", ["road", "square"])
def test_a_picture_upside_down_is_told_and_turned_back_and_nothing_else_is_said_of_its_geometry(name: str) -> None:
    left, right, truth = bundled(name)
    upside_down = np.ascontiguousarray(right[::-1, ::-1])
    diagnosis = diagnose(left, upside_down)
    assert amber(diagnosis) == {ROTATION} and diagnosis.suggested_range is None
    assert abs(diagnosis.finding(ROTATION).numbers["rotation_deg"]) == pytest.approx(180, abs=0.5)
    again = diagnose(*apply_remedy(left, upside_down, diagnosis.finding(ROTATION).remedy))
    assert amber(again) <= {FindingCode.RANGE} and covered(again, truth[np.isfinite(truth)]) > 0.99


def test_a_mirrored_picture_is_told_and_mirrored_back() -> None:
    left, right, _ = bundled("road")
    diagnosis = diagnose(left, right[:, ::-1])
    finding = diagnosis.finding(FindingCode.MIRRORED)
    assert not finding.healthy and finding.remedy is Remedy.MIRROR_RIGHT and diagnosis.suggested_range is None
    np.testing.assert_array_equal(apply_remedy(left, right[:, ::-1], Remedy.MIRROR_RIGHT)[1], right)


def test_a_rotation_is_mended_as_a_whole_and_no_remedy_is_offered_that_does_not_help() -> None:
    left, right, _ = bundled("square")
    turned = diagnose(left, ILLS[FindingCode.ROTATION](left, right)[1])
    assert {one.code: one.remedy for one in turned.doubts if one.code != FindingCode.RANGE} == {ROTATION: Remedy.LEVEL}
    blank = diagnose(*(np.concatenate([view[:160], np.full_like(view[160:], 60 + 9 * place)])
                       for place, view in enumerate(bundled("cube", size=1.0)[:2])))  # fmt: skip
    assert amber(blank) >= {FindingCode.TEXTURE}
    assert all(one.remedy is None for one in blank.doubts)


def test_both_views_in_each_picture_are_told() -> None:
    left, right, _ = bundled("cube")
    for axis in range(2):
        both = np.concatenate([left, right], axis=axis)
        diagnosis = diagnose(both, both)
        assert diagnosis.finding(FindingCode.LAYOUT).numbers == {"beside": axis, "half": 0}
        assert diagnosis.suggested_range is None and all(one.remedy is None for one in diagnosis.ill)
    assert diagnose(left, left).finding(FindingCode.LAYOUT).healthy


@pytest.mark.parametrize(("name", "blurred"), [("road", "left"), ("cube", "right"), ("square", "left")])
def test_a_view_that_is_out_of_focus_is_not_darker_and_no_lens_bends_it(name: str, blurred: str) -> None:
    views = dict(zip(("left", "right"), bundled(name)[:2], strict=True))
    views[blurred] = cv2.GaussianBlur(views[blurred], (0, 0), 2)
    assert not amber(diagnose(**views)) & {FindingCode.EXPOSURE, FindingCode.BENT_ROWS}


def test_a_wall_of_equal_windows_in_two_lights_is_not_taken_for_both_views() -> None:
    rng = np.random.default_rng(7)
    rows, cols = np.mgrid[:240, :330]
    wall = 150 + 40 * cv2.GaussianBlur(rng.standard_normal((240, 330)), (0, 0), 2)
    wall[(cols % 44 < 26) & (rows % 48 < 30)] -= 90
    wall = np.clip(wall, 0, 255)
    bright, dark = wall[:, :320].astype(np.uint8), (0.6 * wall[:, 9:329]).astype(np.uint8)
    diagnosis = diagnose(bright, dark, num_disparities=32)
    assert amber(diagnosis) == {FindingCode.EXPOSURE}
    first, count = diagnosis.suggested_range
    assert first <= 9 < first + count


MOVING = {"right": {FindingCode.NOT_SAME_MOMENT}}
MOVING["left"] = {FindingCode.ONE_MOVING_CAMERA, FindingCode.NOT_SAME_MOMENT}


@pytest.mark.parametrize("side", MOVING)
def test_pictures_of_a_moving_camera_are_told_and_no_remedy_is_offered(side: str) -> None:
    (drive,) = drives().values()
    diagnosis = diagnose(read_image(drive.left[1]), read_image(getattr(drive, side)[2]))
    assert amber(diagnosis) == MOVING[side] and diagnosis.suggested_range is None
    assert all(finding.remedy is None for finding in diagnosis.ill)


def test_a_slow_motion_forwards_is_not_taken_for_rows_that_bend() -> None:
    rng = np.random.default_rng(1)
    views = [np.zeros((240, 320), np.float32) for _ in range(2)]
    for growth, places in ((1.01, 1), (1.03, 6), (1.06, 6)):  # things nearer by, before those behind them
        texture = cv2.GaussianBlur(rng.standard_normal((240, 320)).astype(np.float32), (0, 0), 1.5)
        shown = np.full((240, 320), 1 if places == 1 else 0, np.float32)
        for row, col in rng.integers((0, 0), (200, 280), (places, 2)):
            shown[row : row + 40, col : col + 40] = 1
        for number, view in enumerate(views):
            closer = cv2.getRotationMatrix2D((159.5, 119.5), 0, growth**number)
            seen = cv2.warpAffine(shown, closer, (320, 240), flags=cv2.INTER_NEAREST) > 0
            view[seen] = cv2.warpAffine(texture, closer, (320, 240), flags=cv2.INTER_CUBIC)[seen]
    told = diagnose(*(np.clip(120 + 250 * view, 0, 255).astype(np.uint8) for view in views))
    assert amber(told) == MOVING["left"] and all(finding.remedy is None for finding in told.ill)


def test_a_thing_that_moved_up_or_down_is_told_and_the_rest_is_examined_all_the_same() -> None:
    left, right, _ = bundled("cube")
    right = right.copy()
    right[72:132, 160:220] = right[78:138, 160:220].copy()
    diagnosis = diagnose(left, right)
    moment = diagnosis.finding(FindingCode.NOT_SAME_MOMENT)
    assert amber(diagnosis) - amber(healthy()) == {FindingCode.NOT_SAME_MOMENT} and moment.numbers["moved"] >= 25
    assert diagnosis.suggested_range == healthy().suggested_range


def test_pictures_with_nothing_in_common_get_no_remedy_and_no_range() -> None:
    diagnosis = diagnose(bundled("road")[0][:200, :300], bundled("cube")[1][:200, :300])
    assert FindingCode.MATCHES in amber(diagnosis)
    assert diagnosis.suggested_range is None and all(finding.remedy is None for finding in diagnosis.ill)


@pytest.mark.parametrize("period", [24, 40])
def test_a_picture_that_repeats_is_searched_over_one_repetition(period: int) -> None:
    random = np.random.default_rng(period)
    tile = cv2.GaussianBlur(random.integers(0, 255, (240, period), dtype=np.uint8), (0, 0), 1)
    wall = np.tile(tile, 480 // period + 1)[:, :480]
    left, right = (
        np.clip(np.roll(wall, -shift, axis=1) + random.normal(0, 3, wall.shape), 0, 255).astype(np.uint8)
        for shift in (0, 9)
    )
    diagnosis = diagnose(left, right, num_disparities=96)
    finding = diagnosis.finding(FindingCode.RANGE)
    assert not finding.healthy and finding.numbers["repeats_px"] == pytest.approx(period, abs=2)
    assert diagnosis.suggested_range == (0, 16 * -(-period // 16))


def test_blank_margins_do_not_widen_the_range_to_the_ends_of_the_search() -> None:
    left, right, disparity = bundled("cube")
    views = [np.pad(view[30:-30, 30:-30], ((30, 30), (30, 30), (0, 0)), constant_values=255) for view in (left, right)]
    low, high = diagnose(*views).disparities
    assert -4 < low < high < np.nanmax(disparity) + 4


def test_black_borders_are_told() -> None:
    left, right, _ = bundled("cube")
    right = right.copy()
    right[np.tril_indices(len(right), -440)] = 0  # a corner, as rectification leaves it
    right[:, -30:] = 0
    finding = diagnose(left, right).finding(FindingCode.EMPTY_BORDER)
    assert not finding.healthy and finding.numbers["left_share"] == 0
    assert finding.numbers["right_share"] == pytest.approx(np.mean(right.max(axis=2) == 0), abs=0.002)


def test_a_remedy_that_cannot_be_applied_is_refused() -> None:
    left, right, _ = bundled("cube")
    with pytest.raises(ValueError, match="remedy is 'set_range', which changes the search range of a matcher"):
        apply_remedy(left, right, Remedy.SET_RANGE)
    with pytest.raises(ValueError, match="hardly better than moving, rotating and scaling"):
        apply_remedy(left, right, Remedy.RECTIFY)
    noise = np.random.default_rng(1).integers(0, 255, (2, 200, 300), dtype=np.uint8)
    with pytest.raises(ValueError, match="features were matched"):
        apply_remedy(*noise, Remedy.LEVEL)


def test_low_texture_is_found_and_images_too_small_for_features_are_examined_all_the_same() -> None:
    flat = np.full((200, 300), 90, np.uint8)
    flat[80:120, 100:180] = np.random.default_rng(0).integers(0, 255, (40, 80))
    assert FindingCode.TEXTURE in amber(diagnose(flat, flat))
    for shape in ((1, 1), (2, 2), (1, 3_000), (30, 200), (64, 1)):
        left, right = np.random.default_rng(3).integers(0, 256, (2, *shape), dtype=np.uint8)
        assert len(find_correspondences(left, right)) == 0
        assert FindingCode.MATCHES in amber(diagnose(left, right)), shape


@pytest.mark.parametrize("quality", [None, 70])
def test_one_picture_twice_is_told_and_nothing_else_of_its_geometry(quality: int | None) -> None:
    again = left = bundled("cube", size=1.0)[0]
    if quality is not None:
        again = cv2.imdecode(cv2.imencode(".jpg", left, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], -1)
    diagnosis = diagnose(left, again)
    codes = {finding.code for finding in diagnosis.findings}
    assert FindingCode.IDENTICAL in amber(diagnosis)
    assert not codes & {FindingCode.SWAPPED, FindingCode.ROWS, FindingCode.BENT_ROWS, FindingCode.RANGE}
    assert diagnosis.suggested_range is None


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_every_type_of_image_is_examined(dtype: type) -> None:
    images = [image.astype(dtype) * (257 if dtype == np.uint16 else 1) for image in bundled("cube")[:2]]
    assert len(find_correspondences(*images)) > 100
    assert apply_remedy(*images, Remedy.MATCH_EXPOSURE)[1].dtype == dtype


def test_findings_are_frozen_and_survive_another_process() -> None:
    diagnosis = healthy()
    with pytest.raises(TypeError):
        diagnosis.findings[0].numbers["count"] = 0  # type: ignore[index]
    assert pickle.loads(pickle.dumps(diagnosis)) == diagnosis
    assert len({*diagnosis.findings}) == len(diagnosis.findings)


def test_real_pairs(data_dir: Path) -> None:
    for name in ("cones", "kitti2015_000046"):
        left, right = (read_image(data_dir / "stereo" / name / f"{side}.png") for side in ("left", "right"))
        assert not amber(diagnose(left, right)) & GEOMETRY, name


# The range


def test_the_range_is_judged_against_the_disparities_in_the_pair_and_not_of_swapped_sides() -> None:
    diagnosis = healthy()
    first, count = diagnosis.suggested_range
    assert count % 16 == 0
    for searched, missing in ((16, True), (256, False)):
        finding = judge_range(diagnosis, 0, searched)
        assert finding.remedy is Remedy.SET_RANGE
        assert (finding.numbers["missing_px"] > 0) == missing
        assert finding.numbers["suggested_min_disparity"] == first
        assert finding.numbers["suggested_num_disparities"] == count
    well = judge_range(diagnosis, first, count)
    assert well.healthy
    left, right, _ = bundled("cube")
    assert judge_range(diagnosis, 0, 256) == diagnose(left, right, num_disparities=256).finding(FindingCode.RANGE)
    swapped = diagnose(right, left)
    assert swapped.finding(FindingCode.SWAPPED).remedy is Remedy.SWAP_SIDES
    assert apply_remedy(right, left, Remedy.SWAP_SIDES)[0] is left
    assert judge_range(swapped, 0, 64) is swapped.finding(FindingCode.RANGE) is swapped.suggested_range is None


@pytest.mark.parametrize("name", stereo_pairs())
def test_the_suggested_range_holds_what_there_is_and_little_more(name: str) -> None:
    diagnosis, truth = healthy(name), bundled(name)[2]
    known = truth[np.isfinite(truth)]
    low, high = np.percentile(known, (0.1, 99.9))
    first, count = diagnosis.suggested_range
    assert covered(diagnosis, known) > 0.998
    assert -16 <= first <= low < high <= first + count - 1 <= high + 0.3 * (high - low) + 31


@pytest.mark.parametrize("name", ["cube", "road"])
def test_pictures_cropped_until_all_is_behind_their_frame_are_not_taken_for_swapped(name: str) -> None:
    *views, truth = bundled(name)
    left, right = (np.ascontiguousarray(view[:, cut]) for view, cut in zip(views, CUTS, strict=True))
    diagnosis = diagnose(left, right)
    assert not amber(diagnosis) & {*GEOMETRY, FindingCode.BENT_ROWS}
    assert covered(diagnosis, truth[np.isfinite(truth)] - 40) > 0.99
    assert likely_layout(np.hstack([left, right])) == (Layout.BESIDE, False)
    assert likely_layout(np.hstack([right, left])) == (Layout.BESIDE, True)


# Unrectified pairs: the model


def matched(left: np.ndarray, right: np.ndarray, shape: tuple[int, int] = SHAPE) -> Correspondences:
    inside = ((left >= 0) & (right >= 0) & (left < shape[::-1]) & (right < shape[::-1])).all(axis=1)
    return Correspondences(left[inside].astype(np.float32), right[inside].astype(np.float32), shape)


def scattered_points() -> Pair:
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


def test_a_fit_is_not_led_by_outliers() -> None:
    rng = np.random.default_rng(2)
    terms = np.column_stack([np.ones(200), rng.uniform(-1, 1, (200, 2))])
    values = terms @ [3.0, -2.0, 1.0] + rng.normal(0, 0.05, 200)
    values[:50] += rng.uniform(5, 50, 50)
    np.testing.assert_allclose(robust_fit(terms, values), [3.0, -2.0, 1.0], atol=0.05)


# Unrectified pairs: lenses and rotated cameras


@pytest.mark.parametrize(("name", "k1"), [("cube", -0.05), ("road", -0.3)])
def test_bent_rows_are_measured_and_straightened_into_the_corners(name: str, k1: float) -> None:
    left, right, disparity = bundled(name)
    views, true = (barrel(left, k1), barrel(right, k1)), true_matches(disparity, k1)
    diagnosis = diagnose(*views)
    bent = diagnosis.finding(FindingCode.BENT_ROWS)
    assert covered(diagnosis, -true.dx) > 0.998
    assert diagnosis.finding(FindingCode.SWAPPED).healthy
    assert bent.healthy == (k1 > -0.1)
    if not bent.healthy:
        assert bent.remedy is Remedy.RECTIFY
        assert bent.numbers["lens"] == pytest.approx(k1, abs=0.1)
        assert bent.numbers["spread_px"] == pytest.approx(float(np.std(true.dy)), rel=0.4)
        rectification = best_rectification(find_correspondences(*views))
        assert np.sqrt(np.mean(rectification.row_errors(true) ** 2)) < 0.35
        again = diagnose(*apply_remedy(*views, bent.remedy))
        assert not amber(again) & {FindingCode.BENT_ROWS, FindingCode.ROWS, FindingCode.SWAPPED}


def test_a_lens_is_removed_though_most_features_are_far_away_where_it_bends_nothing() -> None:
    rng = np.random.default_rng(0)
    far = np.column_stack([rng.uniform(200, 680, 500), rng.normal(190, 25, 500)])
    points = np.concatenate([far, rng.uniform((20, 200), (860, 390), (100, 2))])
    near = np.maximum(1.0, (points[:, 1] - 180) / 4) + rng.uniform(0, 6, 600)
    views = (points, points - np.column_stack([near, np.zeros(600)]))
    seen = [through_barrel(one, (400, 880), -0.3) + rng.normal(0, 0.15, one.shape) for one in views]
    found = best_rectification(matched(*seen, (400, 880)))
    assert found is not None and found.lens == pytest.approx(-0.3, abs=0.05)
    seen = [through_barrel(one, (400, 880), 1.5) + rng.normal(0, 0.15, one.shape) for one in views]
    assert best_rectification(matched(*seen, (400, 880))) is None  # no such lens is made


@pytest.mark.parametrize("order", [1, -1], ids=["right", "swapped"])
def test_turned_cameras_are_turned_back_and_their_sides_told(order: int) -> None:
    left, right, _ = bundled("cube")
    views = (turned_camera(left, (0.0, 0.05, 0.0)), turned_camera(right, (0.02, -0.03, 0.01)))[::order]
    diagnosis = diagnose(*views)
    assert diagnosis.finding(FindingCode.BENT_ROWS).remedy is Remedy.RECTIFY
    assert diagnosis.finding(FindingCode.ROWS).remedy is None  # one remedy for both
    sides = diagnosis.finding(FindingCode.SWAPPED)
    assert sides.numbers["known"]
    assert sides.healthy == (order == 1)
    if not sides.healthy:
        return
    again = diagnose(*apply_remedy(*views, Remedy.RECTIFY))
    assert not amber(again) & {FindingCode.ROWS, FindingCode.ROTATION, FindingCode.BENT_ROWS}


@pytest.mark.parametrize("degrees", [2, 8])
def test_a_camera_that_only_turned_is_told_and_nothing_else_of_its_geometry(degrees: int) -> None:
    left = bundled("road")[0]
    told = diagnose(left, turned_camera(left, (0.0, float(np.radians(degrees)), 0.0)))
    assert amber(told) == {FindingCode.ONE_MOVING_CAMERA} and told.suggested_range is None
    finding = told.finding(FindingCode.ONE_MOVING_CAMERA)
    assert finding.numbers["turned_deg"] == pytest.approx(degrees, abs=0.3) and finding.remedy is None


@pytest.mark.parametrize("lens", [0.0, -0.2])
def test_a_plane_and_a_scene_of_many_depths_are_not_seen_by_a_camera_that_only_turned(lens: float) -> None:
    left, right = scattered_points()
    turned = moved(left, turning(SHAPE, (0.01, 0.05, 0.0)))
    wall = left - (1, 0) * (6 + left @ (0.02, 0.01))[:, None]
    noise = np.random.default_rng(1).normal(0, 0.1, (2, *left.shape))
    first, *others = (
        through_barrel(one, SHAPE, lens) for one in (left, turned, wall, moved(right, turning(SHAPE, (0, 0.05, 0))))
    )
    seen = [pure_rotation_deg(matched(first + noise[0], other + noise[1])) for other in others]
    assert seen == [pytest.approx(np.degrees(np.hypot(0.01, 0.05)), abs=0.2), 0, 0]


def test_real_raw_pairs(data_dir: Path) -> None:
    folder = data_dir / "calibration" / "opencv_chessboard"
    left, right = (read_image(folder / f"{side}08.jpg") for side in ("left", "right"))
    diagnosis = diagnose(left, right)
    assert diagnosis.finding(FindingCode.MATCHES).numbers["count"] > 100
    bent = diagnosis.finding(FindingCode.BENT_ROWS)
    assert bent.remedy is Remedy.RECTIFY
    assert bent.numbers["rectified_px"] < 0.7
    assert diagnosis.finding(FindingCode.SWAPPED).healthy
    assert covered(diagnosis, np.arange(30, 145)) == 1


# Rows before and after a rectification by calibration


@pytest.mark.parametrize(
    ("given", "rectified", "already"),
    [
        (0.1, 3.0, True),
        (3.0, 0.1, False),
        (0.30, 0.35, False),
        (3.0, 9.0, True),
        (9.0, 12.0, False),
        (0.2, NAN, True),
        (3.0, NAN, False),
        (NAN, 0.2, False),
        (NAN, NAN, False),
    ],
)
def test_rows_are_evidence_where_they_differ(given: float, rectified: float, already: bool) -> None:
    assert RowEvidence(given, rectified, 50, 50).already_rectified is already


@pytest.mark.parametrize(("number", "late"), [(6, 5), (40, 4)])
def test_a_late_frame_of_a_drive_is_not_of_a_camera_that_only_turned(number: int, late: int, data_dir: Path) -> None:
    left, right = (sorted((data_dir / "sequences" / "kitti_seq1" / side).iterdir()) for side in ("left", "right"))
    diagnosis = diagnose(read_image(left[number]), read_image(right[number + late]))
    for code in (FindingCode.NOT_SAME_MOMENT, FindingCode.ONE_MOVING_CAMERA):
        finding = diagnosis.finding(code)
        assert finding is not None and not finding.healthy and "x" in finding.numbers


# The scale factor of an 8-bit ground truth


@pytest.mark.parametrize("divisor", DIVISORS)
def test_the_divisor_is_told_wherever_the_truth_fits_into_8_bits(divisor: int) -> None:
    left, right, truth = bundled("cube")
    # Divisors as large as Tsukuba's 16 are for small images.
    factor = min(1.0, 255 / (divisor * float(np.nanmax(truth))))
    values = np.rint(scaled_disparity(truth.astype(np.float32), factor) * divisor)
    stored = np.where(values == 0, np.nan, values).astype(np.float32)
    assert truth_fit(stored, scaled_image(left, factor), scaled_image(right, factor)).divisor == divisor


@pytest.mark.parametrize("name", ["tsukuba", "teddy", "cones", "aloe_half"])
def test_the_divisor_is_the_one_its_makers_name(name: str, data_dir: Path) -> None:
    folder = data_dir / "stereo" / name
    left, right, truth = (next(folder.glob(f"{stem}.*")) for stem in ("left", "right", "gt"))
    meant = json.loads((folder / "calib.json").read_text(encoding="utf-8"))["disparity_divisor"]
    assert truth_fit(read_disparity(truth, divisor=1), read_image(left), read_image(right)).divisor == meant


@pytest.mark.parametrize("side", [4, 40])
def test_the_divisor_is_the_smallest_where_nothing_tells(side: int) -> None:
    flat = np.zeros((side, side), np.uint8)
    assert truth_fit(np.full((side, side), 40.0), flat, flat).divisor == DIVISORS[0]


@pytest.mark.parametrize("number", [1, 12])
def test_wrong_matches_in_a_sky_do_not_begin_the_range_beyond_infinity(number: int) -> None:
    (drive,) = drives().values()
    found = diagnose(read_image(drive.left[number]), read_image(drive.right[number]))
    assert found.suggested_range == (0, 64)
    assert all(finding.healthy for finding in found.findings)


@pytest.mark.parametrize("kinds", [2, 256], ids=["many equal", "few equal"])
@pytest.mark.parametrize(("left", "right"), [(70, 90), (1, 40), (33, 1)])
def test_binary_descriptors_are_matched_as_by_opencv(left: int, right: int, kinds: int) -> None:
    """The first of equally near ones counts, and a match is one only if both prefer each other."""
    random = np.random.default_rng(left + right)
    codes = [random.integers(0, kinds, (count, 32)).astype(np.uint8) for count in (left, right)]
    codes[1][: min(left, right) // 2] = codes[0][: min(left, right) // 2]
    codes[1][-5:] = codes[1][0]
    indices, distances = mutual_matches(codes[0], codes[1])
    expected = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(codes[0], codes[1])
    assert indices.T.tolist() == [[one.queryIdx, one.trainIdx] for one in expected]
    assert distances.tolist() == [one.distance for one in expected]
