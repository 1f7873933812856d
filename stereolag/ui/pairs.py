"""The stereo pair of the depth page, the changes made to it, and the bundled pairs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import streamlit as st

from stereolag import samples
from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image
from stereolag.geometry.calibration import Calibration
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image

SIZES = {"Automatic": None, "Full": 1, "1/2": 2, "1/4": 4}
"""The sizes at which a pair can be matched, each with the divisor of its sides; None = chosen to suit the pair."""


@dataclass(frozen=True)
class Change:
    """A change made to the images after they were read.

    Attributes
    ----------
    name
        Distinguishes the pair after the change from the pair before it; "" if the files already do.
    sentence
        Description of the change; "" if there is nothing to say.
    remedy
        Whether the input doctor made it at the visitor's request; the visitor can undo it.
    resizes
        Whether it scales the disparities, because it changes the size of the images.
    """

    name: str
    sentence: str
    remedy: bool = False
    resizes: bool = False


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two images of one scene, and the known facts about them.

    Attributes
    ----------
    left, right
        The images as they are matched.
    truth
        (H, W) px, ground truth of the left image; None if unknown.
    num_disparities
        Number of disparities the pair needs, starting at `min_disparity`, px; None if unknown.
    description
        Text about the pair on the page.
    files
        Identifies the pair: a digest of its files, or the name of the example.
    shared
        Whether it is an example, whose results all visitors may share.
    calibration
        Calibration of the left camera.
    visible
        (H, W), True where the right camera sees the same point as the left one: the non-occluded pixels.
    changes
        The changes made to it, in order.
    full
        The pair before its sides were divided; None if they were not.
    min_disparity
        First disparity the pair needs, px.
    collection
        Identifies the set of pairs it belongs to, which shares its settings; "" for a single pair.
    pictures
        Identifies the two images: a digest of their files alone; if empty, `files` identifies them.
    """

    left: Image
    right: Image
    truth: FloatMap | None
    num_disparities: int | None
    description: str
    files: str
    shared: bool
    calibration: Calibration | None = None
    visible: Mask | None = None
    changes: tuple[Change, ...] = ()
    full: StereoPair | None = None
    min_disparity: int = 0
    collection: str = ""
    pictures: str = ""

    @property
    def digest(self) -> str:
        """Return the key that identifies exactly these images."""
        return " ".join((self.files, *(change.name for change in self.changes if change.name)))

    @property
    def source(self) -> str:
        """Return the digest of the pair before any remedy; its remedies are stored under it."""
        return " ".join((self.files, *(change.name for change in self.changes if change.name and not change.remedy)))

    @property
    def searched(self) -> str:
        """Return the key of the two images at their size; the range in use is kept under it, whatever else is added."""
        sizes = (change.name for change in self.changes if change.name and change.resizes)
        return " ".join((self.pictures or self.files, *sizes))

    @property
    def judged(self) -> str:
        """Return the key of the images that settings are judged on: these or, for a set, the whole set at this size."""
        if not self.collection:
            return self.digest
        return " ".join((self.collection, *(change.name for change in self.changes if change.resizes)))

    @property
    def remedies(self) -> tuple[Change, ...]:
        """Return the changes made by the input doctor."""
        return tuple(change for change in self.changes if change.remedy)

    def after(self, change: Change, **fields: Any) -> Self:
        """Return the pair after a change, with the given fields replaced."""
        return replace(self, changes=(*self.changes, change), **fields)


@st.cache_resource(show_spinner="Loading the example …")
def example_pair(name: str) -> StereoPair:
    """Return one of the bundled pairs."""
    example = samples.stereo_pairs()[name]
    return StereoPair(
        read_image(example.left),
        read_image(example.right),
        read_disparity(example.disparity),
        example.num_disparities,
        example.description,
        f"pair {name}",
        True,
        read_calibration(example.calibration),
        read_image(example.occlusion) == 0,
    )
