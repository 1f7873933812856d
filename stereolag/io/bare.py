"""Image files reduced to the parts that their pixels need.

Comments, profiles, previews and further frames cannot slow down a decoder that never sees them, or use up its memory;
and if one of them is broken, the intact image remains readable.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BarePicture:
    """An image file without its metadata.

    Attributes
    ----------
    data
        The file, with only the header and the pixels of the first frame.
    width, height
        As stated in the header, px.
    orientation
        How the camera was held, 1 to 8 as in EXIF; 1 is upright.
    canvas
        (width, height, left, top): the canvas and the frame's position on it, for a WEBP animation; None otherwise.
    """

    data: bytes
    width: int
    height: int
    orientation: int = 1
    canvas: tuple[int, int, int, int] | None = None


def damaged(kind: str) -> ValueError:
    """Return the error for a file whose parts do not fit together."""
    return ValueError(f"The image ({kind}) is damaged or cut short and cannot be decoded; send it whole.")


def too_many(kind: str, parts: str, most: int) -> ValueError:
    """Return the error for a file with more parts than any program writes."""
    return ValueError(f"The image ({kind}) is in too many {parts}: at most {most:,} are accepted; save it again.")
