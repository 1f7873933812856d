"""Pictures for display: colours, frames, flows, edges and printed legends, read back pixel by pixel."""

import colorsys
import re

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.core.arrays import Array, EightBit
from stereolag.figures import pictures
from stereolag.figures.boards import with_corners
from stereolag.figures.legends import FAR_TO_NEAR, with_legend
from stereolag.figures.maps import image_into_map
from stereolag.figures.pictures import disparity_range
from stereolag.figures.templates import framed, match_close_up, score_map_picture
from stereolag.geometry.boards import Board, Corners
from stereolag.pair_sources import example_pair
from stereolag.samples import stereo_pairs
from stereolag.templates import TemplateMatch
from tests.app.uploads import texture


def decoded(data: bytes) -> EightBit:
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def test_near_is_bright_and_no_answer_a_grey_that_is_none_of_the_colours() -> None:
    disparity = np.array([[0, 5, 10, 99, -99, np.nan, np.inf, -np.inf]], dtype=np.float32)
    far, between, near, nearer, farther, *nothing = pictures.coloured(disparity, 0, 10, FAR_TO_NEAR)[0]
    assert far.tolist() == farther.tolist() == pictures.VIRIDIS[0].tolist()
    assert near.tolist() == nearer.tolist() == pictures.VIRIDIS[-1].tolist()
    assert between.tolist() in pictures.VIRIDIS.tolist()
    assert (np.array(nothing) == pictures.NO_ANSWER).all()
    assert np.abs(pictures.VIRIDIS.astype(int) - pictures.NO_ANSWER).sum(axis=1).min() > 40


def test_the_range_of_colours_holds_still_under_small_changes() -> None:
    truth = np.linspace(5, 61, 1_000, dtype=np.float32).reshape(10, 100)
    for maps in ([truth], [truth + 0.2], [truth, np.full((3, 3), np.nan, dtype=np.float32)]):
        assert disparity_range(maps) == (4.0, 64.0)
    for maps, ends in (([], (0, 4)), ([np.nan], (0, 4)), ([np.nan, 9], (8, 12)), ([-8], (-8, -4))):
        assert disparity_range([np.full((4, 4), value, dtype=np.float32) for value in maps]) == ends


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_every_type_of_picture_is_shown(dtype: type) -> None:
    image = (texture(5, 7)[:, :, 0] * np.float64(1 if dtype is np.uint8 else 1.5)).astype(dtype)
    assert decoded(pictures.png(pictures.as_rgb(image))).shape == pictures.as_rgb(image).shape == (5, 7, 3)


def test_transparent_parts_are_grey_wide_pictures_fitted_and_the_right_of_an_image_its_map() -> None:
    image = texture(4, 10)
    shown = decoded(image_into_map(image, np.zeros((4, 10), dtype=np.float32), 0, 1))
    assert np.array_equal(shown[:, :4], image[:, :4]) and (shown[:, 4:] == pictures.VIRIDIS[0]).all()
    image = np.dstack((texture(20, 40), np.zeros((20, 40), dtype=np.uint8)))
    assert (pictures.as_rgb(image) == 128).all()
    assert pictures.fitted(image, 10).shape == (5, 10, 3)
    assert pictures.fitted(image, 100).shape == (20, 40, 3)


def test_a_frame_leaves_the_rest_and_the_input_alone_and_is_dashed_in_doubt() -> None:
    picture = texture(60, 80)
    before, match = picture.copy(), TemplateMatch(20, 30, 10, 12, 1.0)
    shown = framed(picture, [match])
    assert np.array_equal(picture, before)
    assert np.array_equal(shown[:10], picture[:10])
    assert np.array_equal(shown[21:29, 31:41], picture[21:29, 31:41])
    dashed, none = framed(picture, [], [match]), framed(picture, [])
    changed = [int((one != none).any(axis=2).sum()) for one in (shown, dashed)]
    assert 0 < changed[1] < changed[0]


def test_corners_are_drawn_on_a_copy_of_the_picture() -> None:
    picture = texture(60, 80)
    before = picture.copy()
    points = np.array([(10.0 + 20 * col, 20.0 + 20 * row) for row in range(2) for col in range(3)])
    assert (with_corners(picture, Corners(np.arange(6), points), Board(3, 2)) != before).any()
    assert np.array_equal(picture, before)


def test_a_frame_is_turned_as_the_template_is() -> None:
    match = TemplateMatch(60, 80, 90, 90, 0.9, 1.0, 30.0)
    shown = framed(np.zeros((200, 300, 3), np.uint8), [match], template=(40, 80))
    rows, cols = np.nonzero(shown.any(axis=2))
    (_, sides, _) = cv2.minAreaRect(np.column_stack([cols, rows]).astype(np.float32))
    assert sorted(sides) == pytest.approx([40, 80], abs=10)
    assert int(cols[rows == rows.min()].mean()) > 125  # counter-clockwise: the upper right corner is the highest


@pytest.mark.parametrize(("row", "col"), [(0, 0), (50, 68), (25, 30)])
def test_a_close_up_stays_within_the_picture_and_is_never_larger(row: int, col: int) -> None:
    assert decoded(match_close_up(texture(60, 80), TemplateMatch(row, col, 10, 12, 1.0))).shape == (480, 640, 3)
    assert max(decoded(match_close_up(texture(2_000, 7), TemplateMatch(0, 0, 1_900, 7, 1.0))).shape) == 640


def test_a_peak_one_place_wide_is_seen_in_a_reduced_score_map() -> None:
    scores = np.zeros((1_000, 2_100), dtype=np.float32)
    scores[511, 1_234] = 1
    scores[600:700, 600:700] = np.nan
    shown = score_map_picture(scores, [])
    assert shown.shape == (334, 700, 3)
    assert shown[170, 411].tolist() == pictures.VIRIDIS[-1].tolist()
    assert tuple(shown[220, 220]) == pictures.NO_ANSWER


def one(dy: float, dx: float, largest: float = 1.0) -> EightBit:
    return pictures.flow_colours(np.full((1, 1), dy, np.float32), np.full((1, 1), dx, np.float32), largest)[0, 0]


def test_directions_have_the_colours_of_the_benchmark() -> None:
    # Right is red, down yellow, left cyan, up violet, as on the wheel of the published code.
    assert tuple(one(0, 1)) == (255, 0, 0, 255)
    assert tuple(one(0, 0)) == (255, 255, 255, 255)
    hues = [colorsys.rgb_to_hsv(*(one(dy, dx)[:3] / 255))[0] * 360 for dy, dx in ((1, 0), (0, -1), (-1, 0))]
    assert 45 < hues[0] < 70 and 170 < hues[1] < 215 and 255 < hues[2] < 300
    assert one(np.nan, 1)[3] == 0 and one(1, np.nan)[3] == 0
    assert one(0, 5)[0] < one(0, 1)[0]  # too much is darker
    with pytest.raises(ValueError, match="largest is 0"):
        one(0, 0, 0)
    wheel = pictures.colour_wheel(12.0, 101)
    assert wheel.shape == (101, 101, 4) and wheel[0, 0, 3] == 0
    np.testing.assert_allclose(wheel[50, 99, :3].astype(int), one(0, 0.98)[:3].astype(int), atol=3)


@given(st.floats(-np.pi, np.pi), st.floats(0.05, 0.95), st.floats(0.1, 100))
def test_longer_motion_is_never_whiter_and_the_unit_does_not_matter(angle: float, length: float, unit: float) -> None:
    down, right = np.sin(angle), np.cos(angle)
    short, long = one(0.9 * length * down, 0.9 * length * right), one(length * down, length * right)
    assert (short.astype(int) >= long.astype(int) - 1).all()
    scaled = one(length * down * unit, length * right * unit, unit)
    assert np.abs(scaled.astype(int) - long).max() <= 2


def test_the_rim_holds_nearly_all_motions() -> None:
    flow = np.random.default_rng(0).normal(0, 7, (2, 50, 60)).astype(np.float32)
    flow[:, :5] = np.nan
    rim = pictures.largest_motion((flow[0], flow[1]))
    assert 0.985 < (np.hypot(*flow)[5:] <= rim).mean() < 1
    assert pictures.largest_motion((np.full((3, 3), np.nan, np.float32),) * 2) == 1


def test_arrows_stand_where_there_is_motion_and_nowhere_else() -> None:
    image = np.full((96, 120), 128, np.uint8)
    dy, dx = np.zeros((96, 120), np.float32), np.full((96, 120), 8, np.float32)
    dx[:, 60:] = np.nan
    changed = (pictures.with_arrows(image, dy, dx, spacing=24) != 128).any(axis=2)
    assert changed[:, :60].any() and not changed[:, 66:].any()
    assert set((np.nonzero(changed)[0] - 12) % 24) <= {*range(6), *range(18, 24)}
    assert changed[12, 12:20].all()
    assert (image == 128).all()


def disc(rows: int, cols: int, dtype: npt.DTypeLike = np.uint8) -> Array:
    """Return a bright disc centred on a dark ground, with a radius of a quarter of the rows."""
    y, x = np.mgrid[:rows, :cols] + 0.5
    inside = np.hypot(x - cols / 2, y - rows / 2) < rows / 4
    return (np.where(inside, 200, 60) / (255 if np.dtype(dtype).kind == "f" else 1)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("shape", [(120, 160), (121, 97), (900, 2 * pictures.EDGE_IMAGE_WIDTH_PX)])
def test_the_edge_of_a_disc_is_one_line_where_the_disc_ends(shape: tuple[int, int], dtype: npt.DTypeLike) -> None:
    (line,) = pictures.edge_lines(disc(*shape, dtype))
    radius = np.hypot(line[:, 0] - shape[1] / 2, line[:, 1] - shape[0] / 2)
    np.testing.assert_allclose(radius, shape[0] / 4, atol=1.6 * max(1.0, shape[1] / pictures.EDGE_IMAGE_WIDTH_PX))
    angles = np.sort(np.arctan2(line[:, 1] - shape[0] / 2, line[:, 0] - shape[1] / 2))
    assert np.diff(angles, append=angles[0] + 2 * np.pi).max() < np.pi / 4


def test_colour_and_grey_have_the_same_edges_and_faint_noise_none() -> None:
    grey = disc(120, 160)
    opaque = np.dstack([grey] * 3 + [np.full_like(grey, 255)])
    assert pictures.edge_path(opaque[:, :, :3]) == pictures.edge_path(opaque) == pictures.edge_path(grey)
    assert pictures.edge_path(np.random.default_rng(1).normal(128, 2, (120, 160)).round().astype(np.uint8)) == ""


def test_too_many_edges_are_bounded_and_the_longest_lines_stay() -> None:
    blots = cv2.GaussianBlur(np.random.default_rng(2).random((800, 800), np.float32), (0, 0), 3)
    cells = np.where(blots > 0.5, 220, 30).astype(np.uint8)
    cells[:, 400:404] = 0
    assert 0.5 * pictures.MAX_POINTS < sum(map(len, pictures.edge_lines(cells))) <= pictures.MAX_POINTS
    assert len(pictures.edge_path(cells)) < 12 * pictures.MAX_POINTS


def test_the_path_of_a_photograph_holds_its_lines() -> None:
    image = example_pair(stereo_pairs()["cube"]).left
    lines, path = pictures.edge_lines(image), pictures.edge_path(image)
    assert path.count("M") == len(lines) > 20
    numbers = np.array(re.findall(r"[\d.]+", path), float).reshape(-1, 2)
    np.testing.assert_allclose(numbers, np.concatenate(lines), atol=0.051)
    assert (numbers >= 0).all() and (numbers <= image.shape[1::-1]).all()


@pytest.mark.parametrize("shape", [(40, 30), (200, 901)])
def test_a_map_is_kept_pixel_for_pixel_above_its_legend(shape: tuple[int, int]) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    page = with_legend(picture, 0, 64, pictures.VIRIDIS, "disparity, px")
    assert page.shape[1] == max(360, shape[1])
    left = (page.shape[1] - shape[1]) // 2
    np.testing.assert_array_equal(page[: shape[0], left : left + shape[1]], picture)
    strip = {tuple(colour) for colour in np.unique(page[shape[0] :].reshape(-1, 3), axis=0).tolist()}
    assert {
        (255, 255, 255),
        pictures.NO_ANSWER,
        tuple(pictures.VIRIDIS[0].tolist()),
        tuple(pictures.VIRIDIS[-1].tolist()),
    } <= strip


@pytest.mark.parametrize(("low", "high"), [(0, 64), (-12, 36), (1.5, 1.6), (0, 4), (3, 1003), (-0.002, 0.001)])
def test_ticks_stand_under_the_colours_of_their_values(low: float, high: float) -> None:
    page = with_legend(np.zeros((10, 900, 3), np.uint8), low, high, pictures.VIRIDIS, "")[10:]
    bar = max(row for row, line in enumerate(page) if (line == pictures.VIRIDIS[0]).all(axis=1).any())
    ticks = np.flatnonzero((page[bar + 3] == 30).all(axis=1))
    assert 3 <= len(ticks) <= 9
    np.testing.assert_allclose(np.diff(ticks), np.diff(ticks).mean(), atol=1)
    assert ticks.min() >= 24 and ticks.max() <= 876
