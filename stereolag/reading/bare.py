"""An image file without everything that its pixels do not need.

A decoder that never sees comments, profiles, previews or further frames cannot be slowed down or filled up by them,
and a broken one of them does not make an intact image unreadable.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BarePicture:
    """An image file without its metadata.

    Attributes
    ----------
    data
        The file: the header and the pixels of the first frame alone.
    width, height
        As its header states, px.
    orientation
        How the camera was held, 1 to 8 as in EXIF; 1 is upright.
    canvas
        (width, height, left, top): the canvas the frame lies on and where, for a WEBP animation; None otherwise.
    """

    data: bytes
    width: int
    height: int
    orientation: int = 1
    canvas: tuple[int, int, int, int] | None = None


def damaged(kind: str) -> ValueError:
    """Return the refusal of a file whose parts do not fit together."""
    return ValueError(f"The image ({kind}) is damaged or cut short and cannot be decoded; send it whole.")


def too_many(kind: str, parts: str, most: int) -> ValueError:
    """Return the refusal of a file in more parts than any program writes."""
    return ValueError(f"The image ({kind}) is in too many {parts}: at most {most:,} are accepted; save it again.")
