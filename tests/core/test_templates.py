"""Template search: known places, independent oracles, several matches, exact pixels, and the formulas behind it."""

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sprites import SPRITE_PLACE, sprite_scene

from stereolag.core.arrays import Array, DoubleMap, Mask
from stereolag.core.inputs import FLAT_WHOLE
from stereolag.templates import TemplateMatch, TemplateMethod, TemplateSearch, match_template
from stereolag.templates.places import Places, peaks
from stereolag.templates.score_maps import pearson, score_windows, scores_at

EVERY_PLACEMENT: tuple[TemplateMethod, ...] = ("fft", "direct")
EVERY_METHOD: tuple[TemplateMethod, ...] = ("fft", "direct", "sampled")


def random_image(shape: tuple[int, ...], dtype: type = np.uint8, seed: int = 0) -> Array:
    random = np.random.default_rng(seed)
    if np.issubdtype(dtype, np.floating):
        return random.normal(size=shape).astype(dtype)
    return random.integers(0, np.iinfo(dtype).max, shape, dtype=dtype, endpoint=True)


def round_mask(height: int, width: int) -> Mask:
    rows, cols = np.mgrid[:height, :width]
    return np.asarray(((rows + 0.5) / height - 0.5) ** 2 + ((cols + 0.5) / width - 0.5) ** 2 < 0.25)


def place(search: TemplateSearch) -> tuple[int, int]:
    return search.matches[0].row, search.matches[0].col


@pytest.mark.parametrize("method", EVERY_METHOD)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_a_copy_is_found_at_its_place_with_progress_from_0_to_1_and_the_arguments_left_alone(method, dtype):
    image = random_image((40, 60, 3), dtype)
    template = image[29:40, 46:60].copy()
    image.setflags(write=False)
    template.setflags(write=False)
    told: list[float] = []
    search = match_template(image, template, method=method, progress=told.append)
    assert search.found
    (match,) = search.matches
    assert (match.row, match.col, match.height, match.width) == (29, 46, 11, 14)
    assert match.score == pytest.approx(1, abs=1e-6)
    assert told == sorted(told)
    assert (told[0] >= 0, told[-1]) == (True, 1)


@st.composite
def searches(draw: st.DrawFn) -> tuple[Array, Array, Mask]:
    """Draw an image with constant regions, perhaps in one constant channel or far from 0, a template and a mask."""
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    dtype = draw(st.sampled_from([np.uint8, np.uint16, np.float32, np.float64]))
    channels = draw(st.sampled_from([1, 3]))
    height, width = draw(st.integers(1, 8)), draw(st.integers(2, 8))
    rows, cols = height + draw(st.integers(0, 25)), width + draw(st.integers(0, 25))
    levels = draw(st.sampled_from([2, 5, 200]))
    image = random.integers(0, levels, (rows, cols, channels)).astype(dtype)
    image[: rows // 2, : cols // 2] = image[0, 0]
    if channels == 3 and draw(st.booleans()):
        image[:, :, 1] = image[0, 0, 1]
    template = random.integers(0, levels, (height, width, channels)).astype(dtype)
    template[0, :2] = np.array([[0], [1]])
    mask = random.random((height, width)) < draw(st.sampled_from([0.3, 0.8, 2.0]))
    mask[0, :2] = True
    image += dtype(draw(st.sampled_from([0, 50] if dtype == np.uint8 else [0, 50, 10_000])))
    if np.issubdtype(dtype, np.floating):
        image *= dtype(draw(st.sampled_from([1, 0.1])))
    if channels == 1:
        return image[:, :, 0], template[:, :, 0], mask
    return image, template, mask


def brute_force(image: Array, template: Array, mask: Mask) -> DoubleMap:
    """Return Pearson's coefficient at every placement, computed straight from its definition."""
    windows = np.lib.stride_tricks.sliding_window_view(np.atleast_3d(image), mask.shape, axis=(0, 1))[..., mask]
    pattern, flat = np.atleast_3d(template)[mask].T.astype(np.float64), (np.ptp(windows, axis=-1) == 0).all(axis=-1)
    windows, pattern = (one - one.mean(axis=-1, keepdims=True, dtype=np.float64) for one in (windows, pattern))
    energies = (windows**2).sum(axis=(-2, -1)) * (pattern**2).sum()
    return np.where(flat, np.nan, (windows * pattern).sum(axis=(-2, -1)) / np.sqrt(np.where(flat, 1, energies)))


@given(searches())
@settings(max_examples=30)
def test_the_map_is_the_definition_at_every_placement(search: tuple[Array, Array, Mask]) -> None:
    image, template, mask = search
    expected = brute_force(image, template, mask)
    for method in EVERY_PLACEMENT:
        found = match_template(image, template, mask=mask, method=method)
        assert (found.score_map.dtype, found.candidates) == (np.float32, expected.size)
        assert not (np.abs(found.score_map) > 1).any()
        np.testing.assert_allclose(found.score_map, expected, atol=1e-5)


@pytest.mark.parametrize("masked", [False, True])
def test_tiles_meet_without_a_seam(masked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stereolag.templates.score_maps.MAX_TILE_PX", 96)
    image, template = random_image((301, 423, 3)), random_image((33, 27, 3), seed=1)
    mask = round_mask(33, 27).astype(np.uint8) if masked else np.ones((33, 27), dtype=np.uint8)
    np.testing.assert_allclose(
        match_template(image, template, mask=mask).score_map,
        cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED, mask=mask),
        atol=1e-5,
    )


@pytest.mark.parametrize("shape", [(1, 7), (7, 1), (30, 1), (1, 40), (30, 40)])
@pytest.mark.parametrize("method", EVERY_METHOD)
def test_extreme_shapes(shape: tuple[int, int], method: TemplateMethod) -> None:
    image = random_image((30, 40), np.uint16)
    template = image[30 - shape[0] :, 40 - shape[1] :]
    assert place(match_template(image, template, method=method)) == (30 - shape[0], 40 - shape[1])


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_alpha_is_the_mask_unless_one_is_given(method: TemplateMethod) -> None:
    image = random_image((40, 50, 3))
    template = np.dstack([image[12:23, 7:20], np.full((11, 13), 255, dtype=np.uint8)])
    hidden = ~round_mask(11, 13)
    template[hidden, :3] = random_image((int(hidden.sum()), 3), seed=5)
    opaque = match_template(image, template, method=method, min_score=-1)
    assert opaque.matches == [] or opaque.matches[0].score < 0.95
    by_mask = match_template(image, template, method=method, mask=round_mask(11, 13))
    template[hidden, 3] = np.linspace(0, 54, int(hidden.sum()), dtype=np.uint8)  # of hardly any weight
    by_alpha = match_template(image, template, method=method)
    assert by_alpha.matches == by_mask.matches
    assert place(by_alpha) == (12, 7)
    assert by_alpha.matches[0].score == pytest.approx(1)


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
def test_where_one_is_grey_luminance_is_compared(method: TemplateMethod) -> None:
    image = random_image((40, 50, 3))
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    assert place(match_template(grey, image[5:16, 31:42], method=method)) == (5, 31)
    assert place(match_template(image, grey[5:16, 31:42], method=method)) == (5, 31)


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_the_alpha_of_the_picture_is_ignored(method: TemplateMethod) -> None:
    image = random_image((40, 50, 4))
    without = match_template(image[:, :, :3], image[5:16, 31:42, :3], method=method)
    assert without.found and match_template(image, image[5:16, 31:42, :3], method=method).matches == without.matches


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_a_progress_that_raises_cancels_the_search(method: TemplateMethod) -> None:
    def cancel(fraction: float) -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        match_template(random_image((90, 90)), random_image((9, 9), seed=1), method=method, progress=cancel)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"template": np.full((5, 6), 7)}, r"The template is constant .* needs something that varies"),
        ({"template": np.full((1, 1), 7)}, r"template is constant \(7 in its only opaque pixel\)"),
        ({"template": random_image((31, 5))}, r"The template is 5 × 31 pixels and the image 40 × 30; .* must fit"),
        ({"template": random_image((5, 41))}, r"template is 41 × 5 pixels"),
        ({"template": np.zeros((5, 6, 4), dtype=np.uint8)}, r"no opaque pixel"),
        ({"template": np.zeros((5, 6, 4), dtype=np.float32)}, r"no opaque pixel"),
        ({"mask": np.zeros((5, 6))}, r"no opaque pixel"),
        ({"mask": np.ones((6, 5))}, r"mask is 5 × 6 and template is 6 × 5 pixels"),
        ({"template": np.full((5, 6), np.nan)}, r"template holds 30 NaN"),
        ({"image": np.full((30, 40), np.inf)}, r"image holds 1200 NaN or infinite"),
        ({"template": np.zeros((0, 6))}, r"template has shape \(0, 6\)"),
        ({"method": "magic"}, r"method is 'magic'; allowed are 'fft', 'sampled', 'direct'"),
        ({"max_matches": 0}, r"max_matches is 0; allowed are whole numbers from 1"),
        ({"max_matches": float("inf")}, r"max_matches is inf; allowed are whole numbers from 1"),
        ({"min_score": 1.5}, r"min_score is 1.5; .* between -1 and 1"),
        ({"min_score": float("nan")}, r"min_score is nan"),
        (
            {"method": "sampled", "template": random_image((5, 6), np.float32)},
            r"image holds uint8 and template float32",
        ),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], message: str) -> None:
    good = {"image": random_image((30, 40)), "template": random_image((5, 6), seed=1)}
    with pytest.raises(ValueError, match=message):
        match_template(**{**good, **arguments})


@settings(max_examples=60)
@given(
    st.integers(0, 2**32),
    st.integers(1, 4),
    st.integers(1, 9),
    st.integers(1, 9),
    st.integers(0, 12),
    st.integers(0, 12),
)
def test_scores_of_windows_by_running_sums_equal_the_formula(seed, channels, height, width, down, across):
    random, shape = np.random.default_rng(seed), (channels, height + down, width + across)
    planes = random.integers(-255, 256, shape).astype(np.float64)
    planes[:, : height + 2, : width + 2] = 77  # flat windows
    windows = np.lib.stride_tricks.sliding_window_view(planes, (height, width), axis=(1, 2))
    energy = (height * width * windows.var(axis=(3, 4))).sum(axis=0)
    products = random.uniform(-1.2, 1.2, energy.shape) * np.sqrt(energy)
    memory = np.full((channels, 2, shape[2]), np.nan), np.full((3, across + 1), np.nan)
    for kind in (np.float64, np.float32):
        scores = np.full((down + 3, across + 5), 7, dtype=np.float32)
        given = planes.astype(kind), products.astype(kind)
        score_windows(*given, (height, width), FLAT_WHOLE, memory, scores, (1, 2))
        expected = pearson(products, energy, tolerance=FLAT_WHOLE)
        np.testing.assert_allclose(scores[1:-1, 2:-2], expected, atol=2e-6)
        scores[1:-1, 2:-2] = 7
        assert (scores == 7).all()


def test_a_flat_window_has_no_score_and_rounding_takes_none_beyond_one() -> None:
    products = np.repeat([[1.0, -1.0, 0.5, 1.02, 0.0]], 40, axis=0)
    energy = np.repeat([[1.0, 1.0, 1.0, 1.0, 0.25]], 40, axis=0)
    for kind in (np.float64, np.float32):
        scores = pearson(products.astype(kind), energy.astype(kind), tolerance=0.25)
        np.testing.assert_array_equal(scores, np.repeat([[1, -1, 0.5, 1, np.nan]], 40, axis=0))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("channels", [1, 3])
def test_scores_at_positions_equal_the_formula(dtype: type, channels: int) -> None:
    random = np.random.default_rng(0)
    image = random.integers(0, 256, (30, 40, channels)).astype(dtype)
    image[:6, :7] = 9
    weights = random.random((6, 7)) * (random.random((6, 7)) < 0.7)
    template = random.normal(size=(channels, 6, 7))
    deviations = template - (weights * template).sum(axis=(1, 2), keepdims=True) / weights.sum()
    rows, cols = np.divmod(np.arange(25 * 34), 34)
    scores = scores_at(image, deviations, weights, rows, cols)
    windows = np.lib.stride_tricks.sliding_window_view(image.astype(np.float64), weights.shape, axis=(0, 1))
    relative = (
        windows - np.average(windows, axis=(3, 4), weights=np.broadcast_to(weights, windows.shape))[..., None, None]
    )
    with np.errstate(invalid="ignore"):
        norms = np.sqrt((weights * relative**2).sum(axis=(2, 3, 4)) * (weights * deviations**2).sum())
        expected = (weights * relative * deviations).sum(axis=(2, 3, 4)) / norms
    np.testing.assert_allclose(scores[1:], expected.ravel()[1:], atol=1e-10)
    assert np.isnan(scores[0])


def overlap(one: TemplateMatch, other: TemplateMatch) -> float:
    rows = max(0, one.height - abs(one.row - other.row))
    cols = max(0, one.width - abs(one.col - other.col))
    return rows * cols / (one.height * one.width)


@settings(max_examples=12)
@given(
    st.integers(0, 2**32), st.integers(2, 9), st.integers(2, 9), st.integers(1, 40), st.sampled_from([-1.0, 0.0, 0.3])
)
def test_matches_are_sorted_peaks_that_overlap_by_half_at_most(seed, height, width, max_matches, min_score):
    random = np.random.default_rng(seed)
    image = random.integers(0, 4, (40, 50), dtype=np.uint8)
    template = image[20 : 20 + height, 30 : 30 + width].copy()
    template[0, :2] = [0, 3]
    search = match_template(image, template, max_matches=max_matches, min_score=min_score)
    scores = [match.score for match in search.matches]
    assert len(scores) <= max_matches
    for part in (scores[: search.clear], scores[search.clear :]):
        assert part == sorted(part, reverse=True)
    assert all(score >= min_score for score in scores)
    assert search.found or scores[0] == np.nanmax(search.score_map)
    for index, match in enumerate(search.matches):
        assert match.score == search.score_map[match.row, match.col]
        around = search.score_map[max(0, match.row - 1) : match.row + 2, max(0, match.col - 1) : match.col + 2]
        assert match.score == np.nanmax(around)
        assert all(overlap(match, other) <= 0.5 for other in search.matches[:index])


@pytest.mark.parametrize(
    ("rows", "cols", "scores", "shape", "kept"),
    [
        ([3, 3, 3], [0, 5, 9], [0.8, 0.9, 0.7], (4, 10), [1, 0]),
        ([3, 3, 3], [0, 5, 9], [0.9, 0.7, 0.8], (4, 10), [0, 2]),
        ([0, 0, 9], [0, 1, 0], [0.9, 0.9, 0.9], (4, 4), [0, 2]),
    ],
)
def test_copies_that_overlap_by_exactly_half_are_kept_and_of_equal_scores_the_first(rows, cols, scores, shape, kept):
    assert Places(np.array(rows), np.array(cols), np.array(scores), shape).best(9, share=0.5) == kept


def test_the_slope_of_a_peak_is_no_peak_and_a_map_without_scores_has_none() -> None:
    rows, cols = np.mgrid[:600, :40]
    score_map = np.exp(-((rows - 256) ** 2 + (cols - 20) ** 2) / 200).astype(np.float32)
    score_map[score_map < 0.1] = np.nan
    found = peaks(score_map, (5, 6))
    assert (found.rows.tolist(), found.cols.tolist(), found.scores.tolist()) == ([256], [20], [1.0])
    assert peaks(np.full((3, 4), np.nan, dtype=np.float32), (5, 6)).rows.size == 0


@given(st.integers(0, 2**32), st.integers(0, 2**32))
def test_a_sprite_is_found_whatever_the_seed(picture_seed: int, seed: int) -> None:
    search = match_template(*sprite_scene(picture_seed), method="sampled", seed=seed)
    assert [(match.row, match.col) for match in search.matches] == [SPRITE_PLACE]
    assert search.matches[0].score == pytest.approx(1)
    assert search.score_map is None


def test_a_partly_covered_sprite_is_found_by_another_anchor() -> None:
    image, sprite = sprite_scene(4)
    image[23:28, 41:58] = 0
    for seed in range(10):
        search = match_template(image, sprite, method="sampled", seed=seed)
        assert [(match.row, match.col) for match in search.matches] == [SPRITE_PLACE]


@pytest.mark.parametrize("sides", [(20, 30), (90, 70)])
@pytest.mark.parametrize(
    ("method", "gain", "offset", "alike"),
    [("fft", 1.0, 10, 2), ("fft", 0.5, 60, 0), ("sampled", 1.0, 10, 0), ("sampled", 0.5, 60, 0)],
)
def test_a_copy_of_another_brightness_is_a_rival_of_an_exact_one_unless_its_contrast_differs(
    sides: tuple[int, int], gain: float, offset: int, alike: int, method: TemplateMethod
) -> None:
    noise = np.random.default_rng(1).integers(0, 200, (260, 280), dtype=np.uint8)
    image = cv2.GaussianBlur(noise, (0, 0), 1.0)
    template = image[40 : 40 + sides[0], 70 : 70 + sides[1]].copy()
    assert match_template(image, template, method="sampled", seed=0).found
    image[150 : 150 + sides[0], 20 : 20 + sides[1]] = np.rint(template * gain + offset)
    search = match_template(image, template, method=method, seed=0)
    assert (search.clear, len(search.look_alikes)) == (0 if alike else 1, alike)
    assert (search.best.row, search.best.col) == (40, 70)


def test_pixels_that_are_not_exact_are_honestly_not_found_and_dark_ones_among_bright_integers_are() -> None:
    image, sprite = sprite_scene(6)
    sprite[:, :, :3] ^= 1
    assert match_template(image, sprite, method="fft").found
    search = match_template(image // 2 * 2, sprite | 1, method="sampled")
    assert (search.found, search.candidates) == (False, 0)
    image, sprite = (one.astype(np.int32) for one in sprite_scene(7))
    image[0, 0] = 300
    assert match_template(image, sprite, method="sampled").matches[0].row == 23


@pytest.mark.parametrize("levels", [2, 3])
def test_a_picture_of_few_values_has_no_rare_pixel_and_is_still_searched(levels: int) -> None:
    image = np.random.default_rng(0).integers(0, levels, (60, 70), dtype=np.uint8)
    assert place(match_template(image, image[20:32, 30:45], method="sampled")) == (20, 30)
