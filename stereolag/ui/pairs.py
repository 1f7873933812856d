"""The stereo pair of the depth page, and the bundled ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag import samples
from stereolag.doctor.findings import Ailment
from stereolag.geometry.calibration import Calibration
from stereolag.inputs import Image
from stereolag.reading import read_calibration, read_disparity, read_image

Disparity = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two images of one scene, and its true disparity, range, cameras and occlusion where they are known.

    `visible` is True where the right camera sees what the left one does: the non-occluded pixels. `notes` say what was
    done to the pictures since they were read, `remedies` what of that the input doctor did; `original` is the digest
    before he did.
    """

    left: Image
    right: Image
    truth: Disparity | None
    num_disparities: int | None
    description: str
    digest: str
    shared: bool
    calibration: Calibration | None = None
    visible: npt.NDArray[np.bool_] | None = None
    notes: tuple[str, ...] = ()
    remedies: tuple[Ailment, ...] = ()
    original: str | None = None

    @property
    def source(self) -> str:
        """Return the digest of the pair before any remedy: controls that belong to the pair hang on it."""
        return self.original or self.digest


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
