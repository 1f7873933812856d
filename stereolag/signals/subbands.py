"""Recordings split into narrow bands of frequency, each at a fraction of the sampling rate, and correlated there.

A band of width w is fully described by w complex samples a second (R. Crochiere and L. Rabiner, "Multirate Digital
Signal Processing" (1983), section 7.2: the block transform as a filter bank). The correlation of the recordings is the
sum of the bands' correlations, each rotated by its frequency, so it never exceeds the sum of their magnitudes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
from scipy import fft

from stereolag.core.arrays import Vector
from stereolag.signals.blocks import CentredRecording

BLOCK = 2**15
"""Samples transformed at a time."""

_BLOCKS_AT_ONCE = 16

Bands = npt.NDArray[np.complex64]


def band_energies(recording: CentredRecording, step: int) -> Vector:
    """Return the energy of each of the ``step / 2`` bands, in squared sample units."""
    energies = np.zeros(step // 2)
    for _, spectra in _spectra(recording):
        power = spectra.real**2 + spectra.imag**2
        energies += power.reshape(len(power), energies.size, -1).sum(axis=(0, 2), dtype=np.float64)
    return energies * 2 / BLOCK


def band_signals(recording: CentredRecording, bands: Sequence[int], step: int) -> Bands:
    """Return (bands, ceil(samples / step)): the complex envelopes of the given bands, at every `step`-th sample.

    Scaled so that the real part of their product equals the product of the recordings' samples.
    """
    points = BLOCK // step
    signals = np.zeros((len(bands), -(-recording.size // step)), dtype=np.complex64)
    for start, spectra in _spectra(recording):
        for signal, band in zip(signals, bands, strict=True):
            part = fft.ifft(spectra[:, band * points : (band + 1) * points], axis=1)
            rest = signal[start // step :]
            rest[: part.size] = part.ravel()[: rest.size]
    signals *= np.float32(np.sqrt(2 / step))
    return signals


def _spectra(recording: CentredRecording) -> Iterator[tuple[int, Bands]]:
    """Yield the start of a group of blocks, and their (blocks, BLOCK / 2) spectra without the highest frequency."""
    rows = np.empty((_BLOCKS_AT_ONCE, BLOCK))
    for start in range(0, recording.size, rows.size):
        recording.fill(rows.ravel(), start)
        count = min(_BLOCKS_AT_ONCE, -(-(recording.size - start) // BLOCK))
        spectra = np.asarray(fft.rfft(rows[:count].astype(np.float32), axis=1, workers=2), dtype=np.complex64)
        # Unlike the other frequencies, the mean of a block has no negative counterpart.
        spectra[:, 0] *= np.float32(np.sqrt(0.5))
        yield start, spectra[:, :-1]


def band_products(first: Bands, second: Bands) -> Bands:
    """Return (N1 + N2,) the correlation of one band at the band's lags from ``1 - N1`` to N2.

    Parameters
    ----------
    first, second
        (N1,) and (N2,) envelopes of the band, from :func:`band_signals`.
    """
    size = int(fft.next_fast_len(first.size + second.size))
    rows = np.zeros((2, size), dtype=np.complex64)
    rows[0, : first.size] = first
    rows[1, : second.size] = second
    one, other = fft.fft(rows, axis=1, overwrite_x=True)
    np.conj(one, out=one)
    one *= other
    products = fft.ifft(one, overwrite_x=True)
    return np.concatenate((products[size - first.size + 1 :], products[: second.size + 1]))
