"""The bundled mazes match their description; the oracle is OpenCV's masked template matching."""

from functools import cache

import cv2
import numpy as np
from PIL import Image

from stereolag.samples import mazes
from tools.maze.__main__ import make_template

EXAMPLES = mazes()


@cache
def load(name):
    example = EXAMPLES[name]
    return np.array(Image.open(example.picture)), np.array(Image.open(example.template))


def packed(pixels):
    """Return one number per colour."""
    return pixels[..., :3].astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)


def behind_the_template(name):
    """Return the part of the picture where Rocketman stands, the template, and which pixels are his."""
    (picture, template), example = load(name), EXAMPLES[name]
    height, width = template.shape[:2]
    window = picture[example.row : example.row + height, example.col : example.col + width]
    return window, template[..., :3], template[..., 3] == 255


def test_rocketman_stands_on_transparent_ground_where_the_report_has_him():
    alpha = load("maze")[1][..., 3]
    assert set(np.unique(alpha)) == {0, 255}
    assert 0.4 < np.mean(alpha == 255) < 0.8
    assert not alpha[[0, 0, -1, -1], [0, -1, 0, -1]].any()
    assert np.array_equal(np.array(make_template()), load("maze")[1])  # the script draws him again
    assert {load(name)[0].shape for name in EXAMPLES} == {(1526, 2446, 3)}
    assert (EXAMPLES["maze"].row, EXAMPLES["maze"].col) == (528, 982)


def test_his_pixels_are_exact_in_the_first_maze_and_decoys_share_every_colour_of_his():
    window, template, his = behind_the_template("maze")
    assert np.array_equal(window[his], template[his])
    values, counts = np.unique(packed(load("maze")[0]), return_counts=True)
    occurrences = dict(zip(values.tolist(), counts.tolist(), strict=True))
    assert min(occurrences[colour] for colour in np.unique(packed(template)[his]).tolist()) > 20


def test_he_is_dulled_and_grainy_in_the_second_maze():
    window, template, his = behind_the_template("maze_dulled")
    exact = np.all(window == template, axis=-1)[his]
    assert exact.mean() < 0.001
    assert window[his].std() < 0.75 * template[his].std()


def test_a_part_of_him_is_covered_in_the_second_maze():
    """Where visible, his brightness follows the template; a cover deviates from the fit by far more than the grain."""
    window, template, his = behind_the_template("maze_dulled")
    seen, wanted = (cv2.blur(pixels.mean(axis=-1), (3, 3))[his] for pixels in (window, template))
    slope, offset = np.polyfit(wanted, seen, 1)
    for _ in range(10):
        fits = np.abs(seen - slope * wanted - offset) < 18
        slope, offset = np.polyfit(wanted[fits], seen[fits], 1)
    assert 0.12 < np.mean(~fits) < 0.3
