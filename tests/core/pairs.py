"""Stereo pairs of known displacement: made for the tests, shifted or of surfaces at several depths, and bundled."""

from functools import cache

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from stereolag import read_disparity, read_image
from stereolag.core.arrays import Array, DoubleMap, EightBit, FloatMap
from stereolag.geometry.rectification import scaled_disparity, scaled_image
from stereolag.samples import stereo_pairs


def texture(rows: int, cols: int, *, seed: int = 0, blur: float = 1.0) -> DoubleMap:
    """Return a periodic random texture with mean 128 and standard deviation 40."""
    noise = np.random.default_rng(seed).standard_normal((rows, cols))
    smooth = gaussian_filter(noise, blur, mode="wrap")
    return 128 + 40 * (smooth - smooth.mean()) / smooth.std()


def shifted(image: DoubleMap, dy: float, dx: float) -> DoubleMap:
    """Return the periodic image moved exactly by (dy, dx) px, by shifting the phase of its Fourier transform."""
    rows, cols = np.fft.fftfreq(image.shape[0])[:, None], np.fft.fftfreq(image.shape[1])
    return np.fft.ifft2(np.fft.fft2(image) * np.exp(-2j * np.pi * (rows * dy + cols * dx))).real


def shifted_pair(
    rows: int, cols: int, dy: float, dx: float, *, dtype: npt.DTypeLike = np.uint8, seed: int = 0
) -> tuple[Array, Array]:
    """Return a left image and a right one displaced by (dy, dx), over the full range of an integer dtype."""
    left = texture(rows, cols, seed=seed)
    pair = left, shifted(left, dy, dx)
    kind = np.dtype(dtype)
    if kind.kind == "f":
        return pair[0].astype(kind), pair[1].astype(kind)
    gain = np.iinfo(kind).max / 255
    low, high = (np.rint(np.clip(image, 0, 255) * gain).astype(kind) for image in pair)
    return low, high


FAR = 4
NEAR = {(30, 90, 60, 130): 14, (80, 140, 150, 230): 20, (15, 60, 170, 250): 9}
"""{(first row, end row, first column, end column): disparity} of the squares in front of the wall."""


def steps_pair(*, noise: float = 8.0) -> tuple[EightBit, EightBit, FloatMap]:
    """Return left, right and truth: squares in front of a wall, 160 × 280, with noise in grey levels."""
    rng = np.random.default_rng(5)
    left = texture(160, 280, seed=4, blur=1.5)
    right = np.roll(left, -FAR, axis=1)
    truth = np.full(left.shape, FAR, dtype=np.float32)
    for (top, bottom, first, last), disparity in sorted(NEAR.items(), key=lambda one: one[1]):
        patch = texture(bottom - top, last - first, seed=disparity, blur=1.5)
        left[top:bottom, first:last] = patch
        right[top:bottom, first - disparity : last - disparity] = patch
        truth[top:bottom, first:last] = disparity
    both = [np.clip(np.rint(image + rng.normal(0, noise, image.shape)), 0, 255) for image in (left, right)]
    return both[0].astype(np.uint8), both[1].astype(np.uint8), truth


@cache
def bundled(name: str, size: float = 1.0) -> tuple[EightBit, EightBit, DoubleMap]:
    """Return a bundled pair and its disparities at a share of its size."""
    example = stereo_pairs()[name]
    left, right = (scaled_image(read_image(side), size) for side in (example.left, example.right))
    return left, right, np.asarray(scaled_disparity(read_disparity(example.disparity), size), float)
