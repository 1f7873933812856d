"""The stereo pair of the depth page, what was done to it, and the bundled ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import streamlit as st

from stereolag import samples
from stereolag.arrays import FloatMap, Mask
from stereolag.geometry.calibration import Calibration
from stereolag.inputs import Image
from stereolag.reading import read_calibration, read_disparity, read_image

SIZES = {"Automatic": None, "Full": 1, "1/2": 2, "1/4": 4}
"""The sizes in which a pair can be matched, and by what its sides are divided then; None: by what suits it."""


@dataclass(frozen=True)
class Change:
    """What was done to the images since they were read.

    Attributes
    ----------
    name
        Tells the pair after it from the pair before; "" where the files tell already.
    sentence
        The same in words; "" where there is nothing to say.
    remedy
        Whether the input doctor did it at the visitor's wish, who can undo it.
    resizes
        Whether disparities are other numbers after it, as the images have another size.
    """

    name: str
    sentence: str
    remedy: bool = False
    resizes: bool = False


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two images of one scene, and what is known of it.

    Attributes
    ----------
    left, right
        The images as they are matched.
    truth
        (H, W) px, the ground truth of the left image; None where it is not known.
    num_disparities
        How many disparities the pair needs, px, from `min_disparity` on; None where it is not known.
    description
        What the page says of it.
    files
        Tells it from every other pair: a digest of its files, or the name of the example.
    shared
        Whether it is an example, whose results every visitor may share.
    calibration
        Of the left camera.
    visible
        (H, W), True where the right camera sees what the left one does: the non-occluded pixels.
    changes
        What was done to it, in order.
    full
        The pair before its sides were divided; None where they were not.
    min_disparity
        The first disparity that the pair needs, px.
    collection
        Tells the set of pairs to which it belongs, whose settings are one; "" of a pair alone.
    pictures
        Tells its two images from all others: a digest of their files alone; `files` where it is empty.
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
        """Return what tells these very images from all others."""
        return " ".join((self.files, *(change.name for change in self.changes if change.name)))

    @property
    def source(self) -> str:
        """Return the digest of the pair before any remedy: the remedies chosen for it hang on it."""
        return " ".join((self.files, *(change.name for change in self.changes if change.name and not change.remedy)))

    @property
    def searched(self) -> str:
        """Return what tells the two images and their size: the range in use hangs on it, whatever else is added."""
        sizes = (change.name for change in self.changes if change.name and change.resizes)
        return " ".join((self.pictures or self.files, *sizes))

    @property
    def judged(self) -> str:
        """Return what tells the images that settings are judged on: these or, of a set, all of it in this size."""
        if not self.collection:
            return self.digest
        return " ".join((self.collection, *(change.name for change in self.changes if change.resizes)))

    @property
    def remedies(self) -> tuple[Change, ...]:
        """Return what the input doctor did."""
        return tuple(change for change in self.changes if change.remedy)

    def after(self, change: Change, **fields: Any) -> Self:
        """Return the pair after a change, with other values in some of its fields."""
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
