"""A template followed through frames: where it is, and when it cannot be told."""

import math

import cv2
import numpy as np
import pytest
from moving_patch import AWAY, COVERED, PARTLY, frames, on, sign
from pairs import texture

from stereolag.core.arrays import EightBit
from stereolag.core.searches import TemplateMethod, TemplateQuery
from stereolag.templates.following import Followed, Follower

SIDE = 40


def photographed(picture: EightBit) -> EightBit:
    """Return a frame as it comes over the wire."""
    return np.asarray(cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1], 1))


def ground() -> EightBit:
    """Return a picture with nothing in it."""
    return np.dstack([texture(240, 320, seed=one, blur=2.0) for one in range(3)])


def cut(picture: EightBit, middle: tuple[float, float], side: int = SIDE) -> Follower:
    row, col = (round(at - side / 2) for at in middle)
    return Follower(picture[row : row + side, col : col + side].copy(), row + side / 2, col + side / 2)


def test_two_hundred_frames_and_never_at_a_wrong_place() -> None:
    first, *others = frames(1)
    follower = cut(photographed(first.picture), first.middle)
    told: list[Followed] = []
    for frame in others:
        followed = follower.follow(photographed(frame.picture), TemplateQuery())
        told.append(followed)
        if followed.place is not None:
            assert math.dist((followed.place.row, followed.place.col), frame.middle) < 1.5
            assert frame.seen > 0.3
            assert followed.state != "found" or followed.place.scale == pytest.approx(frame.size, abs=0.02)
    states = [None, *(followed.state for followed in told)]
    assert {states[number] for number in COVERED} == {"lost"}
    assert {states[number] for number in PARTLY} == {"partly_seen"}
    outside = [number for number in AWAY if others[number - 1].seen == 0]
    assert {states[number] for number in outside} == {"lost"}
    whole = [states[number] for number in range(1, 200) if number not in (*COVERED, *AWAY, *PARTLY)]
    assert whole.count("found") > 0.9 * len(whole)
    assert whole.count("lost") <= 2
    assert all(followed.near for followed in told[: COVERED[0] - 1])


def test_one_that_turns_and_grows_is_kept_up_with() -> None:
    follower = None
    for number in range(41):
        picture, size, angle = ground(), 1 + 0.01 * number, 1.5 * number
        on(picture, sign(SIDE, 3), (120, 160 + number), size, angle)
        picture = photographed(picture)
        follower = follower or cut(picture, (120, 160))
        followed = follower.follow(picture, TemplateQuery())
        assert followed.state == "found" and followed.place is not None
        assert followed.place.scale == pytest.approx(size, abs=0.02)
        assert followed.place.rotation == pytest.approx(angle, abs=1)


def test_of_two_alike_the_one_on_the_path_is_followed_until_it_is_lost() -> None:
    both, none = ground(), ground()
    for col in (120, 160):
        on(both, sign(SIDE, 3), (120, col), 1.0)
    grain = np.random.default_rng(0).integers(0, 12, both.shape, dtype=np.uint8)
    follower = cut(both, (120, 120))
    both = np.maximum(both, grain) - grain
    followed = follower.follow(both, TemplateQuery())
    assert followed.state == "look_alikes" and followed.place is not None
    assert (followed.place.row, followed.place.col) == pytest.approx((120, 120), abs=0.2)
    assert follower.follow(none, TemplateQuery()).state == "lost"
    followed = follower.follow(both, TemplateQuery())
    assert (followed.state, followed.place) == ("look_alikes", None)


@pytest.mark.parametrize("seed", [5, 13])
def test_a_sibling_that_covers_it_is_not_followed(seed: int) -> None:
    first = ground()
    on(first, sign(SIDE, seed), (120, 160), 1.0)
    follower = cut(photographed(first), (120, 160))
    for col in range(200, 120, -5):
        picture = first.copy()
        on(picture, sign(SIDE, seed, sibling=True), (120, col), 1.0)
        followed = follower.follow(photographed(picture), TemplateQuery())
        assert followed.place is None or followed.place.col == pytest.approx(160, abs=1)


def test_one_that_comes_back_larger_is_found_at_the_sizes_asked_for() -> None:
    small, large = ground(), ground()
    on(small, sign(SIDE, 3), (80, 100), 1.0)
    on(large, sign(SIDE, 3), (150, 200), 1.3)
    follower = cut(small, (80, 100))
    query = TemplateQuery(max_scale=1.35)
    assert "found" not in {follower.follow(large, TemplateQuery()).state for _ in range(6)}
    assert "found" in {follower.follow(large, query).state for _ in range(8)}


def test_sampled_compares_exact_pixels() -> None:
    frame = next(iter(frames(2, noise=0)))
    follower = cut(frame.picture, frame.middle)
    assert follower.follow(frame.picture, TemplateQuery(method="sampled")).state == "found"
    assert follower.follow(photographed(frame.picture), TemplateQuery(method="sampled")).state == "lost"


@pytest.mark.parametrize("method", ("fft", "sampled"))
def test_in_a_frame_smaller_than_the_template_it_is_lost(method: TemplateMethod) -> None:
    first = next(frames(1))
    follower = cut(first.picture, first.middle)
    assert follower.follow(ground()[: SIDE - 1], TemplateQuery(method=method)).state == "lost"
