"""OpenCV's StereoBM and StereoSGBM behind the project's own matcher interface."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from stereolag.core.inputs import Image, as_eight_bit, as_grey
from stereolag.core.jobs import COSTS, Estimate, Progress
from stereolag.core.settings import Applies, FitsImage, OfThePair, Pixels, SliderRange, odd
from stereolag.stereo.matcher import MinDisparity, PixelMatches, Reason, StereoMatcher, grey_bytes

BlockSize = Annotated[
    int,
    Pixels(),
    FitsImage(),
    Field(
        title="Block",
        description="Side of the compared block, px; odd (OpenCV's blockSize).",
        ge=1,
        le=51,
        json_schema_extra={"step": 2},
    ),
]
UniquenessRatio = Annotated[
    int,
    Field(
        title="Uniqueness",
        description="Least lead of the best match over the second best, percent (OpenCV's uniquenessRatio).",
        ge=0,
        le=100,
    ),
]
SpeckleWindowSize = Annotated[
    int,
    Pixels(power=2),
    Field(
        title="Speckle size",
        description="Smaller islands are dropped, px²; 0 keeps all (OpenCV's speckleWindowSize).",
        ge=0,
        le=5000,
        json_schema_extra={"step": 10},
    ),
]
SpeckleRange = Annotated[
    int,
    Applies(lambda settings: settings.speckle_window_size > 0, "needs speckle_window_size above 0"),
    Field(
        title="Speckle range",
        description="Largest step within one island (OpenCV's speckleRange: StereoBM counts 1/16 px, StereoSGBM px).",
        ge=0,
        le=256,
    ),
]
LeftRightTolerance = Annotated[
    int,
    Field(
        title="Left-right tolerance",
        description="Largest disagreement between the two directions, px; -1: no check (OpenCV's disp12MaxDiff).",
        ge=-1,
        le=64,
    ),
]


SUBPIXEL = 16
"""Units of OpenCV's integer disparities in one px."""


class BlockMatcher(StereoMatcher):
    """Base class of both OpenCV matchers: search range, checks, and conversion of the result."""

    cost_row: ClassVar[str]
    """Row of the cost table; classes derived from a matcher share its row."""

    num_disparities: Annotated[int, Pixels(rounded_up=True), OfThePair(), SliderRange(high=256)] = Field(
        default=64,
        title="Disparities searched",
        description="How many disparities are tried, px; a multiple of 16 (OpenCV's numDisparities).",
        ge=16,
        le=1024,
        multiple_of=16,
    )
    min_disparity: MinDisparity = 0
    block_size: BlockSize = 21
    uniqueness_ratio: UniquenessRatio = 15
    speckle_window_size: SpeckleWindowSize = 0
    speckle_range: SpeckleRange = 0
    disp12_max_diff: LeftRightTolerance = -1

    _odd = field_validator("block_size")(odd)

    gives_reasons = False

    @classmethod
    def other_name(cls, name: str) -> str:
        """Return OpenCV's name for a setting: ``num_disparities`` is ``numDisparities``, ``p1`` is ``P1``."""
        first, *others = name.split("_")
        return name.upper() if name in ("p1", "p2") else first + "".join(word.capitalize() for word in others)

    def estimate(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.uint8) -> Estimate:
        """Return the memory and time of :meth:`compute` for images of a shape (rows, cols[, channels]) and dtype."""
        pixels = shape[0] * shape[1]
        cells = pixels * self.num_disparities
        return COSTS[self.cost_row].estimate(
            grey=grey_bytes(shape, dtype),
            pixels=pixels,
            stretched=pixels * (np.dtype(dtype) != np.uint8),
            rows=(self.block_size + 6) * shape[1] * self.num_disparities,
            cells=cells,
            volume=cells * self.keeps_all_costs,
        )

    @property
    def keeps_all_costs(self) -> bool:
        """Return whether OpenCV keeps the costs of the whole image."""
        return False

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        """Run OpenCV's matcher on the pair, converted to 8-bit grey."""
        self._check_room(*left.shape[:2])
        progress(0.0)
        raw = np.asarray(self.opencv_matcher().compute(*as_eight_bit(as_grey(left), as_grey(right))))
        progress(1.0)
        # The invalid code is (minDisparity - 1) * 16, which is positive for minDisparity >= 2.
        valid = raw > (self.min_disparity - 1) * SUBPIXEL
        reason = np.where(self._matchable(*raw.shape), Reason.AMBIGUOUS, Reason.OUT_OF_FRAME).astype(np.uint8)
        reason[valid] = Reason.MEASURED
        return PixelMatches(np.where(valid, raw.astype(np.float32) / SUBPIXEL, np.float32(np.nan)), reason)

    def _check_room(self, rows: int, cols: int) -> None:
        if self.block_size >= min(rows, cols):
            raise ValueError(
                f"block_size is {self.block_size} px and the images are {cols} × {rows}; it must be smaller than both."
            )
        reach = max(abs(self.min_disparity), abs(self.min_disparity + self.num_disparities - 1))
        if reach + self.block_size >= cols:
            raise ValueError(
                f"num_disparities is {self.num_disparities} from min_disparity {self.min_disparity}: this and a block "
                f"of {self.block_size} px need images wider than {reach + self.block_size} px; these have {cols}."
            )

    def _matchable(self, rows: int, cols: int) -> npt.NDArray[np.bool_]:
        """Return the mask of pixels far enough from the borders for the block and the whole search."""
        frame = (0, 0, cols, rows)
        x, y, width, height = cv2.getValidDisparityROI(
            frame, frame, self.min_disparity, self.num_disparities, self.block_size
        )
        matchable = np.zeros((rows, cols), dtype=np.bool_)
        matchable[y : y + height, x : x + width] = True
        return matchable

    @abstractmethod
    def opencv_matcher(self) -> Any:
        """Return the OpenCV matcher with these settings."""


class StereoBM(BlockMatcher):
    """OpenCV's ``StereoBM``: absolute differences over a block (Konolige 1997); the defaults are OpenCV's.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> right = np.roll(left, -5, axis=1)  # disparity 5 px
    >>> result = sl.StereoBM(num_disparities=16, block_size=11).compute(left, right)
    >>> float(np.nanmedian(result.disparity))  # px
    5.0
    """

    short_name = "bm"
    cost_row: ClassVar = "StereoBM"
    first_shown = ("block_size", "num_disparities", "min_disparity", "uniqueness_ratio", "texture_threshold")

    pre_filter_cap: int = Field(
        default=31,
        title="Pre-filter cap",
        description="Gradients are clipped at this value before they are compared (OpenCV's preFilterCap).",
        ge=1,
        le=63,
    )
    texture_threshold: int = Field(
        default=10,
        title="Texture threshold",
        description="Blocks with less texture get no disparity (OpenCV's textureThreshold).",
        ge=0,
        le=10_000,
        json_schema_extra={"step": 10},
    )
    block_size: Annotated[int, Pixels(), FitsImage()] = Field(
        default=21,
        title="Block",
        description="Side of the compared block, px; odd (OpenCV's blockSize).",
        ge=5,
        le=255,
        json_schema_extra={"step": 2},
    )

    def opencv_matcher(self) -> Any:
        """Return a ``cv2.StereoBM`` with these settings."""
        matcher = cv2.StereoBM.create()
        for name in StereoBM.model_fields:
            opencv_name = self.other_name(name)
            getattr(matcher, f"set{opencv_name[0].upper()}{opencv_name[1:]}")(getattr(self, name))
        return matcher


class StereoSGBM(BlockMatcher):
    """OpenCV's ``StereoSGBM``: semi-global matching (Hirschmüller 2008) over Birchfield-Tomasi costs.

    It gets grey images here, like all methods it is compared with; OpenCV also accepts colour.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> left = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8)
    >>> right = np.roll(left, -5, axis=1)  # disparity 5 px
    >>> result = sl.StereoSGBM(num_disparities=16, block_size=5).compute(left, right)
    >>> float(np.nanmedian(result.disparity))  # px
    5.0
    """

    short_name = "sgbm"
    cost_row: ClassVar = "StereoSGBM"
    first_shown = ("block_size", "num_disparities", "min_disparity", "uniqueness_ratio", "p1", "p2")

    block_size: BlockSize = 5
    mode: Literal["sgbm", "hh", "sgbm_3way", "hh4"] = Field(
        default="sgbm",
        title="Paths",
        description="Number of paths along which costs are added up (OpenCV's mode: SGBM 5, HH 8, SGBM_3WAY 3, HH4 4). "
        "HH and HH4 keep the costs of all pixels and disparities, 4 bytes each. SGBM gets grey images here; on its "
        "own it also accepts colour.",
    )
    p1: int = Field(
        default=200,
        title="Small-step penalty",
        description="Cost of a step of 1 px between neighbours; 0 leaves it to OpenCV, which takes 2 (P1).",
        ge=0,
        le=10_000,
        json_schema_extra={"step": 10},
    )
    p2: int = Field(
        default=800,
        title="Large-step penalty",
        description="Cost of a larger step; more than the small one (OpenCV's P2). OpenCV adds costs up in 16 bits: "
        "with large blocks high penalties overflow, and the map is wrong.",
        ge=1,
        le=20_000,
        json_schema_extra={"step": 10},
    )
    pre_filter_cap: int = Field(
        default=0,
        title="Pre-filter cap",
        description="Gradients are clipped at this value before they are compared; OpenCV takes 15 for anything less, "
        "also for 0 (preFilterCap).",
        ge=0,
        le=255,
    )
    uniqueness_ratio: UniquenessRatio = 10
    speckle_window_size: SpeckleWindowSize = 100
    speckle_range: SpeckleRange = 2
    disp12_max_diff: LeftRightTolerance = 1

    @model_validator(mode="after")
    def _large_step_costs_more(self) -> StereoSGBM:
        if self.p2 <= self.p1:
            raise ValueError(f"p2 is {self.p2} and p1 {self.p1}; OpenCV needs p2 > p1.")
        return self

    @property
    def keeps_all_costs(self) -> bool:
        """Return whether OpenCV keeps the costs of the whole image: it sums them in both directions along each path."""
        return self.mode in ("hh", "hh4")

    def opencv_arguments(self) -> dict[str, Any]:
        """Return the arguments of ``cv2.StereoSGBM.create``, under OpenCV's names."""
        arguments = {self.other_name(name): value for name, value in self}
        # OpenCV takes a negative limit as 1 here; only a limit above any disparity switches the check off.
        arguments["disp12MaxDiff"] = self.disp12_max_diff if self.disp12_max_diff >= 0 else 1 << 20
        return arguments | {"mode": getattr(cv2, self.opencv_mode)}

    @property
    def opencv_mode(self) -> str:
        """Return the name of the mode's constant in ``cv2``."""
        return f"STEREO_SGBM_MODE_{self.mode.upper()}"

    def opencv_matcher(self) -> Any:
        """Return a ``cv2.StereoSGBM`` with these settings."""
        return cv2.StereoSGBM.create(**self.opencv_arguments())
