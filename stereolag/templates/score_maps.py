"""The correlation coefficient (ZNCC) of a template at every place of an image: fast by FFT, or plainly by sliding.

Both compute, over the opaque pixels of the template T and the window I under them, channels c with their own means:
``sum_c (I_c - mean I_c)(T_c - mean T_c) / sqrt(sum_c (I_c - mean I_c)**2 * sum_c (T_c - mean T_c)**2)``.
Removing the mean of the template alone already cancels the window's mean in the products; the window's spread follows
from its sums (Lewis, Fast Normalized Cross-Correlation, 1995), or under a mask from correlations with the mask
(Padfield, Masked Object Registration in the Fourier Domain, 2012).
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress
from stereolag.templates.correlation import fill_pearson, pearson, running_box_energy
from stereolag.templates.patterns import Pattern

Plane = npt.NDArray[np.float64]
Planes = npt.NDArray[np.float64]
ScoreMap = npt.NDArray[np.float32]

LONGEST_FFT = 720
"""Longest tile, px, unless the template is large: tiles fit the cache, and overlap little."""

FFT_UNIT = 48
"""OpenCV transforms doubles fastest at 48 · 2**i · 3**j · 5**k points; 512 points take twice as long."""

FLAT_INTEGERS = 0.25
"""For integers, the squared deviations of any window that varies sum to 0.5 or more."""

FLAT_FLOATS = 1e-11
"""A window of floats is flat if its variance is below this share of the largest square: the rounding error of 0."""


def direct_score_map(image: Image, pattern: Pattern, progress: Progress) -> ScoreMap:
    """Return the score of every position by sliding the template along the rows: the slow, plain reference.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the pattern.
    pattern
        The template.
    progress
        Called with the fraction done after every line of the template.

    Returns
    -------
    ndarray
        (rows - height + 1, cols - width + 1) float32, -1..1, NaN where the window is flat.
    """
    planes = _centred(image)
    squares = np.square(planes).sum(axis=0)
    height, width = pattern.shape
    opaque = pattern.opaque.astype(np.float64)
    channels, rows, cols = len(planes), image.shape[0] - height + 1, image.shape[1] - width + 1
    products, square_sums, sums = np.zeros((rows, cols)), np.zeros((rows, cols)), np.zeros((channels, rows, cols))
    for row in range(rows):
        for line in range(height):
            square_sums[row] += np.correlate(squares[row + line], opaque[line], "valid")
            for channel in range(channels):
                pixels = planes[channel, row + line]
                sums[channel, row] += np.correlate(pixels, opaque[line], "valid")
                products[row] += np.correlate(pixels, pattern.deviations[channel, line], "valid")
            progress((row + (line + 1) / height) / rows)
    energy = square_sums - np.square(sums).sum(axis=0) / pattern.count
    return pearson(products, energy, pattern.norm, _flatness(image, planes, pattern))


def fft_score_map(image: Image, pattern: Pattern, progress: Progress) -> ScoreMap:
    """Return the score of every position by FFT, tile by tile (overlap-save), as :func:`direct_score_map` does.

    Everything is in float64: sums of 8-bit pixels are exact, and the residue of a flat window is far below any real
    variation. The tiles run on as many threads as OpenCV uses; `progress` is called in the caller's own thread.
    """
    height, width = pattern.shape
    places = image.shape[0] - height + 1, image.shape[1] - width + 1
    (down, fft_rows), (across, fft_cols) = tiling(places[0], height), tiling(places[1], width)
    spectra = _Spectra.of(pattern, (fft_rows, fft_cols))
    scores = np.empty(places, dtype=np.float32)
    pool = ThreadPoolExecutor(max(1, cv2.getNumThreads()))
    try:
        jobs = [
            pool.submit(
                _score_tile,
                scores[row : row + down, col : col + across],
                image[row : row + down + height - 1, col : col + across + width - 1],
                pattern,
                spectra,
            )
            for row in range(0, places[0], down)
            for col in range(0, places[1], across)
        ]
        for fraction in finished(jobs):
            progress(fraction)
    finally:
        # A progress callback may raise to cancel the search: tiles that have not started then never do.
        pool.shutdown(cancel_futures=True)
    return scores


@dataclass(frozen=True)
class _Spectra:
    """Spectra of the template's deviations and of its mask, packed as by :func:`cv2.dft`.

    A mask that is the full rectangle has none: running sums are faster then.
    """

    shape: tuple[int, int]
    deviations: list[Plane]
    mask: Plane | None

    @classmethod
    def of(cls, pattern: Pattern, shape: tuple[int, int]) -> _Spectra:
        mask = None if pattern.opaque.all() else _spectrum(pattern.opaque.astype(np.float64), shape)
        return cls(shape, [_spectrum(plane, shape) for plane in pattern.deviations], mask)


def _score_tile(scores: ScoreMap, block: Image, pattern: Pattern, spectra: _Spectra) -> None:
    """Write the scores of one tile; `block` is the part of the image that its positions cover."""
    planes = _centred(block)
    rows = len(scores)
    # Masked sums of integers are integers: rounded to the nearest, they are exact.
    exact = np.rint if block.dtype.kind == "u" else np.positive
    energy: Plane = np.empty((0, 0))
    if spectra.mask is not None:
        squares = _spectrum(np.square(planes).sum(axis=0), spectra.shape)
        energy = exact(_positions(_times(squares, spectra.mask, out=squares), rows))
    total: Plane | None = None
    # One channel after the other, because the spectra take most of the memory.
    for plane, template in zip(planes, spectra.deviations, strict=True):
        channel = _spectrum(plane, spectra.shape)
        if spectra.mask is not None:
            energy -= np.square(exact(_positions(_times(channel, spectra.mask), rows))) / pattern.count
        _times(channel, template, out=channel)
        total = channel if total is None else np.add(total, channel, out=total)
        del channel  # or it would still be there when the next is computed
    assert total is not None
    products = _positions(total, rows)
    if spectra.mask is None:
        energy = running_box_energy(planes, *pattern.shape)
    fill_pearson(scores, products, energy, pattern.norm, _flatness(block, planes, pattern))


def _spectrum(plane: Plane, shape: tuple[int, int]) -> Plane:
    """Return the packed spectrum of a plane that is padded with zeros to `shape`."""
    padded = np.zeros(shape)
    padded[: plane.shape[0], : plane.shape[1]] = plane
    return np.asarray(cv2.dft(padded, dst=padded, nonzeroRows=plane.shape[0]))


def _times(image: Plane, template: Plane, out: Plane | None = None) -> Plane:
    """Return the packed spectrum of a circular correlation from those of its operands; `out` may be one of them."""
    return np.asarray(cv2.mulSpectrums(image, template, 0, c=out, conjB=True))


def _positions(spectrum: Plane, rows: int) -> Plane:
    """Return the inverse transform of a packed spectrum, in its memory; only the first `rows`."""
    inverse = cv2.DFT_INVERSE | cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT
    return np.asarray(cv2.dft(spectrum, dst=spectrum, flags=inverse, nonzeroRows=rows), dtype=np.float64)[:rows]


def _centred(image: Image) -> Planes:
    """Return the channels (channels, rows, cols) as float64 around 0; integers stay integers."""
    planes = np.moveaxis(image, 2, 0).astype(np.float64, order="C")
    means = planes.mean(axis=(1, 2), keepdims=True)
    planes -= np.rint(means) if image.dtype.kind == "u" else means
    return planes


def _flatness(image: Image, planes: Planes, pattern: Pattern) -> float:
    """Return the sum of squared deviations up to which a window counts as flat."""
    if image.dtype.kind == "u":
        return FLAT_INTEGERS
    return FLAT_FLOATS * pattern.count * float(np.square(planes).max())


def tiling(places: int, size: int) -> tuple[int, int]:
    """Return, along one axis, how many positions a tile takes and the length of its FFT, for the least work in all."""
    longest = max(LONGEST_FFT, 2 * _fft_length(size))
    fewest = -(-places // (longest - size + 1))
    choices = [(-(-places // tiles), tiles) for tiles in range(fewest, 2 * fewest + 1)]
    step, _ = min(choices, key=lambda choice: choice[1] * _fft_length(choice[0] + size - 1))
    return step, _fft_length(step + size - 1)


def _fft_length(least: int) -> int:
    return FFT_UNIT * int(cv2.getOptimalDFTSize(-(-least // FFT_UNIT)))


def finished(jobs: list[Future[Any]]) -> Iterator[float]:
    """Yield the fraction of jobs done, at least ten times a second, until all are; raise any exception of a job."""
    pending = set(jobs)
    while pending:
        done, pending = wait(pending, timeout=0.1, return_when=FIRST_COMPLETED)
        for job in done:
            job.result()
        yield 1 - len(pending) / len(jobs)
