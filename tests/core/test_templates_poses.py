"""Templates that are smaller, larger or rotated in the image: size, angle and place are recovered."""

import math
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw, ImageFont

from benchmarks.searches import drawn
from stereolag.core.arrays import Array, EightBit
from stereolag.core.searches import TemplateQuery
from stereolag.core.settings import Bounds
from stereolag.templates import estimate_search, match_template
from stereolag.templates.patterns import pattern_of, warped, warped_shape
from stereolag.templates.poses import ROTATION_STEP, SCALE_STEP, PoseRange


def blobs(shape: tuple[int, ...], seed: int = 0) -> Array:
    """Return a smooth texture that can be resampled with little loss."""
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=shape).astype(np.float32), (0, 0), 3)
    return (255 * (noise - noise.min()) / np.ptp(noise)).astype(np.uint8)


def sprite() -> Array:
    """Return an ellipse of 40 × 50 px with alpha."""
    rows, cols = np.mgrid[:40, :50]
    opaque = ((rows - 19.5) / 20) ** 2 + ((cols - 24.5) / 25) ** 2 <= 1
    return np.dstack([blobs((40, 50, 3), 5), 255 * opaque.astype(np.uint8)])


@pytest.mark.parametrize(
    ("dtype", "scale", "rotation"), [(np.uint8, 0.75, 0.0), (np.uint16, 1.0, 25.0), (np.float32, 1.3, -17.0)]
)
def test_size_angle_and_place_are_recovered(dtype: type, scale: float, rotation: float) -> None:
    template = sprite()
    scene = drawn(blobs((130, 150, 3)), template, 70.0, 65.0, scale, rotation).astype(dtype)
    sizes, angles = (scale / 1.15, scale * 1.2), (rotation - 8, rotation + 12)
    search = match_template(scene, template.astype(dtype), scales=sizes, rotations=angles)
    (match,) = search.matches
    assert search.found
    assert match.scale == pytest.approx(scale, rel=0.03)
    assert match.rotation == pytest.approx(rotation, abs=2)
    assert (match.height, match.width) == warped_shape((40, 50), match.scale, match.rotation)
    assert match.row + match.height / 2 == pytest.approx(70, abs=2)
    assert match.col + match.width / 2 == pytest.approx(65, abs=2)
    assert match.score > 0.95


def test_a_positive_angle_is_counter_clockwise_as_seen() -> None:
    scene, template = blobs((110, 120)), blobs((40, 40), seed=1)
    scene[50:90, 60:100] = np.rot90(template)  # its top now points left
    search = match_template(scene, template, rotations=(60, 120))
    (match,) = search.matches
    assert match.rotation == pytest.approx(90, abs=1)
    assert (match.row, match.col) == (50, 60)


def test_its_own_size_and_angle_are_found_exactly() -> None:
    scene = blobs((110, 130, 3))
    (match,) = match_template(scene, scene[31:71, 53:103], scales=(0.8, 1.2), rotations=(-10, 12)).matches
    assert (match.row, match.col, match.height, match.width) == (31, 53, 40, 50)
    assert (match.scale, match.rotation) == (1.0, 0.0)
    assert match.score == pytest.approx(1, abs=1e-6)


def test_grey_and_a_mask() -> None:
    scene = blobs((200, 240))
    template = cv2.resize(scene[60:120, 80:140], (40, 40), interpolation=cv2.INTER_AREA)
    mask = np.ones((40, 40), np.uint8)
    template[:10] = 0
    mask[:10] = 0
    (match,) = match_template(scene, template, mask=mask, scales=(1, 2)).matches
    assert match.scale == pytest.approx(1.5, rel=0.02)
    assert match.rotation == 0
    assert abs(match.row - 60) <= 1
    assert abs(match.col - 80) <= 1


@pytest.mark.parametrize("seed", range(3))
def test_the_size_of_one_between_the_pixels_is_recovered(seed: int) -> None:
    """On whole pixels a small one would score best a few percent too large or too small."""
    random, template = np.random.default_rng(seed), sprite()
    scale, (row, col) = float(random.uniform(0.3, 0.5)), random.uniform(40, 41, 2)
    scene = drawn(blobs((90, 90, 3)), template, float(row), float(col), scale, 0.0)
    (match,) = match_template(scene, template, scales=(0.25, 0.6)).matches
    assert match.scale == pytest.approx(scale, rel=0.01)
    assert match.rotation == 0


@pytest.mark.parametrize("seed", range(2))
def test_around_a_full_circle_no_angle_is_an_end(seed: int) -> None:
    template, rotation = sprite(), float(np.random.default_rng(seed).uniform(172, 179))
    scene = drawn(blobs((120, 140, 3)), template, 60.0, 70.0, 1.0, rotation)
    (match,) = match_template(scene, template, rotations=(-180, 180)).matches
    assert match.rotation == pytest.approx(rotation, abs=2)


def test_wide_copies_side_by_side_are_all_found_in_any_direction() -> None:
    template = np.dstack([blobs((16, 100, 3), 7), np.full((16, 100), 255, dtype=np.uint8)])
    turn, down, right = -35.0, math.cos(math.radians(35)), math.sin(math.radians(35))
    centres = [(150 + 17 * step * down, 150 - 17 * step * right) for step in range(-2, 3)]
    scene = blobs((300, 300, 3))
    for row, col in centres:
        scene = drawn(scene, template, row, col, 1.0, turn)
    search = match_template(scene, template, rotations=(-45, -25), max_matches=9)
    found = [(match.row + match.height / 2, match.col + match.width / 2) for match in search.matches]
    assert all(min(math.dist(centre, middle) for middle in found) < 2 for centre in centres)


def test_a_template_larger_than_the_image_may_lie_in_it_smaller() -> None:
    large = blobs((160, 200), seed=3)
    scene = blobs((120, 150))
    scene[20:100, 30:130] = cv2.resize(large, (100, 80), interpolation=cv2.INTER_AREA)
    (match,) = match_template(scene, large, scales=(0.4, 0.7)).matches
    assert match.scale == pytest.approx(0.5, rel=0.02)
    with pytest.raises(ValueError, match=r"must fit into the image at 0\.8 of its size"):
        match_template(scene, large, scales=(0.8, 1.0))


def test_a_constant_image_holds_no_size_of_it() -> None:
    search = match_template(np.full((90, 90), 7, np.uint8), blobs((30, 30)), scales=(0.8, 1.2))
    assert (search.found, search.matches, search.best) == (False, [], None)


@given(st.floats(0.1, 3), st.floats(1, 3), st.floats(-180, 170), st.floats(0, 10))
def test_the_grid_holds_both_ends_and_no_larger_steps(low: float, ratio: float, first: float, reach: float) -> None:
    grid = PoseRange((low, low * ratio), (first, first + reach)).grid((30, 30))
    scales, rotations = (sorted({round(pose[axis], 9) for pose in grid}) for axis in (0, 1))
    assert scales[0] == pytest.approx(low)
    assert scales[-1] == pytest.approx(low * ratio)
    assert rotations[0] == pytest.approx(first, abs=1e-6)
    assert rotations[-1] == pytest.approx(first + reach, abs=1e-6)
    assert all(b / a <= SCALE_STEP + 1e-6 for a, b in pairwise(scales))
    assert all(b - a <= ROTATION_STEP + 1e-6 for a, b in pairwise(rotations))


def test_hidden_pixels_do_not_bleed_into_a_warped_template() -> None:
    colours = np.full((30, 30, 1), 255, dtype=np.uint8)
    colours[8:22, 8:22, 0] = blobs((14, 14)) // 2
    opaque = np.zeros((30, 30), dtype=np.bool_)
    opaque[8:22, 8:22] = True
    pattern = warped(pattern_of(colours, opaque), 0.7, 20)
    assert pattern.colours[pattern.opaque].max() <= 128
    area = 14 * 14 * 0.7**2
    assert 0.6 * area < pattern.count < area


def test_a_warped_box_holds_the_template() -> None:
    assert warped_shape((40, 50), 1, 0) == (40, 50)
    assert warped_shape((40, 50), 1, 90) == (50, 40)
    assert warped_shape((40, 50), 2, 0) == (80, 100)
    assert warped_shape((40, 40), 1, 45) == (math.ceil(40 * math.sqrt(2)),) * 2


def test_progress_rises_to_one_in_small_steps_and_cancels_if_it_raises() -> None:
    fractions: list[float] = []
    scene = blobs((80, 90, 3))
    ranges = {"scales": (0.8, 1.2), "rotations": (-10, 10)}
    match_template(scene, scene[30:70, 40:80], **ranges, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1
    assert max(np.diff([0.0, *fractions])) < 0.25

    def cancel(fraction: float) -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        match_template(scene, scene[30:70, 40:80], **ranges, progress=cancel)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"scales": (1.2, 0.8)},
            r"scales is \(1\.2, 0\.8\); allowed are a smallest and a largest number from 0\.1 to 10",
        ),
        ({"scales": (0, 1)}, r"scales is \(0, 1\)"),
        ({"scales": (1, math.nan)}, r"scales is \(1, nan\)"),
        ({"rotations": (-200, 0)}, r"rotations is \(-200, 0\); .* from -180 to 180"),
        ({"scales": (0.5, 1, 2)}, r"scales is \(0\.5, 1, 2\); allowed are a smallest and a largest number"),
        ({"rotations": 2.0}, r"rotations is 2\.0; allowed are a smallest and a largest number"),
        ({"rotations": (0, 10), "method": "sampled"}, r"method is 'sampled'; sizes and angles are searched by 'fft'"),
    ],
)
def test_bad_ranges_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        match_template(blobs((90, 90)), blobs((30, 30), seed=1), **arguments)


def test_settings_become_arguments() -> None:
    assert TemplateQuery().arguments["scales"] is TemplateQuery().arguments["rotations"] is None
    query = TemplateQuery(min_scale=0.7, max_rotation=30)
    assert (query.arguments["scales"], query.arguments["rotations"]) == ((0.7, 1.0), (-30.0, 30.0))
    with pytest.raises(ValueError, match=r"min_scale is 0\.7 and needs method 'fft'"):
        TemplateQuery(method="sampled", min_scale=0.7)


@pytest.mark.parametrize("name", TemplateQuery.model_fields)
def test_every_setting_changes_the_arguments(name: str) -> None:
    bounds = Bounds.of(TemplateQuery.model_fields[name])
    for value in ("sampled", bounds.low, bounds.high, 2):
        with suppress(ValueError):
            if TemplateQuery(**{name: value}).arguments != TemplateQuery().arguments:
                return
    pytest.fail(f"no value of {name} changes what the search is called with")


def test_more_sizes_and_angles_take_longer() -> None:
    shapes = (1500, 2400, 3), (120, 110, 4)
    some = estimate_search(*shapes, scales=(0.9, 1.1))
    many = estimate_search(*shapes, scales=(0.9, 1.1), rotations=(-90, 90))
    assert some.seconds < many.seconds


WORDS = ("Account", "Discount", "Connect", "Refresh", "Sensor", "Invoice", "103.07")


def words(size: float, named: Sequence[str] = WORDS) -> EightBit:
    """Return words below one another at so much of their size, with what a font rounds at each size."""
    picture = Image.new("RGB", (round(220 * size), round(30 * size * len(named) + 20)), (252, 252, 252))
    for number, word in enumerate(named):
        at = round(30 * size), round((12 + 30 * number) * size)
        ImageDraw.Draw(picture).text(at, word, fill=(40, 40, 40), font=ImageFont.load_default(14 * size))
    return np.asarray(picture)


def row_of(number: int) -> slice:
    """Return the rows of a word at its own size, and a little around it."""
    return slice(8 + 30 * number, 32 + 30 * number)


@pytest.mark.parametrize(("number", "size"), [(0, 1.25), (6, 1.1)])
def test_a_word_with_another_letter_is_not_found_when_drawn_anew_at_another_size(number: int, size: float) -> None:
    exchanged = list(WORDS)
    exchanged[number] = WORDS[number][:3] + "g" + WORDS[number][4:]
    assert not match_template(words(size, exchanged), words(1.0)[row_of(number), 26:100], scales=(0.9, 1.6)).found


LISTED = ("Madrid", "Tokyo", "Oslo", "Engine", "Brake", "Voltage", "Current", "Pressure")


@pytest.mark.parametrize(
    ("named", "word", "size"), [(LISTED, "Current", 1.1), (WORDS, "Account", 1.25), (WORDS, "103.07", 1.33)]
)
def test_a_word_drawn_anew_is_found_though_its_letters_move_and_others_score_higher(named, word, size):
    number = named.index(word)
    template = words(1.0, named)[row_of(number), 26 : 80 if word == "103.07" else 100]
    search = match_template(words(size, named), template, scales=(0.9, 1.6))
    assert search.found
    assert search.best.row + search.best.height / 2 == pytest.approx((20 + 30 * number) * size, abs=2.5)
    assert search.best.scale == pytest.approx(size, rel=0.07)
    assert word != "103.07" or search.best.col == pytest.approx(26 * size, abs=1)


def test_what_the_rim_cuts_off_of_the_line_above_is_not_of_the_word() -> None:
    named = tuple(word for pair in zip(("Gallery",) * 3, WORDS, strict=False) for word in pair)
    row, size = 12 + 30, 1.33
    template = np.vstack([words(1.0, named)[27:30, 26:100], words(1.0, named)[row - 1 : row + 18, 26:100]])
    assert match_template(words(size, named), template, scales=(0.9, 1.6)).found
