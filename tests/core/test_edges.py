"""The edges of a photograph as lines."""

from __future__ import annotations

import re

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag.figures.pictures import (
    LOOKED_AT,
    MOST_POINTS,
    edge_lines,
    edge_path,
)
from stereolag.pair import example_pair
from stereolag.samples import stereo_pairs


def disc(rows: int, cols: int, dtype: npt.DTypeLike = np.uint8) -> npt.NDArray[np.generic]:
    """Return a bright disc centred on a dark ground, with a radius of a quarter of the rows."""
    y, x = np.mgrid[:rows, :cols] + 0.5
    inside = np.hypot(x - cols / 2, y - rows / 2) < rows / 4
    return (np.where(inside, 200, 60) / (255 if np.dtype(dtype).kind == "f" else 1)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("shape", [(120, 160), (121, 97), (900, 2 * LOOKED_AT)])
def test_the_edge_of_a_disc_is_one_line_where_the_disc_ends(shape: tuple[int, int], dtype: npt.DTypeLike) -> None:
    (line,) = edge_lines(disc(*shape, dtype))
    radius = np.hypot(line[:, 0] - shape[1] / 2, line[:, 1] - shape[0] / 2)
    pixel = max(1.0, shape[1] / LOOKED_AT)
    np.testing.assert_allclose(radius, shape[0] / 4, atol=1.6 * pixel)
    angles = np.sort(np.arctan2(line[:, 1] - shape[0] / 2, line[:, 0] - shape[1] / 2))
    assert np.diff(angles, append=angles[0] + 2 * np.pi).max() < np.pi / 4


def test_colours_of_equal_brightness_aside_colour_and_grey_have_the_same_edges() -> None:
    grey = disc(120, 160)
    opaque = np.dstack([grey] * 3 + [np.full_like(grey, 255)])
    for image in (opaque[:, :, :3], opaque):
        assert edge_path(image) == edge_path(grey)


def test_a_wall_and_faint_noise_have_no_edges() -> None:
    noise = np.random.default_rng(1).normal(128, 2, (120, 160)).round().astype(np.uint8)
    assert edge_lines(np.full((120, 160), 90, np.uint8)) == []
    assert edge_path(noise) == ""


def test_what_is_too_much_to_draw_is_bounded_and_the_longest_lines_stay() -> None:
    blots = cv2.GaussianBlur(np.random.default_rng(2).random((800, 800), np.float32), (0, 0), 3)
    cells = np.where(blots > 0.5, 220, 30).astype(np.uint8)
    cells[:, 400:404] = 0
    lines = edge_lines(cells)
    assert 0.5 * MOST_POINTS < sum(map(len, lines)) <= MOST_POINTS
    assert len(edge_path(cells)) < 12 * MOST_POINTS


def test_the_path_of_a_photograph_holds_its_lines() -> None:
    image = example_pair(stereo_pairs()["cube"]).left
    lines, path = edge_lines(image), edge_path(image)
    assert path.count("M") == len(lines) > 20
    numbers = np.array(re.findall(r"[\d.]+", path), float).reshape(-1, 2)
    np.testing.assert_allclose(numbers, np.concatenate(lines), atol=0.051)
    assert (numbers >= 0).all()
    assert (numbers <= image.shape[1::-1]).all()
