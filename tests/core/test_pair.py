"""A stereo pair: its files fitted to each other, its preparation step by step, and the keys that identify it."""

import io
import json
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from pairs import bundled
from straight_and_raw import ENTRIES, P1, RECTIFYING, T, raw_pair, straight_pair

import stereolag as sl
from stereolag.assess.findings import Remedy
from stereolag.geometry.calibration import Calibration
from stereolag.io.arrays import npy
from stereolag.io.disparities import pfm, read_stored_disparity
from stereolag.io.ground_truth import halved_truth, truth_in_px
from stereolag.io.images import image_png, image_tiff
from stereolag.io.settings import settings_json
from stereolag.pair import ONE_DEPTH, Pair, PairId, Preparation, Rows, assemble_pair, prepare, resized
from stereolag.pair_sources import NO_PAIRS, PairSet, read_bundle, session_pair
from tests.archives import zipped

ID = PairId("images")
LEFT = np.random.default_rng(0).integers(0, 255, (120, 200, 3), dtype=np.uint8)
TRUTH = np.full((120, 200), 5.0, np.float32)
CALIBRATION = Calibration(400.0, 0.2, doffs_px=10.0, width=400, height=240, num_disparities=64)


def both_cameras(**more: Any) -> Calibration:
    entries = {name: np.asarray(value).tolist() for name, value in (ENTRIES | more).items()}
    return sl.read_calibration(io.BytesIO(json.dumps(entries).encode()))


def test_every_key_tells_apart_what_it_is_for() -> None:
    pair = PairId("images", "truth")
    later = replace(pair, size="1/2", rectification="rectified", remedies=(Remedy.SWAP_SIDES,))
    assert later.exact == "images truth 1/2 rectified swap_sides"
    assert later.untreated == "images truth 1/2 rectified"
    assert (later.files, later.searched, later.chosen) == ("images truth", "images 1/2", "images")
    assert later.judged == later.exact
    of_set = replace(later, collection="set")
    assert (of_set.judged, of_set.chosen, of_set.exact) == ("set 1/2", "set", later.exact)


def test_images_truth_and_calibration_are_made_to_fit() -> None:
    pair = assemble_pair(LEFT, LEFT[:-1, :-1], TRUTH, CALIBRATION, id=ID, notes=["Split."])
    assert pair.left.shape == pair.right.shape == (119, 199, 3)
    assert pair.truth is not None and pair.truth.shape == (119, 199)
    assert pair.calibration.focal_px == pytest.approx(400 * 199 / 400)
    assert (pair.num_disparities, pair.min_disparity) == (pair.calibration.num_disparities, 0)
    assert [change.sentence for change in pair.changes] == [
        "Split.",
        "The images differ by a few pixels and were cropped to 199 × 119. If one lacks columns on its left, every "
        "disparity and every distance is wrong.",
        "The calibration was scaled to 199 × 119 pixels.",
    ]
    as_given = assemble_pair(LEFT, LEFT, TRUTH, replace(CALIBRATION, width=200, height=120), id=ID)
    assert as_given.changes == ()


def test_16_bits_beside_8_are_brought_to_one_range() -> None:
    grey = LEFT[:, :, 0]
    pair = assemble_pair(grey.astype(np.uint16) * 16, grey, id=ID)
    assert pair.left.dtype == pair.right.dtype == np.uint16
    assert np.abs(pair.left.astype(float) - pair.right).max() <= 257
    assert [change.sentence for change in pair.changes] == [ONE_DEPTH]


@pytest.mark.parametrize(
    ("right", "more", "sentence"),
    [
        (LEFT[:-20], {}, "give or take 3 %"),
        (LEFT, {"truth": TRUTH[:50]}, "The ground truth is 200 × 50 and the left image is 200 × 120 pixels"),
        (LEFT, {"calibration": replace(CALIBRATION, height=400)}, "The calibration is for 400 × 400"),
        (LEFT.astype(np.float32), {}, "pixels"),
    ],
)
def test_parts_that_do_not_belong_together_are_refused(right: Any, more: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        assemble_pair(LEFT, right, **more, id=ID)


TRUE_PX = np.where(np.arange(60)[:, None] < 20, np.float32(12.25), np.float32(24.5)) + np.zeros((1, 160), np.float32)
"""Px; the disparities of a board before a wall."""


def sintel_png(disparity: np.ndarray) -> bytes:
    whole = np.rint(disparity * 16384).astype(np.int64)
    return image_png(np.dstack([whole >> 16, whole >> 8 & 255, whole & 255]).astype(np.uint8))


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (image_png(np.rint(TRUE_PX * 4).astype(np.uint8)), "8 bits: ÷ 4 agrees best with a quick map."),
        (npy(np.where(np.eye(60, 160) > 0, -1, TRUE_PX) * 16), "16 times too large"),
        (npy((np.where(np.eye(60, 160) > 0, -1, TRUE_PX) * 16).astype(np.int16)), ""),
        (image_png(np.rint(TRUE_PX * 16).astype(np.uint16)), "16 times too small"),
        (image_png(np.rint(TRUE_PX * 64).astype(np.uint16)), "4 times too small"),
        (image_png(np.rint(TRUE_PX * 100).astype(np.uint16)), "2.56 times too small"),
        (image_png(np.rint(TRUE_PX * 256).astype(np.uint16)), ""),
        (pfm(-TRUE_PX), "opposite in sign"),
        (pfm(np.where(np.eye(60, 160) > 0, -9999, TRUE_PX)), ""),
        (npy(np.where(np.eye(60, 160) > 0, np.nan, TRUE_PX)), ""),
        (image_tiff(np.where(np.eye(60, 160) > 0, -32768, TRUE_PX)), ""),
        (sintel_png(TRUE_PX), ""),
        (pfm(np.repeat(np.repeat(TRUE_PX, 2, axis=0), 2, axis=1)), ""),
    ],
)
def test_the_ground_truth_of_other_programs_is_read_as_it_fits_the_pair(data: bytes, says: str) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (60, 220), dtype=np.uint8)
    noise = cv2.GaussianBlur(noise, (0, 0), 0.8)
    left = noise[:, :160]
    right = np.where(np.arange(60)[:, None] < 20, noise[:, 12:172], noise[:, 24:184]).astype(np.uint8)
    stored = read_stored_disparity(data)
    truth, said = truth_in_px(stored, left, right)
    known = np.isfinite(truth)
    assert known.mean() > 0.98
    np.testing.assert_allclose(truth[known], TRUE_PX[known], atol=0.04)
    assert (says in said) if says else said == ""
    divisor = stored.divisor or 4  # 8 bits do not say which
    own, said = truth_in_px(stored, left, right, divisor)
    assert said == ""
    np.testing.assert_array_equal(own[known], halved_truth(stored.divided(divisor), left.shape)[known])


def test_depth_is_no_ground_truth_and_one_that_hardly_agrees_is_doubted() -> None:
    left, right, truth = bundled("cube")
    for depth in (15.3 / truth, np.rint(15_300 / truth).astype(np.uint16)):
        with pytest.raises(ValueError, match="looks like depth, not disparity"):
            truth_in_px(read_stored_disparity(npy(depth)), left, right)
    other = read_stored_disparity(pfm(np.roll(truth, 150, axis=0)))
    assert "agrees with a quick map at " in truth_in_px(other, left, right)[1]
    assert truth_in_px(other, left, right, 1.0)[1] == ""


def test_size_divides_all_that_is_known_and_by_itself_leaves_a_megapixel() -> None:
    pair = assemble_pair(LEFT, LEFT, TRUTH, CALIBRATION, id=ID)
    pair = replace(pair, min_disparity=-3, visible=np.ones((120, 200), np.bool_))
    small = prepare(pair, Preparation(divisor=2))
    assert small.left.shape == small.right.shape == (60, 100, 3)
    assert np.unique(small.truth) == 2.5
    assert small.visible.shape == (60, 100)
    assert small.calibration.focal_px == 100
    assert (small.min_disparity, small.num_disparities) == (-2, 17)  # -3 to 28 px before, 32 of them
    assert (small.id.size, small.full) == ("1/2", pair)
    assert small.changes[-1].sentence == "Shown at 1/2 of its size: 100 × 60 of 200 × 120 pixels."
    assert prepare(pair, Preparation()) is pair
    large = np.zeros((1200, 2000), np.uint8)
    assert resized(Pair(large, large, ID), None).left.shape == (600, 1000)
    assert resized(Pair(LEFT, LEFT, ID), None).left is LEFT


MIDDLE = slice(60, -60), slice(60, -60)


@pytest.mark.parametrize(
    ("images", "rows", "done", "said"),
    [
        (raw_pair(), Rows.DECIDE, True, "The pair was undistorted and rectified with its calibration: rows differ by"),
        (raw_pair(), Rows.RECTIFIED, False, "The pair is rectified already, as you said: rows differ by"),
        (straight_pair(), Rows.DECIDE, False, "The pair is rectified already: rows differ by 0.0"),
        (straight_pair(), Rows.RAW, True, "with its calibration, as you said: rows differ by "),
    ],
)
def test_a_pair_is_rectified_if_it_is_raw_or_said_to_be(images: Any, rows: Rows, done: bool, said: str) -> None:
    truth = np.zeros(images[0].shape, np.float32)
    pair = prepare(assemble_pair(*images, truth, both_cameras(), id=ID), Preparation(rows=rows))
    assert pair.rectification.done == done != np.array_equal(pair.left, images[0])
    assert (pair.truth is None) == done == bool(pair.id.rectification)
    assert said in pair.changes[-1].sentence
    assert ("Its ground truth belongs to the image before that" in pair.changes[-1].sentence) == done
    assert pair.calibration is not None and pair.calibration.rig is None
    assert pair.calibration.baseline_m == pytest.approx(np.linalg.norm(T))
    if done and rows is Rows.DECIDE:
        assert np.abs(pair.left[MIDDLE].astype(float) - straight_pair()[0][MIDDLE]).mean() < 3


def test_the_frame_is_a_choice_unless_the_calibration_has_it() -> None:
    def at(alpha: float, **more: Any) -> Pair:
        return prepare(assemble_pair(*raw_pair(), None, both_cameras(**more), id=ID), Preparation(alpha=alpha))

    whole, inner = at(1.0), at(0.0)
    assert (whole.left == 0).mean() > (inner.left == 0).mean()
    assert whole.calibration is not None and whole.id != inner.id
    told = at(1.0, **RECTIFYING)
    assert told.calibration.focal_px == pytest.approx(P1[0, 0])


@pytest.mark.parametrize(
    ("remedy", "lost"),
    [
        (Remedy.SWAP_SIDES, {"truth", "visible"}),
        (Remedy.LEVEL, {"calibration"}),
        (Remedy.ALIGN_ROWS, set()),
        (Remedy.MATCH_EXPOSURE, set()),
    ],
)
def test_a_remedy_drops_only_what_no_longer_holds(remedy: Remedy, lost: set[str]) -> None:
    left, right = straight_pair()
    known = {"truth": np.ones(left.shape, np.float32), "visible": np.ones(left.shape, np.bool_)}
    pair = Pair(left, right, ID, calibration=Calibration(100.0, 0.1), **known)  # type: ignore[arg-type]
    treated = prepare(pair, Preparation(remedies=(remedy,)))
    assert {name for name in (*known, "calibration") if getattr(treated, name) is None} == lost
    assert treated.id.remedies == (remedy,)
    assert [change.code for change in treated.remedies] == [remedy]
    assert ("The ground truth belongs to the other image" in treated.changes[-1].sentence) == ("truth" in lost)


def test_a_step_that_is_not_possible_is_raised_or_skipped() -> None:
    calibration = both_cameras()
    pair = Pair(LEFT, LEFT, ID, calibration=calibration)  # of another aspect ratio
    remedies = Preparation(remedies=(Remedy.ALIGN_ROWS,))
    with pytest.raises(ValueError, match="the cameras were calibrated at 320 × 240"):
        prepare(pair, remedies)
    refusals: list[ValueError] = []
    left = prepare(replace(pair, right=np.zeros_like(LEFT)), remedies, refused=refusals.append)
    assert len(refusals) == 2
    assert (left.left is LEFT, left.calibration, left.changes) == (True, None, ())


def test_a_step_taken_before_comes_from_memory_with_the_newest_calibration() -> None:
    kept: dict[tuple[str, str, str], Any] = {}

    def memo(step: str, make: Any, pair: Pair, settings: str) -> Any:
        key = step, pair.digest, settings
        if key not in kept:
            kept[key] = make()
        return kept[key]

    pair = assemble_pair(LEFT, LEFT, TRUTH, id=ID)
    first = prepare(pair, Preparation(divisor=2), memo=memo)
    later = prepare(replace(pair, calibration=Calibration(300.0, 0.1)), Preparation(divisor=2), memo=memo)
    assert later.left is first.left
    assert later.calibration is not None and later.calibration.focal_px == 150
    assert [step for step, _, _ in kept] == ["resized pair"]


SIDES = {"a/left1.png": image_png(LEFT), "a/right1.png": image_png(LEFT)}


def test_pairs_in_an_archive_are_decoded_one_by_one() -> None:
    wrong = {"a/left2.png": b"nothing", "a/right2.png": b"nothing", "a/calib1.txt": b"nothing"}
    pairs = read_bundle([("pairs.zip", zipped(SIDES | wrong | {"a/disp1.pfm": pfm(TRUTH)}))])
    assert isinstance(pairs, PairSet)
    assert (len(pairs), pairs.name(0)) == (2, "1")
    pair = pairs.pair(0)
    np.testing.assert_array_equal(pair.left, LEFT)
    np.testing.assert_array_equal(pair.truth, TRUTH)  # type: ignore[arg-type]
    assert (pair.id.collection, pair.description) == (pairs.digest, "Pair “1”.")
    assert pair.changes[0].sentence.startswith("The pair’s calibration is not used. ")
    assert pairs.pair(0).id == pair.id
    with pytest.raises(ValueError, match=r"^Pair 2: This is not an image"):
        pairs.pair(1)
    with pytest.raises(ValueError, match=NO_PAIRS[:30]):
        read_bundle([("pairs.zip", zipped({"a.png": b"", "b.png": b""}))])


@pytest.mark.parametrize(("known", "found"), [({}, (-4, 32)), ({"num_disparities": 48, "min_disparity": 1}, (1, 48))])
def test_a_session_says_its_range_or_has_it_from_its_settings(known: dict[str, int], found: tuple[int, int]) -> None:
    names = {"left": "a/left1.png", "right": "a/right1.png"}
    document = {
        "pair": {"files": names, "history": ["It was rectified."]} | known,
        "methods": [json.loads(settings_json(sl.StereoBM(num_disparities=32, min_disparity=-4)))],
    }
    session = read_bundle([("pairs.zip", zipped(SIDES | {"session.json": json.dumps(document).encode()}))])
    assert not isinstance(session, PairSet)
    pair = session_pair(session, "digest")
    np.testing.assert_array_equal(pair.right, LEFT)
    assert (pair.min_disparity, pair.num_disparities) == found
    assert (pair.description, [one.sentence for one in pair.changes]) == ("Your own pair.", ["It was rectified."])
