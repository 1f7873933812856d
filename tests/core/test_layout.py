"""One picture with both views: divided as it is, whatever the layout; what holds no two views is refused by name."""

import cv2
import numpy as np
import pytest
from PIL import Image

from benchmarks.picture_bytes import by_pillow
from stereolag.assess.layout import Anaglyph, Layout, likely_layout, views
from stereolag.pair_sources import OneView, read_views


def scene(rows: int = 144, cols: int = 256) -> tuple[np.ndarray, np.ndarray]:
    """Return two views of a textured wall with a board before it."""
    noise = np.random.default_rng(0).integers(0, 256, (rows, cols + 40), dtype=np.uint8)
    wall = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 1.5), None, 0, 255, cv2.NORM_MINMAX)  # type: ignore[call-overload]
    wall = np.dstack([wall, wall, 255 - wall // 2])
    left, right = wall[:, 10 : 10 + cols].copy(), wall[:, 14 : 14 + cols].copy()
    board = wall[::-1][40:100, 60:140]
    left[40:100, 100:180] = right[40:100, 90:170] = board
    return left, right


LEFT, RIGHT = scene()


def file(picture: np.ndarray, kind: str = "PNG", *more: np.ndarray) -> bytes:
    others = [Image.fromarray(one) for one in more]
    return by_pillow(kind, picture, **({"save_all": True, "append_images": others} if more else {}))


@pytest.mark.parametrize(("layout", "crossed"), [(layout, crossed) for layout in Layout for crossed in (False, True)])
def test_views_are_found_where_they_stand(layout: Layout, crossed: bool) -> None:
    across = "beside" in layout
    both = np.concatenate([RIGHT, LEFT] if crossed else [LEFT, RIGHT], axis=int(across))
    rows, cols = LEFT.shape[:2]
    if layout.startswith("half"):
        both = cv2.resize(both, (cols, rows), interpolation=cv2.INTER_AREA)
    assert likely_layout(both) == (layout, crossed)
    left, right, said = read_views(file(both))
    assert left.shape == right.shape == LEFT.shape
    assert np.abs(left.astype(int) - LEFT).mean() < (8 if layout.startswith("half") else 1e-9)
    assert ("The right view comes first." in said) == crossed
    np.testing.assert_array_equal(views(both, layout)[int(crossed)], left)


@pytest.mark.parametrize("seed", range(4))
def test_a_wall_of_windows_is_one_view_and_two_of_it_are_two(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wall = 140 + 12 * cv2.GaussianBlur(rng.standard_normal((360, 680)), (0, 0), 1.2)
    across, down = rng.integers(40, 90, 2)
    for row, col in np.ndindex(360 // down, 680 // across):
        window = slice(row * down, row * down + down // 2), slice(col * across, col * across + across // 2)
        wall[window] = rng.uniform(20, 110)
    seen = [np.clip(wall[:, at : at + 640] + rng.normal(0, 2, (360, 640)), 0, 255).astype(np.uint8) for at in (0, 20)]
    assert likely_layout(seen[0]) is None
    assert likely_layout(np.hstack(seen)) == (Layout.BESIDE, False)


@pytest.mark.parametrize("shape", [(4, 2), (4, 3, 3), (4, 10), (4, 11, 4)])
def test_what_is_odd_is_left_out_in_the_middle(shape: tuple[int, ...]) -> None:
    image, cols = np.random.default_rng(0).integers(0, 255, shape, dtype=np.uint8), shape[1]
    left, right = views(image, Layout.BESIDE)
    np.testing.assert_array_equal(left, image[:, : cols // 2])
    np.testing.assert_array_equal(right, image[:, cols - cols // 2 :])
    with pytest.raises(ValueError, match="1 pixel wide; at least 2"):
        views(image[:, :1], Layout.BESIDE)


@pytest.mark.parametrize("kind", ["MPO", "TIFF", "HEIF"])
def test_two_frames_of_a_file_are_the_views(kind: str) -> None:
    left, right, said = read_views(file(LEFT, kind, RIGHT))
    assert said.startswith("The image holds two frames")
    for found, view in ((left, LEFT), (right, RIGHT)):
        assert np.abs(found.astype(int) - view).mean() < 12  # an MPO is two JPEGs


def test_what_holds_no_two_views_is_refused_by_name() -> None:
    with pytest.raises(Anaglyph, match="anaglyph"):
        read_views(file(np.dstack([LEFT[:, :, 0], RIGHT[:, :, 0], RIGHT[:, :, 0]])))
    # Another picture of a phone's JPEG is a preview: not another view.
    for one_view in (file(LEFT), file(LEFT, "MPO", RIGHT[::4, ::4])):
        with pytest.raises(OneView, match="holds one view"):
            read_views(one_view)


@pytest.mark.parametrize("ink", [None, (20, 20, 20), (220, 20, 20)])
def test_a_blank_picture_and_a_page_of_text_are_no_anaglyph(ink: tuple[int, int, int] | None) -> None:
    """So begins a video that is faded in."""
    page = np.full((240, 320, 3), 0 if ink is None else 250, dtype=np.uint8)
    if ink is not None:
        cv2.putText(page, "Hello", (50, 100), cv2.FONT_HERSHEY_SIMPLEX, 1.5, ink, 3)
    assert likely_layout(page) is None


@pytest.mark.parametrize("layout", [Layout.BESIDE, Layout.OVER_UNDER])
def test_a_frame_around_the_views_and_a_gap_between_them_do_not_displace_them(layout: Layout) -> None:
    axis = int(layout is Layout.BESIDE)
    gap = np.zeros_like(LEFT[:, :24] if axis else LEFT[:24])
    both = np.pad(np.concatenate([LEFT, gap, RIGHT], axis), ((9, 9), (9, 9), (0, 0)))
    left, right, said = read_views(file(both))
    assert likely_layout(both) == (layout, False)
    assert "Blank margins are left out" in said
    for found, view in ((left, LEFT), (right, RIGHT)):
        np.testing.assert_array_equal(found, view)
