"""Pictures, scores and readings packed for scripts in the browser: a JSON header, and the parts it points to."""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image, as_eight_bit, as_grey
from stereolag.core.typography import typeset
from stereolag.figures.legends import Colours, Legend, hexadecimal
from stereolag.figures.pictures import NO_ANSWER, jpeg, png
from stereolag.templates.by_hand import ReducedSearch, ScoreMap, best_of_blocks, block_side

WIDEST = 1600
"""Px; of wider pictures only every second, third … pixel is sent: no screen shows more side by side."""

NOTHING = -32768
"""The int16 code of NaN in data for the browser."""

LONG = -128
"""The int8 code of a step that needs an int16, which is stored separately."""

SCORE_STEPS = 30_000
"""Steps of a score from 0 to 1; code 0 means no score."""

TRUTH_SCALE = 64
"""Steps of the ground truth per px."""

TRUTH_ZERO = 512
"""Offset added to the ground truth, px, to make it positive; values that do not fit count as unknown."""


class Packed(NamedTuple):
    """An item for the browser, and the digest that identifies its content."""

    data: bytes
    digest: str


def packed_item(header: Mapping[str, Any], parts: Sequence[bytes] = ()) -> Packed:
    """Return an item as bytes: the length of its JSON header in four bytes (little-endian), the header, and the parts.

    Added to the header are `parts`, start and length of each part after the header, and `digest` of the content, unless
    the header names another that identifies it.
    """
    ends = np.cumsum([len(part) for part in parts], dtype=int).tolist()
    places = [(end - len(part), len(part)) for end, part in zip(ends, parts, strict=True)]
    digest = header.get("digest") or hashlib.sha256(json.dumps(header).encode() + b"".join(parts)).hexdigest()
    text = json.dumps({**header, "digest": digest, "parts": places}).encode()
    return Packed(len(text).to_bytes(4, "little") + text + b"".join(parts), digest)


def packed_pictures(header: Mapping[str, Any], pictures: Sequence[Rgb | bytes]) -> bytes:
    """Return an item with a PNG for each picture, (rows, cols, 3) uint8 RGB or a PNG, and `steps`, those of a score."""
    parts = [picture if isinstance(picture, bytes) else png(picture) for picture in pictures]
    return packed_item({**header, "steps": SCORE_STEPS}, parts).data


def scores_as_colours(scores: npt.NDArray[np.floating[Any]]) -> Rgb:
    """Return scores of -1..1 as (rows, cols, 3) uint8: red and green are the high and the low byte of the code."""
    return _in_two_bytes(np.where(np.isnan(scores), 0, np.rint((scores + 1) * SCORE_STEPS) + 1))


def _in_two_bytes(codes: npt.NDArray[np.floating[Any]]) -> Rgb:
    high, low = np.divmod(codes.astype(np.uint16), 256)
    return np.stack([high, low, np.zeros_like(low)], axis=-1).astype(np.uint8)


def packed_search(search: ReducedSearch, *, name: str, words: Mapping[str, Any]) -> bytes:
    """Return a search as :func:`packed_pictures`: picture, template, opaque pixels, scores.

    Parameters
    ----------
    search
        The search to send.
    name
        Its name in the browser.
    words
        Texts beside it.
    """
    opaque = np.stack([search.opaque * np.uint8(255)] * 3, axis=-1)
    header = {
        "name": name,
        "factor": search.factor,
        "row": search.row,
        "col": search.col,
        "leaders": [{"row": row, "col": col, "score": score} for row, col, score in search.leaders()],
        "words": dict(words),
    }
    return packed_pictures(header, (search.picture, search.template, opaque, scores_as_colours(search.score_map)))


def packed_score_map(png: bytes, score_map: ScoreMap, *, name: str, words: Mapping[str, Any]) -> bytes:
    """Return a map as :func:`packed_pictures`: picture, best scores and their offsets.

    Parameters
    ----------
    png
        The map as drawn by :func:`~stereolag.figures.templates.score_map_png`.
    score_map
        (rows, cols), NaN = no score.
    name
        Name of the search to which a clicked place is sent.
    words
        Texts below the map.
    """
    factor = block_side(score_map)
    best, down, right = best_of_blocks(score_map, factor)
    offsets = np.stack([down, right, np.zeros_like(down)], axis=-1).astype(np.uint8)
    return packed_pictures(
        {"name": name, "factor": factor, "words": dict(words)}, (png, scores_as_colours(best), offsets)
    )


def packed_grey_pair(left: Image, right: Image, truth: FloatMap | None, *, name: str, digest: str) -> bytes:
    """Return a pair as an item: PNGs of both images, and of the ground truth.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) checked images of the same size and dtype. 8-bit values are kept unchanged.
    truth
        (H, W) disparities, px, NaN = unknown; None if there is no ground truth. Sent as a PNG whose red and green are
        the high and the low byte.
    name, digest
        Name of the place, and digest of the pair, in the browser.
    """
    parts = [png(image) for image in as_eight_bit(as_grey(left), as_grey(right))]
    if truth is not None:
        codes = np.rint((truth.astype(np.float64) + TRUTH_ZERO) * TRUTH_SCALE)
        parts.append(png(_in_two_bytes(np.where((codes > 0) & (codes < 2**16), codes, 0))))
    header = {"kind": "pair", "name": name, "digest": digest, "rows": left.shape[0], "cols": left.shape[1]}
    return packed_item(header, parts).data


@dataclass(frozen=True)
class DepthScale:
    """Constants to convert disparity to metres in the browser: focal length × baseline, px·m, and doffs, px.

    `disparity_error` is the typical error of a disparity, px; 0 leaves the uncertainty out.
    """

    focal_times_baseline: float
    doffs_px: float
    disparity_error: float


def no_depth() -> None:
    """Return None, for readings other than disparities."""


@dataclass(frozen=True, eq=False)
class Reading:
    """A value or word to read at every pixel of a picture.

    Attributes
    ----------
    values
        (rows, cols) float, NaN = nothing to read; or uint8 indices into `words`.
    label, unit, digits
        Text before a number, text after it, and number of decimals.
    words
        The word for each index; an empty word is not shown.
    depth
        For disparities: returns the scale for the depth shown beside them.
    """

    values: npt.NDArray[Any]
    label: str = ""
    unit: str = ""
    digits: int = 2
    words: tuple[str, ...] = ()
    depth: Callable[[], DepthScale | None] = no_depth


class Figure(NamedTuple):
    """A number for a whole picture: its label, its value with unit, and its meaning."""

    label: str
    value: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Picture:
    """One of several pictures of the same size.

    Attributes
    ----------
    title
        Title above the picture.
    pixels
        (rows, cols, 3) uint8 RGB; None for a map, whose first reading the browser colours with the :class:`Colours`
        that all maps share.
    readings
        Values shown below the picture for the pixel under the crosshair.
    figures
        Returns the numbers shown below it for the whole picture; called only after the pixels have been sent.
    photograph
        Whether it is sent as JPEG, with a fifth of the bytes; maps stay exact.
    pickable
        Whether a click on it picks a pixel.
    thumbnail
        Whether it is small at first and enlarges on a click.
    alternative
        Returns its text alternative; read out after the title.
    """

    title: str
    pixels: Rgb | None
    readings: tuple[Reading, ...] = ()
    figures: Callable[[], tuple[Figure, ...]] = tuple
    photograph: bool = False
    pickable: bool = True
    thumbnail: bool = False
    alternative: Callable[[], str] = str


@dataclass(frozen=True)
class PackedPicture:
    """The pixels and readings of a picture, encoded for the browser.

    Attributes
    ----------
    data
        An item with the image and the compressed readings as its parts.
    digest
        Identifies the content.
    shape
        Rows and columns of the whole picture.
    step
        Every `step`-th pixel was sent.
    """

    data: bytes
    digest: str
    shape: tuple[int, int]
    step: int


def packed(picture: Picture) -> PackedPicture:
    """Return the pixels and the readings of a picture as an item.

    Readings are int16 in units of a power of two below their last decimal (or larger if the range requires it), each
    stored as the step from its left neighbour: in smooth maps most steps fit into a byte; long ones follow separately.

    Raises
    ------
    ValueError
        If pixels and readings differ in size, or there are neither.
    """
    arrays = [*([] if picture.pixels is None else [picture.pixels]), *(one.values for one in picture.readings)]
    shapes = {array.shape[:2] for array in arrays}
    if len(shapes) != 1:
        raise ValueError(f"pixels and readings have the shapes {sorted(shapes)}; they must all have one.")
    shape = shapes.pop()
    step = -(-shape[1] // WIDEST)
    parts: list[bytes] = []
    header: dict[str, Any] = {"kind": "pictures", "image": None}
    header["readings"] = [_reading(one, step, parts) for one in picture.readings]
    if picture.pixels is not None:
        pixels = picture.pixels[::step, ::step]
        header |= {"image": len(parts), "type": "image/jpeg" if picture.photograph else "image/png"}
        parts.append(jpeg(pixels) if picture.photograph else png(pixels))
    return PackedPicture(*packed_item(header, parts), shape, step)


def described(
    pictures: Sequence[Picture],
    packs: Sequence[PackedPicture],
    *,
    name: str,
    colours: Colours | None = None,
    legends: Sequence[Legend] = (),
    columns: int = 3,
    hint: str = "",
) -> dict[str, Any]:
    """Return the data for the browser besides the packed pictures, ready for JSON; `name` identifies the set.

    Raises
    ------
    ValueError
        If pictures differ in size, or one has no pixels and there are no colours.
    """
    if colours is None and any(picture.pixels is None for picture in pictures):
        raise ValueError("a picture has no pixels; give the colours that maps share.")
    sizes = {pack.shape for pack in packs}
    if len(sizes) != 1:
        raise ValueError(f"pictures have the sizes {sorted(sizes)}; they must all have one.")
    rows, cols = sizes.pop()
    return {
        "name": name,
        "rows": rows,
        "cols": cols,
        "step": packs[0].step,
        "columns": columns,
        "hint": hint,
        "colours": None
        if colours is None
        else {
            "low": colours.low,
            "high": colours.high,
            "palette": bytes(colours.palette.astype(np.uint8).tobytes()).hex(),
            "none": hexadecimal(NO_ANSWER),
        },
        "pictures": [
            {
                "digest": pack.digest,
                "title": one.title,
                "pickable": one.pickable,
                "thumbnail": one.thumbnail,
                "alternative": typeset(one.alternative()),
                "figures": [figure._replace(value=typeset(figure.value))._asdict() for figure in one.figures()],
                "depths": [asdict(depth) if (depth := reading.depth()) else None for reading in one.readings],
            }
            for one, pack in zip(pictures, packs, strict=True)
        ],
        "legends": [asdict(legend) for legend in legends],
    }


def _reading(reading: Reading, step: int, parts: list[bytes]) -> dict[str, Any]:
    """Add the values of a reading to the parts, and return its description."""
    values = reading.values[::step, ::step]
    quantum = 1.0
    if not reading.words:
        unknown = ~np.isfinite(values)
        scaled = np.where(unknown, np.float32(0), values)
        largest = float(np.abs(scaled).max(initial=0.0))
        fine_enough, to_reach = 10.0**-reading.digits, largest / -(NOTHING + 1)
        quantum = 2.0 ** max(math.floor(math.log2(fine_enough)), math.ceil(math.log2(max(to_reach, 1e-9))))
        scaled *= 1 / quantum
        values = np.rint(scaled, out=scaled).astype("<i2")
        values[unknown] = NOTHING
    else:
        values = values.astype("<i2")
    steps = np.diff(values, axis=1, prepend=np.int16(0))  # int16 overflow cancels when the steps are summed
    long = (steps > 127) | (steps < -127)
    short = np.where(long, np.int16(LONG), steps).astype(np.int8)
    # Steps seldom repeat, which a search for repetitions in every map sent would find out anew; words do.
    strategy = zlib.Z_RLE if reading.words else zlib.Z_HUFFMAN_ONLY
    for one in (short, steps[long]):
        compressor = zlib.compressobj(zlib.Z_BEST_SPEED, strategy=strategy)
        parts.append(compressor.compress(one.data) + compressor.flush())
    return {
        "steps": len(parts) - 2,
        "long_steps": len(parts) - 1,
        "rows": values.shape[0],
        "cols": values.shape[1],
        "quantum": quantum,
        "label": reading.label,
        "unit": reading.unit,
        "digits": reading.digits,
        "words": reading.words,
    }
