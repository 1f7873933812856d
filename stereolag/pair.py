"""A stereo pair: two images of one scene, what is known about them, and the changes made to them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Self

from stereolag.assess.remedies import Remedy
from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image
from stereolag.geometry.calibration import Calibration


class ChangeCode(StrEnum):
    """The kinds of changes made to a pair after its files were read, but the remedies."""

    ASSEMBLED = "assembled"
    """The files were made to fit each other."""
    RESIZED = "resized"
    RECTIFIED = "rectified"
    """The pair was rectified with its calibration, or found to be rectified already."""


@dataclass(frozen=True)
class Change:
    """A change made to a pair after its files were read: its kind, or the doctor's remedy, and its description."""

    code: ChangeCode | Remedy
    sentence: str


@dataclass(frozen=True)
class PairId:
    """What identifies a pair and the changes made to its images; every key of what is kept about it derives from it.

    Attributes
    ----------
    images
        The two images as given: a digest of their files, or the name of an example.
    extras
        Digest of the files that belong to them besides: their ground truth; "" if there are none.
    collection
        The set of pairs it belongs to, which shares its settings; "" for a single pair.
    size
        The change of its size; "" at its own size.
    rectification
        The rectification with its calibration; "" if it was not rectified.
    remedies
        The input doctor's remedies, in the order applied.
    """

    images: str
    extras: str = ""
    collection: str = ""
    size: str = ""
    rectification: str = ""
    remedies: tuple[Remedy, ...] = ()

    @property
    def files(self) -> str:
        """Return the key of the pair as read."""
        return _joined(self.images, self.extras)

    @property
    def chosen(self) -> str:
        """Return the key of the visitor's choice: the images alone, or the set of pairs."""
        return self.collection or self.images

    @property
    def searched(self) -> str:
        """Return the key of the two images at their size; the range in use is kept under it, whatever else is added."""
        return _joined(self.images, self.size)

    @property
    def untreated(self) -> str:
        """Return the key of the pair before any remedy; its remedies are kept under it."""
        return _joined(self.files, self.size, self.rectification)

    @property
    def exact(self) -> str:
        """Return the key of exactly these images and their ground truth."""
        return _joined(self.untreated, *self.remedies)

    @property
    def judged(self) -> str:
        """Return the key of the images that settings are judged on: these or, for a set, the whole set at this size."""
        return _joined(self.collection, self.size) if self.collection else self.exact


def _joined(*parts: str) -> str:
    return " ".join(filter(None, parts))


@dataclass(frozen=True, eq=False)
class Pair:
    """Two images of one scene, and the known facts about them.

    Attributes
    ----------
    left, right
        The images as they are matched, of one size and type.
    id
        Identifies the pair as it is now.
    truth
        (H, W) px, ground truth of the left image; None if unknown.
    visible
        (H, W), True where the right camera sees the same point as the left one: the non-occluded pixels.
    calibration
        Calibration of the left camera.
    min_disparity, num_disparities
        First disparity and number of disparities the pair needs, px; the number is None if unknown.
    description
        Text about the pair.
    shared
        Whether it is a bundled example.
    changes
        The changes made to it, in order.
    full
        The pair before its sides were divided; None if they were not.
    """

    left: Image
    right: Image
    id: PairId
    truth: FloatMap | None = None
    visible: Mask | None = None
    calibration: Calibration | None = None
    min_disparity: int = 0
    num_disparities: int | None = None
    description: str = ""
    shared: bool = False
    changes: tuple[Change, ...] = ()
    full: Pair | None = None

    @property
    def digest(self) -> str:
        """Return the key that identifies exactly these images."""
        return self.id.exact

    @property
    def remedies(self) -> tuple[Change, ...]:
        """Return the changes made by the input doctor."""
        return tuple(change for change in self.changes if isinstance(change.code, Remedy))

    def after(self, code: ChangeCode | Remedy, sentence: str, **fields: Any) -> Self:
        """Return the pair after a change, with the given fields replaced."""
        return replace(self, changes=(*self.changes, Change(code, sentence)), **fields)
