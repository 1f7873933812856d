"""From pixels to metres: the calibration of a stereo camera, and its two cameras before rectification."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image, as_image, check_positive

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Units of length, in metres."""

FOCAL_LIMITS_PX = (1e-3, 1e7)
"""Limits of focal lengths, px; beyond these limits and those below, products overflow or lose all meaning."""

BASELINE_LIMITS_M = (1e-9, 1e9)
"""Limits of baselines, m: from the cameras of a microscope to those of two satellites."""

MAX_CENTRE_PX = 1e7
"""Maximum magnitude of the coordinates of a principal point, px."""

MAX_DISTORTION = 1e9
"""Maximum magnitude of a distortion coefficient."""

MAX_ROW_DIFFERENCE_PX = 0.1
"""Maximum difference of the rows of two rectified projections, px: rows farther apart do not match."""

MAX_RESIDUAL_ROTATION = 0.02
"""Maximum rotation between two rectified cameras, radians."""

TYPICAL_DISPARITIES = 64
"""Number of disparities of a typical search."""

PLAUSIBLE_BASELINES_M = (0.001, 5.0)
"""Range of the baselines of stereo cameras, m."""

MAX_NEAREST_M = 100.0
"""Maximum nearest distance that a typical search of a stereo camera covers, m."""


@dataclass(frozen=True, eq=False)
class Rectification:
    """The rectification of a pair (R1, R2, P1 and P2 of OpenCV's ``stereoRectify``).

    Attributes
    ----------
    left_rotation, right_rotation
        (3, 3): from the frame of each camera to that of the rectified pair.
    left_projection, right_projection
        (3, 4), px: onto the rectified images; the right one has ``-focal * baseline`` (metres) at [0, 3].
    """

    left_rotation: npt.NDArray[np.float64]
    right_rotation: npt.NDArray[np.float64]
    left_projection: npt.NDArray[np.float64]
    right_projection: npt.NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("left_rotation", "right_rotation"):
            set_array(self, name, (3, 3), 10.0)
            check_rotation(getattr(self, name), name)
        for name in ("left_projection", "right_projection"):
            set_array(self, name, (3, 4), FOCAL_LIMITS_PX[1] * BASELINE_LIMITS_M[1])
            check_range(float(getattr(self, name)[0, 0]), f"The focal length in {name}", FOCAL_LIMITS_PX)
        rows = self.left_projection[1] - self.right_projection[1]
        if np.abs(rows).max() > MAX_ROW_DIFFERENCE_PX:
            raise ValueError(
                f"left_projection and right_projection differ in their second row by {np.abs(rows).max():g}; the rows "
                "of such a pair do not match."
            )

    @property
    def baseline_m(self) -> float:
        """Return the distance between the cameras, metres."""
        return float(self.left_projection[0, 3] - self.right_projection[0, 3]) / float(self.left_projection[0, 0])

    def scaled(self, factor: float) -> Rectification:
        """Return the rectification for images resized by `factor`."""
        return replace(
            self,
            left_projection=_scaled_matrix(self.left_projection, factor),
            right_projection=_scaled_matrix(self.right_projection, factor),
        )


@dataclass(frozen=True, eq=False)
class StereoRig:
    """Two cameras as calibrated, before rectification (the model of OpenCV's ``stereoCalibrate``).

    They stand side by side, or one above the other: then both pictures are turned before they are rectified.

    Attributes
    ----------
    left_matrix, right_matrix
        (3, 3) camera matrices, px.
    left_distortion, right_distortion
        (4 | 5 | 8 | 12 | 14,) coefficients k1, k2, p1, p2, …; (4,) k1, k2, k3, k4 of a fisheye; empty if the lens has
        no distortion.
    rotation, translation
        (3, 3) and (3,), metres: a point at ``x`` in the left camera's frame is at ``rotation @ x + translation`` in the
        right one's, so ``translation[0]`` is negative; of cameras one above the other ``translation[1]`` is the
        largest.
    width, height
        Size of the images that the matrices are for, px; None if unknown.
    rectification
        The rectification by the maker of the calibration; None if unknown.
    fisheye
        Whether the lenses are fisheyes (Kannala and Brandt, PAMI 2006; ``cv2.fisheye``, Kalibr's "equidistant").
    """

    left_matrix: npt.NDArray[np.float64]
    left_distortion: npt.NDArray[np.float64]
    right_matrix: npt.NDArray[np.float64]
    right_distortion: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float64]
    translation: npt.NDArray[np.float64]
    width: int | None = None
    height: int | None = None
    rectification: Rectification | None = None
    fisheye: bool = False

    def __post_init__(self) -> None:
        set_array(self, "rotation", (3, 3), 10.0)
        set_array(self, "translation", (3,), BASELINE_LIMITS_M[1])
        for name in ("left_distortion", "right_distortion"):
            size = np.size(getattr(self, name))
            allowed = (0, 4) if self.fisheye else (0, 4, 5, 8, 12, 14)
            if size not in allowed:
                counts = ", ".join(map(str, allowed[:-1]))
                of = " of a fisheye" if self.fisheye else ""
                raise ValueError(f"{name} holds {size} coefficients{of}; allowed are {counts} and {allowed[-1]}.")
            set_array(self, name, (size,), MAX_DISTORTION)
            if size == 0:
                object.__setattr__(self, name, np.zeros(4 if self.fisheye else 5))
        for name in ("left_matrix", "right_matrix"):
            set_array(self, name, (3, 3))
            matrix = getattr(self, name)
            if not (matrix[0, 0] > 0 and matrix[1, 1] > 0 and np.array_equal(matrix[2], (0, 0, 1))):
                raise ValueError(f"{name} is not [[f, 0, cx], [0, f, cy], [0, 0, 1]] with focal lengths above 0.")
            for focal in (matrix[0, 0], matrix[1, 1]):
                check_range(float(focal), f"The focal length in {name}", FOCAL_LIMITS_PX)
        check_rotation(self.rotation, "rotation")
        across, down, _ = self.translation
        if not (-across > abs(down) or abs(down) > abs(across)):
            raise ValueError(
                f"translation is {self.translation.tolist()} m; its first number must be negative and outweigh "
                "the second: the second camera stands to the right of the first (or else above or below it)."
            )
        given = self.rectification
        if given is None:
            return
        residual = float(np.abs(given.right_rotation @ self.rotation @ given.left_rotation.T - np.eye(3)).max())
        if residual > MAX_RESIDUAL_ROTATION:
            raise ValueError(
                "The rectification (R1, R2) does not fit the rotation (R) between the cameras: it leaves them turned "
                f"by {math.degrees(residual):.1f}° relative to each other; leave one of them out."
            )

    @property
    def turn(self) -> int:
        """Return the quarter turns, counter-clockwise, that both pictures need so that rows can match."""
        across, down, _ = self.translation
        return 0 if -across > abs(down) else int(-np.sign(down))

    def turned(self, quarters: int, size: tuple[int, int]) -> StereoRig:
        """Return the rig for pictures of `size` (width, height), turned by quarters counter-clockwise.

        The maker's rectification no longer applies and is dropped.

        Raises
        ------
        ValueError
            Lenses with tilted sensors, whose coefficients cannot be turned.
        """
        left, right = (self.left_matrix, self.left_distortion), (self.right_matrix, self.right_distortion)
        rotation, translation = self.rotation, self.translation
        for _ in range(quarters % 4):
            left, right = (
                (_turned_matrix(matrix, size[0]), lens if self.fisheye else _turned_distortion(lens))
                for matrix, lens in (left, right)
            )
            rotation, translation = _QUARTER_TURN @ rotation @ _QUARTER_TURN.T, _QUARTER_TURN @ translation
            size = size[::-1]
        width, height = (None, None) if self.width is None or self.height is None else size
        return StereoRig(*left, *right, rotation, translation, width, height, fisheye=self.fisheye)

    def scaled(self, factor: float) -> StereoRig:
        """Return the rig for images resized by `factor`."""
        check_positive(factor, "factor")
        return replace(
            self,
            left_matrix=_scaled_matrix(self.left_matrix, factor),
            right_matrix=_scaled_matrix(self.right_matrix, factor),
            width=scaled_size(self.width, factor),
            height=scaled_size(self.height, factor),
            rectification=None if self.rectification is None else self.rectification.scaled(factor),
        )


def set_array(owner: Any, name: str, shape: tuple[int, ...], limit: float = MAX_CENTRE_PX) -> None:
    """Convert an attribute of a frozen dataclass to an array of `shape`; refuse numbers beyond ±`limit`."""
    array = np.array(getattr(owner, name), dtype=np.float64)
    if array.size != math.prod(shape) or not np.isfinite(array).all():
        raise ValueError(f"{name} has shape {array.shape}; allowed are {math.prod(shape)} finite numbers, {shape}.")
    largest = max(array.flat, key=abs, default=0.0)
    if abs(largest) > limit:
        raise ValueError(f"{name} holds {largest:g}; allowed are numbers from -{limit:g} to {limit:g}.")
    object.__setattr__(owner, name, array.reshape(shape))


def check_rotation(rotation: npt.NDArray[np.float64], name: str) -> None:
    """Refuse a (3, 3) matrix that is not a rotation."""
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise ValueError(f"{name} is not a rotation: its rows must be orthogonal and of length 1.")


def check_range(value: float, name: str, bounds: tuple[float, float]) -> None:
    """Refuse a number outside its bounds."""
    check_positive(value, name)
    if not bounds[0] <= value <= bounds[1]:
        raise ValueError(f"{name} is {value:g}; allowed are {bounds[0]:g} to {bounds[1]:g}.")


def scaled_centre(centre: float, factor: float) -> float:
    """Return a coordinate of a principal point in an image resized by `factor`, px (pixel centres at whole numbers)."""
    return (centre + 0.5) * factor - 0.5


def scaled_size(size: int | None, factor: float) -> int | None:
    """Return a side of an image resized by `factor`, px; None if it is unknown."""
    return None if size is None else max(1, round(size * factor))


_QUARTER_TURN = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
"""Rotation from a camera's frame to that of the camera whose picture is turned by a quarter, counter-clockwise."""


def _turned_matrix(matrix: npt.NDArray[np.float64], width: int) -> npt.NDArray[np.float64]:
    """Return the matrix of a camera whose picture, `width` px wide, is turned by a quarter, counter-clockwise."""
    return np.array([[matrix[1, 1], 0, matrix[1, 2]], [0, matrix[0, 0], width - 1 - matrix[0, 2]], [0, 0, 1]])


def _turned_distortion(lens: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the coefficients of OpenCV's lens model for a picture turned by a quarter, counter-clockwise."""
    if lens[12:].any():
        raise ValueError("A lens on a tilted sensor (14 coefficients) cannot be turned; give pictures side by side.")
    turned = lens.copy()
    turned[2:4] = -lens[3], lens[2]
    if len(lens) >= 12:
        turned[8:12] = lens[10], lens[11], -lens[8], -lens[9]
    return turned


def _scaled_matrix(matrix: npt.NDArray[np.float64], factor: float) -> npt.NDArray[np.float64]:
    scaled = matrix * factor
    scaled[:2, 2] = (matrix[:2, 2] + 0.5) * factor - 0.5
    scaled[2] = matrix[2]
    return scaled


@dataclass(frozen=True)
class Calibration:
    """Conversion of a rectified pair's disparity to metres: ``Z = focal_px * baseline_m / (disparity + doffs_px)``.

    Attributes
    ----------
    focal_px
        Focal length of the rectified images, px.
    baseline_m
        Distance between the two cameras, metres.
    doffs_px
        Column of the right principal point minus that of the left, px.
    cx, cy
        Principal point of the left image, px (column, row of pixel centres); None means the centre of the image.
    width, height
        Size of the images it was made for, px; None if unknown.
    num_disparities
        Number of disparities that its maker states as sufficient, px; None if unknown.
    rig
        The cameras before rectification, if known: the pair is then not rectified yet, the numbers above are a
        prediction, and :func:`stereolag.rectify` returns the rectified pair with its final calibration.
    rms
        Reprojection error of the calibration, px; None if unknown.
    turn
        Quarter turns, counter-clockwise, that both pictures still need because the cameras stand one above the other;
        :meth:`turned` returns the calibration for turned pictures.
    notes
        Sentences about its file, on assumptions and on names without effect, or about its problems.
    unit_stated
        Whether the unit of lengths is known: stated by the file, or fixed by its format.
    modes
        The calibrations of the same camera for each size of its pictures, this one among them; empty if there is only
        one size.

    Raises
    ------
    ValueError
        A focal length or baseline that is not above 0, a number that is not finite, or one far beyond any camera's:
        a focal length outside 1e-3 to 1e7 px, a baseline outside 1e-9 to 1e9 m, a centre beyond 1e7 px.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> camera = sl.Calibration(focal_px=1000.0, baseline_m=0.1)
    >>> camera.depth([50.0, 10.0, np.nan])  # px to metres
    array([ 2., 10., nan], dtype=float32)
    >>> round(float(camera.depth_uncertainty(50.0, 0.5)), 3)  # metres, for an error of 0.5 px
    0.02
    """

    focal_px: float
    baseline_m: float
    doffs_px: float = 0.0
    cx: float | None = None
    cy: float | None = None
    width: int | None = field(default=None, kw_only=True)
    height: int | None = field(default=None, kw_only=True)
    num_disparities: int | None = field(default=None, kw_only=True)
    rig: StereoRig | None = field(default=None, kw_only=True)
    rms: float | None = field(default=None, kw_only=True)
    turn: int = field(default=0, kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True, compare=False, repr=False)
    unit_stated: bool = field(default=True, kw_only=True, compare=False, repr=False)
    modes: tuple[Calibration, ...] = field(default=(), kw_only=True, compare=False, repr=False)

    def __post_init__(self) -> None:
        check_range(self.focal_px, "focal_px", FOCAL_LIMITS_PX)
        check_range(self.baseline_m, "baseline_m", BASELINE_LIMITS_M)
        for name in ("doffs_px", "cx", "cy"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{name} is {value}; allowed are finite numbers.")
            if value is not None and abs(value) > MAX_CENTRE_PX:
                raise ValueError(f"{name} is {value:g}; allowed are -{MAX_CENTRE_PX:g} to {MAX_CENTRE_PX:g} px.")
        if self.turn not in (-1, 0, 1):
            raise ValueError(f"turn is {self.turn}; allowed are -1, 0 and 1.")
        for name in ("width", "height", "num_disparities"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name} is {value}; allowed are whole numbers from 1.")

    def depth(self, disparity: npt.ArrayLike) -> FloatMap:
        """Return the depth along the optical axis.

        Parameters
        ----------
        disparity
            Any shape, px, positive in front of infinity, NaN where unknown.

        Returns
        -------
        depth
            Same shape, float32, metres; NaN where the disparity is unknown or not in front of infinity
            (``disparity + doffs_px <= 0``).
        """
        return _metres(self.focal_px * self.baseline_m, self._shift(disparity))

    def depth_uncertainty(self, disparity: npt.ArrayLike, disparity_error: npt.ArrayLike) -> FloatMap:
        """Return the depth error caused by an error of the disparity: ``Z² δd / (f B)``.

        Parameters
        ----------
        disparity
            Any shape, px.
        disparity_error
            One number, or one for each disparity, px, not negative.

        Returns
        -------
        depth_error
            float32, metres; NaN where :meth:`depth` has none.
        """
        error = np.asarray(disparity_error, dtype=np.float64)
        if (error < 0).any():
            raise ValueError(f"disparity_error is {error.min()} px; allowed are numbers from 0.")
        shift = self._shift(disparity)
        with np.errstate(over="ignore"):
            return _metres(self.focal_px * self.baseline_m * error, shift**2)

    def point_cloud(self, disparity: npt.ArrayLike, colour: npt.ArrayLike) -> tuple[FloatMap, npt.NDArray[np.uint8]]:
        """Return the points that have a depth, in the frame of the left camera.

        Parameters
        ----------
        disparity
            (rows, cols), px.
        colour
            The left image: (rows, cols) grey or (rows, cols, 3 | 4) RGB(A), uint8, uint16 or float in 0..1.

        Returns
        -------
        points
            (n, 3) float32, metres: X to the right, Y down, Z forward.
        colours
            (n, 3) uint8 RGB.

        Raises
        ------
        ValueError
            A disparity that is not two-dimensional, or a colour of another size or outside its range.
        """
        depth = self.depth(disparity)
        if depth.ndim != 2:
            raise ValueError(f"disparity has shape {depth.shape}; a point cloud needs (rows, cols).")
        image = _as_rgb8(as_image(colour, "colour"))
        if image.shape[:2] != depth.shape:
            raise ValueError(f"colour has {image.shape[:2]} rows and columns and disparity {depth.shape}.")
        cx, cy = self.centre(depth.shape[1], depth.shape[0])
        rows, cols = np.nonzero(np.isfinite(depth))
        z = depth[rows, cols]
        with np.errstate(over="ignore"):
            points = np.column_stack(((cols - cx) * z / self.focal_px, (rows - cy) * z / self.focal_px, z))
            points = points.astype(np.float32)
        finite = np.isfinite(points).all(axis=1)
        return points[finite], image[rows, cols][finite]

    def centre(self, width: int, height: int) -> tuple[float, float]:
        """Return the principal point of an image of this size, px: column, row; the middle where it is unknown."""
        return (width - 1) / 2 if self.cx is None else self.cx, (height - 1) / 2 if self.cy is None else self.cy

    def scaled(self, factor: float) -> Calibration:
        """Return the calibration for images (and disparities) resized by `factor`.

        Pixel centres are at whole numbers, so an image reaches from -1/2 to width - 1/2 and the principal point
        goes to ``(cx + 1/2) * factor - 1/2``.
        """
        check_positive(factor, "factor")
        return replace(
            self,
            focal_px=self.focal_px * factor,
            doffs_px=self.doffs_px * factor,
            cx=None if self.cx is None else scaled_centre(self.cx, factor),
            cy=None if self.cy is None else scaled_centre(self.cy, factor),
            width=scaled_size(self.width, factor),
            height=scaled_size(self.height, factor),
            num_disparities=None if self.num_disparities is None else math.ceil(self.num_disparities * factor),
            rig=None if self.rig is None else self.rig.scaled(factor),
            rms=None if self.rms is None else self.rms * factor,
            modes=(),
        )

    def nearest(self, num_disparities: int) -> float:
        """Return the nearest distance that a search of so many disparities from 0 covers, metres; inf for none."""
        shift = num_disparities - 1 + self.doffs_px
        return self.focal_px * self.baseline_m / shift if shift > 0 else math.inf

    @property
    def plausible(self) -> bool:
        """Return whether baseline and range are those of a stereo camera, not of lengths in another unit."""
        shortest, longest = PLAUSIBLE_BASELINES_M
        return shortest <= self.baseline_m <= longest and self.nearest(TYPICAL_DISPARITIES) <= MAX_NEAREST_M

    def in_words(self) -> str:
        """Return the calibration in words, with its range in metres: a wrong unit or focal length is obvious there."""
        count = self.num_disparities or TYPICAL_DISPARITIES
        summary = (
            f"Calibration: focal length {self.focal_px:.4g} px, baseline {self.baseline_m:.3g} m, {count} disparities "
            f"reach from {self.nearest(count):.2g} m."
        )
        if self.plausible:
            return summary
        too_short = self.baseline_m < PLAUSIBLE_BASELINES_M[0]
        condition = "if its unit is a thousand times as long" if too_short else "if its lengths are in millimetres"
        factor = 1e3 if too_short else 1e-3
        return (
            f"{summary} No stereo camera is like that: {condition}, the baseline is {factor * self.baseline_m:.3g} m; "
            "state the unit of its lengths."
        )

    def turned(self, width: int, height: int) -> Calibration:
        """Return the calibration for pictures of this size turned by ``turn`` quarters, counter-clockwise."""
        if not self.turn:
            return self
        cx, cy = self.centre(width, height)
        centre = (cy, width - 1 - cx) if self.turn > 0 else (height - 1 - cy, cx)
        rig = (
            None
            if self.rig is None
            else self.rig.turned(self.turn, (self.rig.width or width, self.rig.height or height))
        )
        if rig is not None and self.cx is not None and self.cy is not None:
            centre = self.cx, self.cy  # predicted for turned pictures already
        return replace(
            self, turn=0, cx=centre[0], cy=centre[1], width=self.height, height=self.width, rig=rig, modes=()
        )

    def with_known_distance(self, disparity: float, distance_m: float) -> Calibration:
        """Return the calibration that puts a point of `disparity` px at `distance_m` metres.

        One known distance gives the product ``focal_px * baseline_m``; the focal length is kept and the baseline
        solved for. Depths are then right whatever the focal length; widths and heights are only as good as it is.

        Raises
        ------
        ValueError
            A disparity that is not in front of infinity, or a distance that is not above 0.
        """
        check_positive(distance_m, "distance_m")
        check_positive(disparity + self.doffs_px, "disparity + doffs_px")
        return replace(self, baseline_m=distance_m * (disparity + self.doffs_px) / self.focal_px, rig=None)

    def _shift(self, disparity: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return disparity + doffs, px; NaN where that is not in front of infinity."""
        shift = np.asarray(disparity, dtype=np.float64) + self.doffs_px
        return np.where((shift > 0) & np.isfinite(shift), shift, np.nan)


def _metres(numerator: float | npt.NDArray[np.float64], denominator: npt.NDArray[np.float64]) -> FloatMap:
    """Return the quotient as float32, NaN where it overflows."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        metres = np.asarray(numerator / denominator, dtype=np.float32)
    return np.where(np.isfinite(metres), metres, np.float32(np.nan))


def _as_rgb8(image: Image) -> npt.NDArray[np.uint8]:
    if image.dtype == np.uint16:
        image = image // 257
    elif image.dtype != np.uint8:
        low, high = float(image.min()), float(image.max())
        if low < 0 or high > 1:
            raise ValueError(f"colour holds floats from {low:g} to {high:g}; allowed are 0 to 1, uint8 and uint16.")
        image = np.rint(image * 255)
    image = image.astype(np.uint8)
    return np.stack([image] * 3, axis=-1) if image.ndim == 2 else image[:, :, :3]
