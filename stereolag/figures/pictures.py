"""Pictures for display: images of limited size, maps and flows in colours, outlines, edges, PNG and JPEG."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import Any, TypeAlias, TypeVar

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from stereolag.core.arrays import DoubleMap, FloatMap, Mask, Rgb, percentiles
from stereolag.core.inputs import Image, check_positive

Scalar = TypeVar("Scalar", bound=np.generic)
Rgba: TypeAlias = npt.NDArray[np.uint8]
"""(H, W, 4) uint8."""

Colour: TypeAlias = tuple[int, int, int]

JPEG_QUALITY = 92

MAX_WIDTH_PX = 1400
"""Width to which pictures are reduced, px: Streamlit would do it slowly, and blend the colours of a map."""

# Visible on both the light and the dark page.
SENSOR_1 = "#3a8fb7"
SENSOR_2 = "#e08138"
CORRELATION = "#8273cf"
PEAK = "#e0447c"

FRAME = (255, 0, 160)
"""Colour of frames in an image: a pink that hardly any image contains."""

WHITE, BLACK = (255, 255, 255), (0, 0, 0)

RANGE_STEP_PX = 4
"""Step to which the ends of a range are rounded, px, so that small changes of a map do not shift its colours."""

NO_ANSWER = (140, 140, 140)
"""Colour of pixels without a value: a neutral grey, which viridis does not contain."""

NO_ANSWER_INDEX = 255
"""Its index in a colour table, after all other colours."""


def as_rgb(image: Image) -> Rgb:
    """Return any image as 8-bit RGB, with transparent parts and pixels without data (NaN) in neutral grey.

    The contrast of 16-bit and float images is stretched, so that they are visible whatever their range.
    """
    if image.dtype != np.uint8:
        low, high = (float(end.reduce(image, axis=None)) for end in (np.fmin, np.fmax))
        scaled = (image.astype(np.float32) - np.float32(low)) * np.float32(255 / (high - low or 1.0))
        image = np.nan_to_num(np.rint(scaled), copy=False, nan=128).astype(np.uint8)
    if image.ndim == 2:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_GRAY2RGB), np.uint8)
    if image.shape[2] == 4:
        opacity = image[:, :, 3:].astype(np.float32) / 255
        return np.rint(image[:, :, :3] * opacity + 128 * (1 - opacity)).astype(np.uint8)
    return image


def brightness(image: Image) -> npt.NDArray[np.uint8]:
    """Return an image as displayed, in grey: (H, W) uint8."""
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(as_rgb(image)), cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def fitted(image: Image, width: int = MAX_WIDTH_PX) -> Rgb:
    """Return the image as RGB, reduced if it is wider than `width` px."""
    picture = as_rgb(image)
    if picture.shape[1] <= width:
        return picture
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def thinned(values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """Return every second, third … row and column of an array wider than :data:`MAX_WIDTH_PX`.

    For maps: the mean colour of several pixels would represent a value that none of them has.
    """
    every = -(-values.shape[1] // MAX_WIDTH_PX)
    return values[::every, ::every]


def disparity_range(maps: Sequence[FloatMap]) -> tuple[float, float]:
    """Return the disparities, px, at the ends of the colour range: the 1st and the 99th percentile, rounded outwards.

    Given only the ground truth, the range does not depend on the settings; given the maps to compare, they share one.
    """
    known = np.concatenate([np.empty(0, dtype=np.float32), *(one[np.isfinite(one)] for one in map(thinned, maps))])
    if known.size == 0:
        return 0.0, float(RANGE_STEP_PX)
    low, high = percentiles(known, 1, 99)
    first = np.floor(low / RANGE_STEP_PX) * RANGE_STEP_PX
    return float(first), float(max(np.ceil(high / RANGE_STEP_PX) * RANGE_STEP_PX, first + RANGE_STEP_PX))


def png(picture: npt.NDArray[np.uint8]) -> bytes:
    """Return a grey, RGB or RGBA image as the bytes of a PNG, compressed as fast as possible."""
    if picture.ndim == 3:
        code = cv2.COLOR_RGBA2BGRA if picture.shape[2] == 4 else cv2.COLOR_RGB2BGR
        picture = np.asarray(cv2.cvtColor(np.ascontiguousarray(picture), code), dtype=np.uint8)
    return cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()


def jpeg(picture: Rgb) -> bytes:
    """Return an RGB photograph as the bytes of a visually identical JPEG."""
    bgr = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()


def data_url(data: bytes) -> str:
    """Return the data URL of a PNG or JPEG, which contains the picture itself."""
    kind = "png" if data.startswith(b"\x89PNG") else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def palette(colour_map: int) -> Rgb:
    """Return one of OpenCV's colour maps as (256, 3) uint8 RGB."""
    ramp = np.arange(256, dtype=np.uint8)
    return np.asarray(cv2.applyColorMap(ramp, colour_map).reshape(256, 3)[:, ::-1], dtype=np.uint8)


VIRIDIS = palette(cv2.COLORMAP_VIRIDIS)


def coloured(values: npt.NDArray[np.floating[Any]], low: float, high: float, colours: Rgb = VIRIDIS) -> Rgb:
    """Return an array as an image: the first colour at `low`, the last at `high`, NaN grey.

    Parameters
    ----------
    values
        (rows, cols); values beyond `low` or `high` get the colour of that end.
    low, high
        ``low < high``.
    colours
        (256, 3) uint8 RGB.

    Returns
    -------
    picture
        (rows, cols, 3) uint8 RGB.
    """
    # Indexing the colours with an array takes ten times as long.
    table = colour_table(colours)[:, None]
    return np.asarray(cv2.applyColorMap(colour_numbers(values, low, high), table), dtype=np.uint8)


def colour_numbers(values: npt.NDArray[np.floating[Any]], low: float, high: float) -> npt.NDArray[np.uint8]:
    """Return the index of each value in a :func:`colour_table`: 0 at `low`, 254 at `high`, 255 for no value."""
    # In place: otherwise every movement of a slider would allocate memory for each intermediate array.
    share: npt.NDArray[np.float32] = np.subtract(values, low, dtype=np.float32, casting="same_kind")
    share *= np.float32((NO_ANSWER_INDEX - 1) / (high - low))
    np.fmax(share, 0, out=share)
    np.fmin(share, NO_ANSWER_INDEX - 1, out=share)
    share += np.float32(0.5)
    numbers = share.astype(np.uint8)
    np.copyto(numbers, NO_ANSWER_INDEX, where=~np.isfinite(values))
    return numbers


def colour_table(colours: Rgb) -> Rgb:
    """Return (256, 3) uint8 RGB: a ramp of 256 colours sampled at 255, then the grey of no disparity."""
    return np.vstack([colours[np.rint(np.linspace(0, 255, NO_ANSWER_INDEX)).astype(np.intp)], [NO_ANSWER]]).astype(
        np.uint8
    )


WHEEL_PARTS = ((15, (1, 0, 0)), (6, (1, 1, 0)), (4, (0, 1, 0)), (11, (0, 1, 1)), (13, (0, 0, 1)), (6, (1, 0, 1)))
"""Parts of the colour wheel: number of colours, and the first one, which fades into that of the next part."""

BEYOND_BRIGHTNESS = 0.75
"""Brightness factor of motions longer than the largest: darker than all others."""

OUTLINE_PX = 2
"""Additional thickness of an arrow's dark outline, px, which makes it visible on light and dark pictures."""


@cache
def _wheel() -> npt.NDArray[np.float64]:
    """Return the colour wheel as (55, 3) RGB, 0..1, red first."""
    fades = []
    for (count, first), (_, following) in pairwise([*WHEEL_PARTS, WHEEL_PARTS[0]]):
        share = np.arange(count)[:, None] / count
        fades.append((1 - share) * first + share * following)
    return np.concatenate(fades)


def largest_motion(*flows: tuple[FloatMap, FloatMap]) -> float:
    """Return the length at the rim of the colour wheel, px.

    It is the 99th percentile of the lengths, rounded up to half a unit of its first digit.

    Each flow is (dy, dx), NaN = none.
    """
    lengths = np.concatenate([np.hypot(dy, dx)[np.isfinite(dx)] for dy, dx in flows])
    longest = max(float(np.percentile(lengths, 99)), 1e-3) if lengths.size else 1.0
    unit = 10.0 ** np.floor(np.log10(longest)) / 2
    return float(np.ceil(longest / unit - 1e-9) * unit)


def flow_colours(dy: FloatMap, dx: FloatMap, largest: float) -> Rgba:
    """Return a flow as an image: direction as hue, length as saturation.

    Parameters
    ----------
    dy, dx
        (H, W) px, downwards and to the right; NaN = none.
    largest
        Length with full colour, px; longer motions are darker.

    Returns
    -------
    ndarray
        (H, W, 4) uint8 RGBA; transparent where no motion is known.

    Raises
    ------
    ValueError
        If `largest` is not finite and above 0.

    Notes
    -----
    The published colour code of S. Baker, D. Scharstein, J. Lewis, S. Roth, M. Black & R. Szeliski, "A database and
    evaluation methodology for optical flow", IJCV 92, 2011.
    """
    check_positive(largest, "largest", "px")
    known = np.isfinite(dy) & np.isfinite(dx)
    down, right = (np.where(known, part, 0).astype(np.float64) / largest for part in (dy, dx))
    wheel = _wheel()
    length = np.hypot(down, right)
    place = (np.arctan2(-down, -right) / np.pi + 1) / 2 * (len(wheel) - 1)
    before = place.astype(np.intp)
    share = (place - before)[..., None]
    colour = (1 - share) * wheel[before] + share * wheel[(before + 1) % len(wheel)]
    radius = length[..., None]
    colour = np.where(radius <= 1, 1 - radius * (1 - colour), colour * BEYOND_BRIGHTNESS)
    picture = np.empty((*dy.shape, 4), np.uint8)
    picture[..., :3] = np.floor(255 * colour)
    picture[..., 3] = np.where(known, 255, 0)
    return picture


def with_arrows(image: Image, dy: FloatMap, dx: FloatMap, *, spacing: int = 24) -> Rgb:
    """Return the image with an arrow every `spacing` px from a pixel to where it moves.

    Parameters
    ----------
    image
        (H, W) or (H, W, 3 | 4), the first frame.
    dy, dx
        (H, W) px; no arrow where NaN.
    spacing
        Distance between the arrows, px.

    Returns
    -------
    ndarray
        (H, W, 3) uint8 RGB; each arrow is coloured by its direction.
    """
    picture = np.ascontiguousarray(as_rgb(image)).copy()
    rows, cols = dx.shape
    row, col = np.mgrid[spacing // 2 : rows : spacing, spacing // 2 : cols : spacing]
    starts = np.stack([row, col, dy[row, col], dx[row, col]], axis=-1).reshape(-1, 4)
    starts = starts[np.isfinite(starts).all(axis=1)]
    lengths = np.hypot(starts[:, 2], starts[:, 3])
    down, right = (starts[:, 2:].T / np.maximum(lengths, 1e-6)).astype(np.float32)[..., None]
    hues = flow_colours(down, right, 1 + 1e-6)
    thickness = max(1, spacing // 16)
    for (y, x, dy_here, dx_here), length, hue in zip(starts, lengths, hues[:, 0, :3], strict=True):
        start, end = (round(x), round(y)), (round(x + dx_here), round(y + dy_here))
        tip = min(0.4, 6 / max(length, 1e-6))
        for colour, width in ((BLACK, thickness + OUTLINE_PX), (tuple(int(part) for part in hue), thickness)):
            if start == end:
                cv2.circle(picture, start, width, colour, -1, cv2.LINE_AA)
            else:
                cv2.arrowedLine(picture, start, end, colour, width, cv2.LINE_AA, tipLength=tip)
    return picture


def colour_wheel(largest: float, size: int = 160) -> Rgba:
    """Return the wheel of all directions, `largest` px at its rim, (size, size, 4), transparent around it."""
    radius = (size - 1) / 2
    row, col = np.mgrid[:size, :size].astype(np.float32)
    dy, dx = (row - radius) / radius * largest, (col - radius) / radius * largest
    outside = np.hypot(dy, dx) > largest
    return flow_colours(np.where(outside, np.nan, dy), np.where(outside, np.nan, dx), largest)


TEXT_HEIGHT_SHARE = 1 / 34
"""Text height as a share of the picture width: a page shows the picture at half its size."""


def with_outlines(image: Image, objects: Iterable[tuple[Mask, str]]) -> Rgb:
    """Return the image, (H, W, 3) uint8, with objects outlined in pink and labelled above.

    `objects` gives the (H, W) pixels of each, and its label; "" = none.
    """
    picture = np.array(as_rgb(image))
    cols = picture.shape[1]
    outlines = [
        (cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0], label)
        for mask, label in objects
    ]
    for parts, _ in outlines:
        cv2.polylines(picture, parts, True, FRAME, max(1, round(cols / 400)), cv2.LINE_AA)
    from PIL import ImageDraw, ImageFont  # 40 ms to load

    canvas = PillowImage.fromarray(picture)
    size = max(11, round(cols * TEXT_HEIGHT_SHARE))
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(size)
    for parts, label in outlines:
        if label and parts:
            left, top, width, _ = cv2.boundingRect(np.concatenate(parts))
            half = draw.textlength(label, font) / 2
            middle = float(np.clip(left + (width - 1) / 2, half, max(half, cols - half)))
            place = middle, max(top - size / 4, 1.1 * size)
            draw.text(place, label, WHITE, font, anchor="ms", stroke_width=max(2, size // 8), stroke_fill=BLACK)
    return np.array(canvas)


EDGE_IMAGE_WIDTH_PX = 800
"""Width to which photographs are reduced before edges are detected, px: finer edges would be too dense to be lines."""

BLUR_PX = 2.0
"""Standard deviation of the blur that removes noise and fine texture, px."""

STRONG_EDGE_SHARE = 0.07
"""Share of the pixels, those with the strongest gradients, at which an edge may start: Canny's high threshold."""

WEAK_EDGE_FRACTION = 0.4
"""Canny's low threshold, down to which an edge continues, as a fraction of the high one."""

MIN_GRADIENT = 24
"""Least high threshold, in units of the Sobel filter: a step of about six grey levels."""

MIN_LENGTH_SHARE = 0.04
"""Least length of a line, as a share of the width."""

MAX_POINTS = 8_000
"""Largest number of points of all lines together, of which the longest are kept."""

MAX_DEVIATION_PX = 0.9
"""Largest deviation of a line from the pixels of its edge, px."""

NEIGHBOUR_OFFSETS = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1))


def edge_lines(image: Image) -> list[DoubleMap]:
    """Return the edges of an image (Canny's), the longest first.

    Parameters
    ----------
    image
        (H, W), (H, W, 3) or (H, W, 4) of any dtype.

    Returns
    -------
    list of ndarray
        Open lines, each (n, 2) float64 of (column, row), px; the centre of the first pixel is (0.5, 0.5).
    """
    grey = brightness(image)
    rows, cols = grey.shape
    width = min(cols, EDGE_IMAGE_WIDTH_PX)
    height = max(1, round(rows * width / cols))
    small = cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
    scale = cols / width, rows / height
    long_enough = [chain for chain in _chains(_edges(np.asarray(small))) if len(chain) >= MIN_LENGTH_SHARE * width]
    lines, points = [], 0
    for chain in sorted(long_enough, key=len, reverse=True):
        line = cv2.approxPolyDP(np.array(chain, np.int32)[:, None, ::-1], MAX_DEVIATION_PX, False)[:, 0]
        points += len(line)
        if points > MAX_POINTS:
            break
        lines.append((line + 0.5) * scale)
    return lines


def edge_path(image: Image) -> str:
    """Return :func:`edge_lines` as an SVG path, px to one decimal; "" for an image without edges."""
    return "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in line) for line in edge_lines(image))


def _edges(grey: npt.NDArray[np.uint8]) -> Mask:
    """Return the edge pixels of an (H, W) image; edges are one pixel wide."""
    smooth = cv2.GaussianBlur(grey, (0, 0), BLUR_PX)
    dx, dy = (cv2.Sobel(smooth, cv2.CV_16S, *order, borderType=cv2.BORDER_REPLICATE) for order in ((1, 0), (0, 1)))
    strength = np.hypot(dx.astype(np.float32), dy.astype(np.float32))
    high = max(float(np.quantile(strength, 1 - STRONG_EDGE_SHARE)), MIN_GRADIENT)
    return np.asarray(cv2.Canny(dx, dy, WEAK_EDGE_FRACTION * high, high, L2gradient=True) > 0)


def _chains(edges: Mask) -> Iterator[list[tuple[int, int]]]:
    """Yield chains of adjacent edge pixels, (row, col), each pixel once; from the ends of lines first."""
    remaining = {(int(row), int(col)) for row, col in np.argwhere(edges)}

    def neighbours(pixel: tuple[int, int]) -> list[tuple[int, int]]:
        return [at for down, right in NEIGHBOUR_OFFSETS if (at := (pixel[0] + down, pixel[1] + right)) in remaining]

    for start in sorted(remaining, key=lambda pixel: len(neighbours(pixel)) > 1):
        if start not in remaining:
            continue
        chain = [start]
        remaining.remove(start)
        while following := neighbours(chain[-1]):
            chain.append(following[0])
            remaining.remove(following[0])
        yield chain
