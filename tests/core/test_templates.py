"""Template search over every placement: known places, independent oracles, and searches without an answer."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.feature import match_template as skimage_match_template

from stereolag.templates import TemplateMethod, TemplateSearch, match_template

Array = npt.NDArray[Any]
EVERY_PLACEMENT: tuple[TemplateMethod, ...] = ("fft", "direct")
EVERY_METHOD: tuple[TemplateMethod, ...] = ("fft", "direct", "sampled")


def random_image(shape: tuple[int, ...], dtype: type = np.uint8, seed: int = 0) -> Array:
    random = np.random.default_rng(seed)
    if np.issubdtype(dtype, np.floating):
        return random.normal(size=shape).astype(dtype)
    return random.integers(0, np.iinfo(dtype).max, shape, dtype=dtype, endpoint=True)


def round_mask(height: int, width: int) -> npt.NDArray[np.bool_]:
    rows, cols = np.mgrid[:height, :width]
    return np.asarray(((rows + 0.5) / height - 0.5) ** 2 + ((cols + 0.5) / width - 0.5) ** 2 < 0.25)


def place(search: TemplateSearch) -> tuple[int, int]:
    return search.matches[0].row, search.matches[0].col


@pytest.mark.parametrize("method", EVERY_METHOD)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("channels", [(), (3,), (4,)])
@pytest.mark.parametrize(("row", "col"), [(0, 0), (17, 5), (29, 46)])
def test_a_copy_is_found_at_its_place(
    method: TemplateMethod, dtype: type, channels: tuple[int, ...], row: int, col: int
) -> None:
    image = random_image((40, 60, *channels), dtype)
    template = image[row : row + 11, col : col + 14].copy()
    if channels == (4,):
        template[:, :, 3] = np.where(round_mask(11, 14), 255, 0)
        template[:, :, :3][~round_mask(11, 14)] = 0
    search = match_template(image, template, method=method)
    assert search.found
    (match,) = search.matches
    assert (match.row, match.col, match.height, match.width) == (row, col, 11, 14)
    assert match.score == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
def test_the_map_has_a_score_for_every_placement_inside_the_picture(method: TemplateMethod) -> None:
    search = match_template(random_image((40, 60)), random_image((11, 14), seed=1), method=method)
    assert search.score_map is not None
    assert search.score_map.shape == (30, 47)
    assert search.score_map.dtype == np.float32
    assert search.candidates == 30 * 47


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
def test_grey_scores_equal_those_of_scikit_image(method: TemplateMethod) -> None:
    image, template = random_image((50, 70), np.float64), random_image((9, 12), np.float64, seed=1)
    np.testing.assert_allclose(
        match_template(image, template, method=method).score_map, skimage_match_template(image, template), atol=1e-6
    )


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
@pytest.mark.parametrize("channels", [(), (3,)])
def test_scores_equal_those_of_opencv(method: TemplateMethod, channels: tuple[int, ...]) -> None:
    image, template = random_image((50, 70, *channels)), random_image((9, 12, *channels), seed=1)
    np.testing.assert_allclose(
        match_template(image, template, method=method).score_map,
        cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED),
        atol=1e-5,
    )


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
@pytest.mark.parametrize("channels", [(), (3,)])
def test_masked_scores_equal_those_of_opencv(method: TemplateMethod, channels: tuple[int, ...]) -> None:
    image, template = random_image((50, 70, *channels)), random_image((9, 12, *channels), seed=1)
    mask = round_mask(9, 12)
    np.testing.assert_allclose(
        match_template(image, template, mask=mask, method=method).score_map,
        cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED, mask=mask.astype(np.uint8) * 255),
        atol=1e-5,
    )


@st.composite
def searches(draw: st.DrawFn) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Draw an image with constant regions, a template and a mask."""
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    dtype = draw(st.sampled_from([np.uint8, np.uint16, np.float32, np.float64]))
    channels = draw(st.sampled_from([1, 3]))
    height, width = draw(st.integers(1, 8)), draw(st.integers(2, 8))
    rows, cols = height + draw(st.integers(0, 25)), width + draw(st.integers(0, 25))
    levels = draw(st.sampled_from([2, 5, 200]))
    image = random.integers(0, levels, (rows, cols, channels)).astype(dtype)
    image[: rows // 2, : cols // 2] = image[0, 0]
    template = random.integers(0, levels, (height, width, channels)).astype(dtype)
    template[0, :2] = np.array([[0], [1]])
    mask = random.random((height, width)) < draw(st.sampled_from([0.3, 0.8, 2.0]))
    mask[0, :2] = True
    offset = draw(st.sampled_from([0, 50]))
    return (
        np.squeeze(image + dtype(offset), 2) if channels == 1 else image + dtype(offset),
        (np.squeeze(template, 2) if channels == 1 else template),
        mask,
    )


def brute_force(image: Array, template: Array, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
    """Return Pearson's coefficient at every placement, computed straight from its definition."""
    image, template = np.atleast_3d(image).astype(np.float64), np.atleast_3d(template)[mask].astype(np.float64)
    height, width = mask.shape
    pattern = template - template.mean(axis=0)
    scores = np.full((image.shape[0] - height + 1, image.shape[1] - width + 1), np.nan)
    for row, col in np.ndindex(*scores.shape):
        window = image[row : row + height, col : col + width][mask]
        if np.ptp(window, axis=0).any():
            window = window - window.mean(axis=0)
            scores[row, col] = (window * pattern).sum() / np.sqrt((window**2).sum() * (pattern**2).sum())
    return scores


@settings(max_examples=60)
@given(searches())
def test_both_methods_equal_the_definition(search: tuple[Array, Array, npt.NDArray[np.bool_]]) -> None:
    image, template, mask = search
    expected = brute_force(image, template, mask)
    for method in EVERY_PLACEMENT:
        score_map = match_template(image, template, mask=mask, method=method).score_map
        np.testing.assert_allclose(score_map, expected, atol=1e-5)


@pytest.mark.parametrize("masked", [False, True])
def test_tiles_meet_without_a_seam(masked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stereolag.templates.score_maps.LONGEST_FFT", 96)
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


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("method", EVERY_PLACEMENT)
def test_flat_windows_have_no_score(method: TemplateMethod, dtype: type, masked: bool) -> None:
    image = np.full((60, 60), 0.1 if np.issubdtype(dtype, np.floating) else 200, dtype=dtype)
    image[20:30, 20:30] = random_image((10, 10), dtype)
    template = image[18:30, 18:30]
    search = match_template(image, template, method=method, mask=round_mask(12, 12) if masked else None)
    assert search.score_map is not None
    assert np.isnan(search.score_map[:8, :8]).all()
    assert np.isnan(search.score_map[31:, 31:]).all()
    assert np.isfinite(search.score_map[12:27, 12:27]).all()
    assert place(search) == (18, 18)


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_a_constant_picture_holds_no_template(method: TemplateMethod) -> None:
    search = match_template(np.full((30, 30), 7, dtype=np.uint8), random_image((5, 5)), method=method, min_score=-1)
    assert not search.found
    assert search.matches == []


@pytest.mark.parametrize("value", [0, 7, 255])
@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_a_constant_template_is_refused(value: int, dtype: type) -> None:
    with pytest.raises(ValueError, match=r"template is constant .* needs something that varies"):
        match_template(random_image((30, 30), dtype), np.full((5, 5), value, dtype=dtype))


def test_a_template_that_varies_only_where_it_is_transparent_is_refused() -> None:
    template = random_image((5, 5, 4))
    template[:, :, 3] = 0
    template[1:3, 1:3] = [9, 8, 7, 255]
    with pytest.raises(ValueError, match=r"template is constant \(9, 8, 7 in all its 4 opaque pixels\)"):
        match_template(random_image((30, 30, 3)), template)


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
def test_one_constant_channel_does_no_harm(method: TemplateMethod) -> None:
    image = random_image((30, 40, 3), np.float32)
    image[:, :, 1] = 0.1
    assert place(match_template(image, image[4:12, 21:30], method=method)) == (4, 21)


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("masked", [False, True])
def test_a_mean_of_ten_thousand_sigma_hides_nothing(method: TemplateMethod, dtype: type, masked: bool) -> None:
    image = (random_image((60, 80), np.float64) + 1e4).astype(dtype)
    search = match_template(
        image, image[30:41, 50:62], method=method, mask=round_mask(11, 12) if masked else None, max_matches=2
    )
    assert place(search) == (30, 50)
    assert search.matches[0].score == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("method", EVERY_PLACEMENT)
def test_brightness_and_contrast_do_not_matter(method: TemplateMethod) -> None:
    image = random_image((30, 40))
    search = match_template(image, image[9:18, 20:31] * 0.001 + 3.0, method=method)
    assert place(search) == (9, 20)
    assert search.matches[0].score == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_a_negative_is_no_match(method: TemplateMethod) -> None:
    image = random_image((30, 40))
    search = match_template(image, 255 - image[9:18, 20:31], method=method)
    assert not search.found
    if search.score_map is not None:
        assert search.score_map.min() == pytest.approx(-1, abs=1e-6)


@settings(max_examples=30)
@given(st.integers(0, 2**32), st.sampled_from(EVERY_PLACEMENT))
def test_a_negated_template_negates_every_score(seed: int, method: TemplateMethod) -> None:
    image, template = random_image((20, 25), seed=seed), random_image((5, 4), seed=seed + 1)
    positive = match_template(image, template, method=method).score_map
    negative = match_template(image, 255 - template, method=method).score_map
    assert positive is not None
    assert negative is not None
    np.testing.assert_allclose(positive, -negative, atol=1e-6)


def test_scores_stay_within_one() -> None:
    image = np.tile(random_image((8, 8), np.float32), (6, 6))
    score_map = match_template(image, image[:8, :8]).score_map
    assert score_map is not None
    assert np.abs(score_map).max() <= 1


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_alpha_is_the_mask_unless_one_is_given(method: TemplateMethod) -> None:
    image = random_image((40, 50, 3))
    template = np.dstack([image[12:23, 7:20], np.full((11, 13), 255, dtype=np.uint8)])
    hidden = ~round_mask(11, 13)
    template[hidden, :3] = random_image((int(hidden.sum()), 3), seed=5)
    opaque = match_template(image, template, method=method, min_score=-1)
    assert opaque.matches == [] or opaque.matches[0].score < 0.95
    by_mask = match_template(image, template, method=method, mask=round_mask(11, 13))
    template[hidden, 3] = np.linspace(0, 254, int(hidden.sum()), dtype=np.uint8)
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


def test_the_alpha_of_the_picture_is_ignored() -> None:
    image = random_image((40, 50, 4))
    without = match_template(image[:, :, :3], image[5:16, 31:42, :3])
    assert match_template(image, image[5:16, 31:42, :3]).matches == without.matches


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_the_arguments_are_left_alone(method: TemplateMethod) -> None:
    image = random_image((30, 40, 3), np.float64)
    template = image[5:16, 21:32].copy()
    image.setflags(write=False)
    template.setflags(write=False)
    assert match_template(image, template, method=method).found


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_progress_rises_to_one(method: TemplateMethod) -> None:
    told: list[float] = []
    image = random_image((30, 40))
    match_template(image, image[5:16, 21:32], method=method, progress=told.append)
    assert told == sorted(told)
    assert told[0] >= 0
    assert told[-1] == 1


def test_a_progress_that_raises_cancels_the_search() -> None:
    class CancelledError(Exception):
        pass

    def cancel(fraction: float) -> None:
        raise CancelledError

    for method in EVERY_METHOD:
        with pytest.raises(CancelledError):
            match_template(random_image((90, 90)), random_image((9, 9), seed=1), method=method, progress=cancel)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"template": random_image((31, 5))}, r"template is 5 × 31 pixels and image 40 × 30; .* must fit"),
        ({"template": random_image((5, 41))}, r"template is 41 × 5 pixels"),
        ({"template": np.zeros((5, 6, 4), dtype=np.uint8)}, r"no opaque pixel"),
        ({"template": np.zeros((5, 6, 4), dtype=np.float32)}, r"no opaque pixel"),
        ({"mask": np.zeros((5, 6))}, r"no opaque pixel"),
        ({"mask": np.ones((6, 5))}, r"mask is 5 × 6 and template is 6 × 5 pixels"),
        ({"template": np.full((5, 6), np.nan)}, r"template holds 30 NaN"),
        ({"image": np.full((30, 40), np.inf)}, r"image holds 1200 NaN or infinite"),
        ({"template": np.zeros((0, 6))}, r"template has shape \(0, 6\)"),
        ({"method": "magic"}, r"method is 'magic'; allowed are 'fft', 'sampled', 'direct'"),
        ({"max_matches": 0}, r"max_matches is 0; it must be 1 or more"),
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
