"""Which place is the template: leads over rivals and variants, and what survives damage, by OpenCV too."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from stereolag import read_image, samples
from stereolag.core.arrays import Array
from stereolag.core.inputs import Image
from stereolag.templates import TemplateMethod, match_template
from stereolag.templates.places import Places
from stereolag.templates.trials import Degradation, DegradedPart, degraded_part, is_masked, opencv_search, try_methods
from stereolag.templates.verdict import leads

EXAMPLE = samples.mazes()["maze"]
MAZE, ROCKETMAN = read_image(EXAMPLE.picture), read_image(EXAMPLE.template)
METHODS: tuple[TemplateMethod, ...] = ("fft", "sampled")


def smooth_noise(shape: tuple[int, ...], seed: int = 0) -> Array:
    noise = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), 2.0))


def discs(seed: int) -> Array:
    """Return discs of any brightness on a grainy ground."""
    random = np.random.default_rng(seed)
    drawn = random.normal(90, 8, (150, 200))
    for _ in range(30):
        col, row, radius = (int(one) for one in random.integers((0, 0, 4), (200, 150, 22)))
        cv2.circle(drawn, (col, row), radius, float(random.uniform(20, 240)), -1)
    return np.clip(cv2.GaussianBlur(drawn, (0, 0), 0.7), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("side", "seed"), [(5, 1), (6, 0), (8, 20)])
def test_a_few_pixels_are_not_found_where_another_place_fits_better(side: int, seed: int) -> None:
    picture, square = discs(seed + 100), np.ones((3, 3), np.uint8)
    steep = cv2.subtract(cv2.dilate(picture, square), cv2.erode(picture, square))[20:-20, 20:-20]
    row, col = (int(one) + 20 - side // 2 for one in np.unravel_index(steep.argmax(), steep.shape))
    template = picture[row : row + side, col : col + side]
    there, elsewhere = match_template(picture, template), match_template(discs(seed), template)
    assert there.found and (there.matches[0].row, there.matches[0].col) == (row, col)
    assert not elsewhere.found and elsewhere.reason == "look_alikes"


@pytest.mark.parametrize("seed", [11, 13])
def test_a_smooth_piece_is_found_dimmed_and_another_one_is_not(seed: int) -> None:
    """A slope or a bend is in every shading: both correlate at 0.99."""
    own, other = (
        np.clip(cv2.GaussianBlur(np.random.default_rng(one).normal(size=(150, 200)), (0, 0), 9) * 900 + 128, 0, 255)
        for one in (seed, seed + 100)
    )
    row, col = (40 + 5 * seed) % 130, (60 + 9 * seed) % 180
    template = own[row : row + 14, col : col + 14].astype(np.uint8)
    there, elsewhere = (match_template(one.astype(np.uint8), template) for one in (0.9 * own + 10, other))
    assert there.found and (there.matches[0].row, there.matches[0].col) == (row, col)
    assert not elsewhere.found


@pytest.mark.parametrize(
    ("best", "rival", "clear"),
    [(1, 0.9, True), (0.76, 0.34, True), (0.62, 0.6, False), (1, 1, False), (0.3, 0.9, False)],
)
def test_a_lead_is_clear_where_the_rival_differs_clearly_more(best: float, rival: float, clear: bool) -> None:
    assert leads(best, rival) == clear


@given(st.integers(0, 2**32), st.integers(1, 12), st.integers(1, 12))
def test_places_elsewhere_share_no_pixel_and_none_better_is_left_out(seed: int, height: int, width: int) -> None:
    random = np.random.default_rng(seed)
    rows, cols, scores = random.integers(0, 40, 60), random.integers(0, 40, 60), random.random(60)

    def covered(one: int) -> set[tuple[int, int]]:
        return {(rows[one] + down, cols[one] + right) for down in range(height) for right in range(width)}

    taken = [int(np.argmax(scores))]
    places = Places(rows, cols, scores, (height, width))
    found = places.best(4, taken=taken)
    expected, used = [], covered(taken[0])
    for one in np.argsort(-scores):
        if len(expected) < 4 and not covered(int(one)) & used:
            expected.append(int(one))
            used |= covered(int(one))
    assert found == expected


@pytest.mark.parametrize("method", ["fft", "direct", "sampled"])
def test_three_equal_copies_are_look_alikes_unless_three_are_wanted(method: TemplateMethod) -> None:
    image = np.random.default_rng(0).integers(0, 256, (60, 80), dtype=np.uint8)
    places = [(3, 5), (3, 17), (44, 60)]  # the first two side by side
    for row, col in places[1:]:
        image[row : row + 10, col : col + 12] = image[3:13, 5:17]
    template = image[3:13, 5:17].copy()
    one = match_template(image, template, method=method)
    assert (one.found, one.reason, len(one.matches)) == (False, "look_alikes", 1)
    assert sorted((alike.row, alike.col) for alike in one.look_alikes) == places
    two = match_template(image, template, method=method, max_matches=2)
    assert (two.found, len(two.matches)) == (False, 2)
    three = match_template(image, template, method=method, max_matches=3)
    assert (three.found, three.clear, three.reason, three.look_alikes) == (True, 3, "clear", [])
    assert sorted((match.row, match.col) for match in three.matches) == places
    assert not {(rival.row, rival.col) for rival in three.rivals} & set(places)
    more = match_template(image, template, method=method, max_matches=9, min_score=-1)
    assert more.clear == 3


def test_the_flank_of_a_peak_is_no_rival() -> None:
    image = smooth_noise((120, 160))
    search = match_template(image, image[50:80, 60:100])
    assert search.found
    assert (search.best, search.matches) == (search.matches[0], [search.best])
    for rival in search.rivals:
        assert abs(rival.row - 50) >= 30 or abs(rival.col - 60) >= 40
    scores = [rival.score for rival in search.rivals]
    assert scores == sorted(scores, reverse=True)
    away = search.score_map.copy()
    away[21:80, 21:100] = np.nan
    assert scores[0] == np.nanmax(away[1:-1, 1:-1])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("order", [(1, 2, 0, 3), (0, 2, 1, 3)])
def test_rocketman_in_other_colours_is_not_found(method: TemplateMethod, order: tuple[int, ...]) -> None:
    search = match_template(MAZE[400:800, 800:1300], ROCKETMAN[:, :, order], method=method, seed=0)
    assert not search.found
    assert search.look_alikes == [] or search.reason == "look_alikes"


def test_rocketman_mirrored_or_smaller_is_not_found_at_a_stranger() -> None:
    assert not match_template(MAZE, np.ascontiguousarray(ROCKETMAN[:, ::-1]), method="sampled", seed=0).found
    smaller = cv2.resize(ROCKETMAN, None, fx=0.92, fy=0.92, interpolation=cv2.INTER_AREA)
    search = match_template(MAZE, smaller)
    assert (search.found, search.reason) == (False, "look_alikes")
    assert len(search.look_alikes) >= 4


@pytest.mark.parametrize("poses", [{}, {"scales": (0.95, 1.05), "rotations": (-5, 5)}], ids=["upright", "posed"])
def test_his_mirror_image_is_no_find_where_nobody_else_is(poses: dict[str, tuple[float, float]]) -> None:
    part, mirrored = MAZE[478:728, 932:1162], np.ascontiguousarray(ROCKETMAN[:, ::-1])
    search = match_template(part, mirrored, **poses)
    assert (search.found, search.clear, search.reason) == (False, 0, "mirrored")
    assert (abs(search.best.row - 50) < 9, abs(search.best.col - 50) < 9) == (True, True)
    if not poses:
        assert match_template(part[:, ::-1], mirrored).reason == "clear"


def test_what_is_the_same_mirrored_is_found_in_noise() -> None:
    half, image = smooth_noise((24, 12)), smooth_noise((90, 120), seed=1)
    template = np.hstack([half, half[:, ::-1]])
    image[30:54, 50:74] = template + np.random.default_rng(0).normal(0, template.std() / 2, (24, 24))
    search = match_template(image, template)
    assert (search.reason, search.matches[0].row, search.matches[0].col) == ("clear", 30, 50)
    assert search.matches[0].score < 0.99


def test_rocketman_is_found_by_few_of_his_pixels_with_a_clear_lead() -> None:
    search = match_template(MAZE, ROCKETMAN, method="sampled", seed=0)
    assert (search.reason, search.best.row, search.best.col) == ("clear", EXAMPLE.row, EXAMPLE.col)
    assert search.candidates < 1000


def test_rocketman_dulled_and_partly_covered_is_found_by_all_placements_alone() -> None:
    dulled = samples.mazes()["maze_dulled"]
    pictures = read_image(dulled.picture), read_image(dulled.template)
    search = match_template(*pictures)
    assert [(match.row, match.col) for match in search.matches] == [(dulled.row, dulled.col)]
    assert search.reason == "partly_covered"
    assert not match_template(*pictures, method="sampled", seed=0).found


@pytest.mark.parametrize(
    ("seen", "reason"),
    [("lit", "lower_contrast"), ("dusty", "lower_contrast"), ("grey", "other_colours"), ("yellow", "other_colours")],
)
def test_another_light_is_the_same_colours_and_grey_is_not(seen: str, reason: str) -> None:
    part = MAZE[400:800, 800:1300].astype(np.float32)
    if seen == "lit":
        part = part * np.array([0.7, 0.9, 0.5], np.float32) + 40
    elif seen == "dusty":
        part = 0.5 * part + 0.1 * part.mean(axis=2, keepdims=True) + 30
    elif seen == "grey":
        part = np.dstack([cv2.cvtColor(part, cv2.COLOR_RGB2GRAY)] * 3)
    else:
        part[:, :, 2] = 0.5 * part[:, :, 1]
    search = match_template(np.clip(part, 0, 255).astype(np.uint8), ROCKETMAN)
    assert (search.reason, search.best.row, search.best.col) == (reason, 128, 182)
    assert search.found == (reason != "other_colours")


@pytest.mark.parametrize(
    ("folder", "name", "methods", "reason", "place"),
    [
        ("boofcv_desktop", "template_paint.png", ("fft", "direct", "sampled"), "clear", (222, 338)),
        ("simplecv", "template.png", ("fft", "sampled"), "clear", (33, 363)),
        ("opencv_messi", "template.jpg", ("fft",), "clear", (85, 220)),
        ("boofcv_desktop", "template_cursor.png", ("fft",), "differs", (265, 210)),
        ("boofcv_desktop", "template_browser.png", ("fft",), "low_score", (71, 261)),
    ],
)
def test_real_pictures(data_dir, folder, name, methods, reason, place):
    path = data_dir / "template" / folder / name
    scene, template = read_image(path.with_stem("scene")), read_image(path)
    for method in methods:
        search = match_template(scene, template, method=method, seed=0)
        assert (search.reason, search.best.row, search.best.col) == (reason, *place)
        if name in ("template_paint.png", "template.png"):  # cut out of the picture
            assert search.best.score == pytest.approx(1, abs=1e-6)


def test_under_its_mask_the_cursor_is_found_three_times(data_dir: Path) -> None:
    folder = data_dir / "template" / "boofcv_desktop"
    scene, cursor, mask = (read_image(folder / f"{name}.png") for name in ("scene", "template_cursor", "mask"))
    search = match_template(scene, cursor, mask=mask)
    assert search.reason == "look_alikes"
    assert {(one.row, one.col) for one in search.look_alikes} == {(6, 271), (265, 210), (285, 371)}
    assert match_template(scene, cursor, mask=mask, max_matches=3).clear == 3


RANDOM = np.random.default_rng(3)
SCENE = RANDOM.integers(0, 256, (90, 120, 3), dtype=np.uint8)
MASK = np.zeros((20, 24), dtype=np.uint8)
MASK[3:17, 5:20] = 1


@pytest.mark.parametrize("mask", [None, MASK])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32", "float64"])
@pytest.mark.parametrize("grey", [True, False])
def test_both_give_the_same_scores(mask: Image | None, dtype: str, grey: bool) -> None:
    image = (SCENE[:, :, 0] if grey else SCENE).astype(dtype)
    template = image[30:50, 40:64]
    theirs, ours = opencv_search(image, template, mask=mask), match_template(image, template, mask=mask)
    assert (theirs.row, theirs.col) == (ours.matches[0].row, ours.matches[0].col) == (30, 40)
    assert theirs.undefined == 0
    np.testing.assert_allclose(theirs.score_map, ours.score_map, atol=1e-4)


def test_alpha_is_the_mask_and_flat_windows_under_it_are_counted_and_passed_over() -> None:
    template = np.dstack([SCENE[30:50, 40:64], MASK * 255])
    by_alpha, by_mask = opencv_search(SCENE, template), opencv_search(SCENE, SCENE[30:50, 40:64], mask=MASK)
    np.testing.assert_array_equal(by_alpha.score_map, by_mask.score_map)
    assert is_masked(template, None)
    assert not is_masked(SCENE, None)
    image = SCENE.copy()
    image[60:] = 90
    result = opencv_search(image, image[30:50, 40:64], mask=MASK)
    assert (result.row, result.col) == (30, 40)
    assert result.undefined == np.isnan(match_template(image, image[30:50, 40:64], mask=MASK).score_map).sum() > 0


@pytest.mark.parametrize(
    ("template", "fragment"), [(SCENE[:5, :5] * 0 + 7, "constant"), (np.zeros((91, 10)), "must fit into the image")]
)
def test_what_we_refuse_is_refused(template: Image, fragment: str) -> None:
    with pytest.raises(ValueError, match=fragment):
        opencv_search(SCENE, template)


@pytest.mark.parametrize(
    ("settings", "outcomes"),
    [
        ({}, "right right right"),
        ({"contrast": 0.3}, "right missed right"),
        ({"cover": 0.5}, "right right right"),
        ({"cover": 0.8}, "missed missed missed"),
        ({"turn": 10}, "missed missed missed"),
    ],
)
def test_what_becomes_of_rocketman(settings: dict[str, float], outcomes: str) -> None:
    part = degraded_part(MAZE, (EXAMPLE.row, EXAMPLE.col), ROCKETMAN.shape[:2], Degradation(**settings))
    trials = {trial.method: trial for trial in try_methods(part.pixels, ROCKETMAN, (part.row, part.col))}
    assert [trials[method].outcome for method in ("fft", "sampled", "opencv")] == outcomes.split()
    fft, theirs = trials["fft"], trials["opencv"]
    assert (fft.row, fft.col) == (theirs.row, theirs.col)
    assert fft.score == pytest.approx(theirs.score, abs=1e-5)


@pytest.mark.parametrize(
    ("image", "template", "mask", "near", "outcomes", "place"),
    [
        (SCENE, SCENE[30:50, 40:64], None, (40, 40), "elsewhere elsewhere elsewhere", (30, 40)),
        (np.full((50, 50, 3), 7, np.uint8), SCENE[30:50, 40:64], MASK, (0, 0), "missed missed missed", (None, None)),
        (SCENE, SCENE[30:50, 40:64].astype(np.uint16), None, (30, 40), "right refused right", (30, 40)),
    ],
    ids=["at another place", "nothing varies", "of another type"],
)
def test_each_method_tells_its_outcome(image, template, mask, near, outcomes, place):
    trials = {one.method: one for one in try_methods(image, template, near, mask=mask)}
    found = [trials[name] for name in ("fft", "sampled", "opencv")]
    assert [one.outcome for one in found] == outcomes.split()
    for one in found:
        if one.outcome == "refused":
            assert "needs one type" in one.refusal
        else:
            assert (one.row, one.col) == place


NOISE = np.random.default_rng(7)
PHOTOGRAPH = NOISE.integers(60, 190, (700, 900, 3), dtype=np.uint8)
SMOOTH = ndimage.gaussian_filter(NOISE.normal(size=(700, 900)), 6).astype(np.float32)
SHAPE = (31, 40)


def degraded(image: Image = PHOTOGRAPH, **settings: float) -> DegradedPart:
    return degraded_part(image, (300, 420), SHAPE, Degradation(**settings))


@given(
    row=st.integers(0, 700 - 31), col=st.integers(0, 900 - 40), dtype=st.sampled_from(["uint8", "uint16", "float64"])
)
def test_by_default_the_part_is_the_image_itself_wherever_it_is_cut(row: int, col: int, dtype: str) -> None:
    image = PHOTOGRAPH[:, :, 0].astype(dtype)
    part = degraded_part(image, (row, col), SHAPE, Degradation())
    rows, cols = part.pixels.shape
    assert (rows, cols) == (480, 640)
    assert part.pixels.dtype == image.dtype
    np.testing.assert_array_equal(part.pixels, image[part.top : part.top + rows, part.left : part.left + cols])
    assert (part.top + part.row, part.left + part.col) == (row, col)


def test_a_small_image_is_taken_whole_without_alpha_and_a_large_template_has_a_part_of_twice_its_size() -> None:
    small = np.dstack([PHOTOGRAPH[:50, :60], PHOTOGRAPH[:50, :60, :1]])
    part = degraded_part(small, (19, 20), SHAPE, Degradation())
    np.testing.assert_array_equal(part.pixels, small[:, :, :3])
    part = degraded_part(PHOTOGRAPH, (100, 100), (300, 400), Degradation())
    assert part.pixels.shape == (600, 800, 3)


def test_contrast_and_brightness_are_linear_in_levels_of_a_255th_and_do_not_wrap_round() -> None:
    plain, dull = degraded().pixels.astype(float), degraded(contrast=0.5, brightness=-20).pixels.astype(float)
    np.testing.assert_allclose(dull, (plain - plain.mean()) / 2 + plain.mean() - 20, atol=0.5 + 1e-9)
    deep = degraded(PHOTOGRAPH.astype(np.uint16) * 257, brightness=10).pixels
    np.testing.assert_array_equal(deep, degraded(brightness=10).pixels.astype(np.uint16) * 257)
    bright = np.where(PHOTOGRAPH > 100, 250, PHOTOGRAPH).astype(np.uint8)
    assert degraded(bright, brightness=90).pixels.min() >= 150


def test_noise_has_the_spread_asked_for_and_is_the_same_each_time() -> None:
    difference = degraded(noise=8).pixels.astype(float) - degraded().pixels
    assert difference.std() == pytest.approx(8, rel=0.02)
    assert difference.mean() == pytest.approx(0, abs=0.1)
    np.testing.assert_array_equal(degraded(noise=8).pixels, degraded(noise=8).pixels)


@pytest.mark.parametrize("cover", [0.25, 0.5, 1.0])
def test_a_grey_box_covers_its_share_from_below(cover: float) -> None:
    part, plain = degraded(cover=cover), degraded()
    hidden = round(SHAPE[0] * cover)
    rows = slice(part.row + SHAPE[0] - hidden, part.row + SHAPE[0])
    assert len(np.unique(part.pixels[rows, part.col : part.col + SHAPE[1]])) == 1
    changed = (part.pixels != plain.pixels).any(axis=2)
    # Some pixels of the scene already have the grey of the box.
    assert 0.9 * hidden * SHAPE[1] <= changed.sum() <= hidden * SHAPE[1]
    assert not changed[: part.row].any()


@pytest.mark.parametrize(("turn", "resize"), [(30, 1), (-17, 1), (0, 0.7), (0, 1.4), (25, 1.3)])
def test_turning_and_resizing_keep_the_centre_in_place(turn: float, resize: float) -> None:
    height, width = 41, 61  # odd, so that a pixel is in the middle
    middle = np.array([320 + height // 2, 430 + width // 2])
    part = degraded_part(SMOOTH, (320, 430), (height, width), Degradation(turn=turn, resize=resize))
    row, col = part.row + height // 2, part.col + width // 2
    # A step to the right in the part is one to the lower right in the image: y points down.
    for away in (0, 12):
        at = middle + away / resize * np.array([np.sin(np.deg2rad(turn)), np.cos(np.deg2rad(turn))])
        expected = ndimage.map_coordinates(SMOOTH, at[:, None], order=1)[0]
        assert part.pixels[row, col + away] == pytest.approx(expected, abs=0.01 if away else 1e-5)


def test_a_wide_image_is_turned_too() -> None:
    wide = np.tile(SMOOTH[:60], (1, 40))  # 36,000 px wide; OpenCV warps at most 32,767
    part = degraded_part(wide, (5, 30_000), SHAPE, Degradation(turn=10))
    assert part.pixels.shape == (60, 640)
    assert part.pixels.std() > 0


def test_a_place_beyond_the_image_and_impossible_settings_are_refused() -> None:
    for place in ((-1, 0), (0, 861), (670, 0)):
        with pytest.raises(ValueError, match="does not lie within"):
            degraded_part(PHOTOGRAPH, place, SHAPE, Degradation())
    for name, value in {"contrast": 0, "noise": -1, "resize": 3, "cover": 1.1, "turn": 60}.items():
        with pytest.raises(ValueError, match=name):
            Degradation(**{name: value})
