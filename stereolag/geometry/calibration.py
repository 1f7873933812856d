"""From pixels to metres: the calibration of a stereo camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_image
from stereolag.geometry.rig import (
    BASELINE_M,
    FOCAL_PX,
    MAX_CENTRE_PX,
    StereoRig,
    check_positive,
    check_range,
    scaled_centre,
    scaled_size,
)

Float32Array = npt.NDArray[np.float32]


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
        Number of disparities its maker states as sufficient, px; None if unknown.
    rig
        The cameras before rectification, if known: the pair is then not rectified yet, the numbers above are a
        prediction, and :func:`stereolag.rectify` returns the rectified pair with its final calibration.
    rms
        Reprojection error of the calibration, px; None if unknown.

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

    def __post_init__(self) -> None:
        check_range(self.focal_px, "focal_px", FOCAL_PX)
        check_range(self.baseline_m, "baseline_m", BASELINE_M)
        for name in ("doffs_px", "cx", "cy"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{name} is {value}; allowed are finite numbers.")
            if value is not None and abs(value) > MAX_CENTRE_PX:
                raise ValueError(f"{name} is {value:g}; allowed are -{MAX_CENTRE_PX:g} to {MAX_CENTRE_PX:g} px.")
        for name in ("width", "height", "num_disparities"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name} is {value}; allowed are whole numbers from 1.")

    def depth(self, disparity: npt.ArrayLike) -> Float32Array:
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

    def depth_uncertainty(self, disparity: npt.ArrayLike, disparity_error: npt.ArrayLike) -> Float32Array:
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

    def point_cloud(
        self, disparity: npt.ArrayLike, colour: npt.ArrayLike
    ) -> tuple[Float32Array, npt.NDArray[np.uint8]]:
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
        cx = (depth.shape[1] - 1) / 2 if self.cx is None else self.cx
        cy = (depth.shape[0] - 1) / 2 if self.cy is None else self.cy
        rows, cols = np.nonzero(np.isfinite(depth))
        z = depth[rows, cols]
        with np.errstate(over="ignore"):
            points = np.column_stack(((cols - cx) * z / self.focal_px, (rows - cy) * z / self.focal_px, z))
            points = points.astype(np.float32)
        near = np.isfinite(points).all(axis=1)
        return points[near], image[rows, cols][near]

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
        """Return disparity + doffs, NaN where that is not in front of infinity."""
        shift = np.asarray(disparity, dtype=np.float64) + self.doffs_px
        return np.where((shift > 0) & np.isfinite(shift), shift, np.nan)


def _metres(numerator: float | npt.NDArray[np.float64], denominator: npt.NDArray[np.float64]) -> Float32Array:
    """Return the quotient, NaN where it overflows float32."""
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
