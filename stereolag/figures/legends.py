"""Colour legends beside a picture."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Rgb
from stereolag.core.typography import typeset
from stereolag.figures.flow import colour_wheel
from stereolag.figures.pictures import NO_ANSWER, rgba_png
from stereolag.geometry.calibration import Calibration

WHEEL_PX = 144
"""Diameter of the wheel, shown at half that size."""

MOST_STEPS = 5
"""Most steps between the values along a legend."""

Ticks = Callable[[float], str] | None


@dataclass(frozen=True)
class Legend:
    """A colour legend: a strip with values along it, or one word for each colour.

    Attributes
    ----------
    title
        The quantity shown, with its unit.
    colours
        CSS colours.
    words
        One for each colour; for a strip, those at its two ends.
    strip
        Whether the colours form a continuous strip.
    ticks
        Values along the strip: (share of its length, word, word below it).
    picture
        Data URL of a picture used instead of a strip, such as a wheel; "" = none.
    """

    title: str
    colours: tuple[str, ...]
    words: tuple[str, ...]
    strip: bool
    ticks: tuple[tuple[float, str, str], ...] = ()
    picture: str = ""


def strip_legend(
    title: str, low: float, high: float, palette: Rgb, *, ends: tuple[str, str] = ("", ""), below: Ticks = None
) -> Legend:
    """Return the legend of a (256, 3) palette from `low` to `high`, with ticks at round values.

    `ends` are written at its ends; `below` returns a second word for a value, such as metres for a disparity.
    """
    ticks = tuple(
        ((value - low) / (high - low), typeset(f"{value:g}"), below(value) if below else "")
        for value in round_values(low, high, MOST_STEPS)
    )
    return Legend(title, tuple(hexadecimal(colour) for colour in palette[::17]), ends, True, ticks)


def word_legend(title: str, colours: Sequence[str], words: Sequence[str]) -> Legend:
    """Return the legend of CSS colours with one word each."""
    return Legend(title, tuple(colours), tuple(words), False)


def wheel_legend(title: str, largest: float) -> Legend:
    """Return the legend of flow colours: the wheel of all directions, `largest` px at its rim."""
    data = base64.b64encode(rgba_png(colour_wheel(largest, WHEEL_PX))).decode()
    return Legend(
        title, (), (typeset(f"white: none, rim: {largest:g} px"),), False, picture=f"data:image/png;base64,{data}"
    )


def hexadecimal(colour: Sequence[int] | npt.NDArray[np.uint8]) -> str:
    """Return an RGB colour as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*(int(part) for part in colour))


def round_values(low: float, high: float, most_steps: int = 8) -> list[float]:
    """Return the multiples of 1, 2 or 5 times a power of ten from low to high, in at most `most_steps` steps."""
    power = 10 ** math.floor(math.log10((high - low) / most_steps))
    step = next(factor * power for factor in (1, 2, 5, 10) if (high - low) / (factor * power) <= most_steps)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{number * step:.12g}") for number in range(first, last + 1)]


def disparity_legends(low: float, high: float, palette: Rgb, calibration: Calibration | None) -> tuple[Legend, ...]:
    """Return the legends of disparity maps: disparity, metres if calibrated, and the grey of no disparity."""

    def metres(disparity: float) -> str:
        depth = float("nan") if calibration is None else float(calibration.depth(disparity))
        return typeset(f"{depth:.3g} m") if depth == depth else "∞" if calibration else ""

    return (
        strip_legend(
            "disparity, px" + (", and distance" if calibration else ""),
            low,
            high,
            palette,
            ends=("FAR", "NEAR"),
            below=metres if calibration else None,
        ),
        word_legend("", [hexadecimal(NO_ANSWER)], ["no disparity"]),
    )
