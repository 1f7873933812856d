"""Colours that appear together can also be told apart by eyes that lack one type of cone."""

from itertools import combinations

import numpy as np
import pytest
from skimage.color import deltaE_ciede2000, rgb2lab

from stereolag.core.arrays import DoubleMap
from stereolag.figures import maps, recordings
from stereolag.figures.match import RUNNER_UP_COLOUR, SEARCH_COLOUR, TRUTH_COLOUR, WINDOW_COLOUR
from stereolag.figures.pictures import CORRELATION, NO_ANSWER, PEAK, SENSOR_1, SENSOR_2
from stereolag.ui.driving.work import LINES

EYES = {
    "all cones": np.eye(3),
    "no long (protanopia)": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "no middle (deuteranopia)": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "no short (tritanopia)": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
"""Matrices from linear RGB to the perceived linear RGB: Machado, Oliveira and Fernandes (2009), severity 1."""

LEAST = 10.0
"""Least CIEDE2000 difference: 2 is just visible side by side, 10 at a glance."""

PAGES = "#fcfbf9", "#14151b"
LEAST_CONTRAST = 2.7
"""Least contrast of a line or a frame with the page; WCAG requires 3 if nothing else conveys the information."""

Colour = str | tuple[int, int, int]


TOGETHER: dict[str, dict[str, Colour]] = {
    "recordings": {"sensor 1": SENSOR_1, "sensor 2": SENSOR_2},
    "curve": {"curve": CORRELATION, "peak": PEAK},
    "curve in doubt": {"curve": CORRELATION, "doubtful": recordings.DOUBTFUL_COLOUR},
    "agreement": {"all": maps.ALL_AGREE, "some": maps.SOME_AGREE, "none": maps.ALL_DIFFER, "no disparity": NO_ANSWER},
    "reasons": {cause.name: colour for cause, colour in maps.REASON_COLOURS.items()},
    "drive": {str(number): line["colour"] for number, line in enumerate(LINES)},
}

LINES_AND_FRAMES = {
    "window": WINDOW_COLOUR,
    "runner-up": RUNNER_UP_COLOUR,
    "search": SEARCH_COLOUR,
    "truth": TRUTH_COLOUR,
    "curve": CORRELATION,
    **{f"drive {number}": line["colour"] for number, line in enumerate(LINES)},
}


def rgb(colour: Colour) -> DoubleMap:
    parts = tuple(bytes.fromhex(colour[1:])) if isinstance(colour, str) else colour
    return np.asarray(parts, dtype=np.float64) / 255


def linear(colour: Colour) -> DoubleMap:
    shown = rgb(colour)
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def seen(colour: Colour, eyes: str) -> DoubleMap:
    """Return a colour in CIELAB as these eyes see it."""
    light = np.clip(np.asarray(EYES[eyes]) @ linear(colour), 0, 1)
    shown = np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.asarray(rgb2lab(shown[None, None])[0, 0])


def closest(colours: dict[str, Colour], others: dict[str, Colour] | None = None) -> tuple[float, str]:
    """Return the least difference that any eyes see, within one set or between two, with the colours and the eyes."""
    pairs = [(a, b) for a in colours for b in others] if others else list(combinations(colours, 2))
    every = colours | (others or {})
    return min(
        (float(deltaE_ciede2000(seen(every[one], eyes), seen(every[other], eyes))), f"{one}, {other}: {eyes}")
        for eyes in EYES
        for one, other in pairs
    )


def contrast(colour: Colour, page: Colour) -> float:
    """Return the contrast ratio of WCAG 2."""
    low, high = sorted(float(linear(one) @ (0.2126, 0.7152, 0.0722)) for one in (colour, page))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("name", TOGETHER)
def test_colours_that_are_seen_together_can_be_told_apart(name: str) -> None:
    difference, where = closest(TOGETHER[name])
    assert difference >= LEAST, where


def test_reasons_stand_out_of_the_pale_image_and_the_true_place_of_those_found() -> None:
    shades: dict[str, Colour] = {f"grey {level}": (level, level, level) for level in range(96, 224, 16)}
    others = {name: LINES_AND_FRAMES[name] for name in ("window", "runner-up", "search")}
    for colours, around in ((TOGETHER["reasons"], shades), ({"truth": TRUTH_COLOUR}, others)):
        difference, where = closest(colours, around)
        assert difference >= LEAST, where


def test_lines_of_methods_differ_in_more_than_colour() -> None:
    assert len({line["dash"] for line in LINES}) == len(LINES)
    assert len(set(maps.DASHES)) == len(set(maps.SYMBOLS)) == len(maps.METHOD_COLOURS)


@pytest.mark.parametrize("name", LINES_AND_FRAMES)
def test_lines_are_seen_on_both_pages(name: str) -> None:
    assert min(contrast(LINES_AND_FRAMES[name], page) for page in PAGES) >= LEAST_CONTRAST
