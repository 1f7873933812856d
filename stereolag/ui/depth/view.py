"""The data that the parts of the depth page share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from stereolag.core.arrays import Rgb
from stereolag.figures.disparity import FAR_TO_NEAR
from stereolag.figures.linked_pictures import Colours
from stereolag.stereo.matcher import DisparityMap
from stereolag.ui.pairs import StereoPair


@dataclass(frozen=True, eq=False)
class DepthView:
    """One pair, the map of each method, and the colour range that all maps share.

    Attributes
    ----------
    pair
        The images, with truth, mask and calibration if known.
    results
        {name of the method as the page shows it: its map}, in the order shown; its settings are ``result.settings``.
    low, high
        The locked colour range, px of disparity.
    palette
        (256, 3) uint8 RGB from far to near.
    outlines
        Outlines of the left image over the maps, as an SVG path; "" = none.
    """

    pair: StereoPair
    results: Mapping[str, DisparityMap]
    low: float
    high: float
    palette: Rgb = field(default_factory=lambda: FAR_TO_NEAR)
    outlines: str = ""

    @property
    def colours(self) -> Colours:
        """Return the colours that all maps share."""
        return Colours(self.low, self.high, self.palette, self.outlines)
