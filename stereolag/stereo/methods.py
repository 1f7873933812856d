"""The stereo methods and their presets: a new one is listed here and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

from stereolag.stereo.finishing.stages import LeftRightCheck, MedianFilter, SpeckleFilter, TextureTest
from stereolag.stereo.finishing.surfaces import SurfaceFilling
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea

METHODS: list[type[StereoMatcher]] = [CorrelationMatcher, StereoBM, StereoSGBM, SemiGlobalMatcher]
"""All methods, in the order of the page; an address without a method means the first."""

PresetName = Literal["report", "fast", "accurate"]


class Preset(NamedTuple):
    """Matcher settings for one purpose: heading on the page, description, and factory.

    `make` takes the first disparity and the number of disparities, px.
    """

    title: str
    meaning: str
    make: Callable[[int, int], StereoMatcher]


PRESETS: dict[PresetName, Preset] = {
    "report": Preset(
        "The report’s",
        "The source report’s method: windows of 20 px, each searched for within its own 20 px; far objects are bright.",
        lambda first, count: CorrelationMatcher(window_size=20, overlap=0.9, search=SearchArea.centred(20)),
    ),
    "fast": Preset(
        "Fast",
        "Every pixel by the best match of its window, checked, filled and smoothed.",
        lambda first, count: CorrelationMatcher(
            window_size=11,
            search=SearchArea.rectified(count, first),
            texture=TextureTest(),
            left_right=LeftRightCheck(),
            speckle=SpeckleFilter(),
            filling=True,
            median=MedianFilter(),
        ),
    ),
    "accurate": Preset(
        "Accurate",
        "Correlation with census and gradient, optimised along eight paths; takes longer.",
        lambda first, count: SemiGlobalMatcher(
            num_disparities=count,
            min_disparity=first,
            left_right=LeftRightCheck(),
            speckle=SpeckleFilter(),
            filling=True,
            surfaces=SurfaceFilling(),
            median=MedianFilter(),
        ),
    ),
}


def preset(name: PresetName, num_disparities: int = 64, min_disparity: int = 0) -> StereoMatcher:
    """Return a matcher with the settings of a preset.

    Parameters
    ----------
    name
        "report": as for the source report's depth maps (Figs. 3.3, 3.5, 4.2): windows of 20 px, overlap 0.9, search
        area 20 px; unpadded, so it wraps around and reaches ±10 px whatever the range. "fast": the best ZNCC match of
        every pixel's window, checked, filled and smoothed, in a few hundredths of a second. "accurate": correlation
        combined with census and gradient, semi-global optimisation, checked, filled and smoothed.
    num_disparities, min_disparity
        Range of disparities searched, px.

    Raises
    ------
    ValueError
        Unknown name, or a range that is not allowed.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> cube = samples.stereo_pairs()["cube"]
    >>> matcher = sl.preset("fast", num_disparities=64)  # px
    >>> matcher.compute(sl.read_image(cube.left), sl.read_image(cube.right))
    <DisparityMap 640 × 480, 83.6 % measured, by CorrelationMatcher in ... s>
    """
    if name not in PRESETS:
        raise ValueError(f"preset is {name!r}; allowed are {', '.join(map(repr, PRESETS))}.")
    return PRESETS[name].make(min_disparity, num_disparities)
