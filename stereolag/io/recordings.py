"""Recordings from untrusted bytes: audio files, columns of numbers, NumPy arrays."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy  # loads scipy.signal on first use only, since that takes a second
import soundfile

from stereolag.core.jobs import Estimate, check_memory, limits
from stereolag.io.number_columns import parse_columns
from stereolag.io.numpy_files import MAGIC as NPY_MAGIC
from stereolag.io.numpy_files import parse_npy
from stereolag.io.sources import HEADER_BYTES, Source, read_bytes

WHAT = "recording"
ACCEPTED = "WAV, FLAC, OGG, MP3, AIFF, NPY, and text with one number a line or columns of numbers"
MAX_CHANNELS = 64

FEWEST_TICKS = 10
UNEVENNESS = 1e-3
"""Largest deviation of a column of times from a straight line, as a share of its length."""

MOST_TERMS = 10_000
"""Largest term in the ratio of two sampling rates: the filter between them is twenty times as long."""

LONGEST_DOUBLE = 30_000_000
"""Samples, all channels, above which a recording is kept with the 24 bits of float32: 11 minutes at 44.1 kHz."""

Channels: TypeAlias = npt.NDArray[np.float32] | npt.NDArray[np.float64]

_BLOCK = 2**20
"""Samples decoded at a time."""

_AUDIO_MARKS = (b"RIFF", b"RIFX", b"RF64", b"fLaC", b"OggS", b"ID3", b"FORM")
_MP3_SYNCS = (b"\xff\xfb", b"\xff\xfa", b"\xff\xf3", b"\xff\xf2", b"\xff\xe3", b"\xff\xe2")


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording read from a file; it converts to an array of its samples, so ``signal_lag`` accepts it directly.

    Attributes
    ----------
    channels
        (channels, samples) float64, all finite; audio is scaled to -1..1. Float32 above 30 million samples in all.
    sampling_rate
        Samples per second; None if the file does not state it (text and NPY).
    mended_lines
        Number of damaged lines of a text that were mended.
    resampled_from
        The samples per second of the file if :meth:`resampled` changed them; otherwise None.
    """

    channels: Channels
    sampling_rate: float | None
    mended_lines: int = 0
    resampled_from: float | None = None

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        """Return (samples,) for a single channel, or (channels, samples) for several."""
        samples = self.channels[0] if len(self.channels) == 1 else self.channels
        return np.array(samples, dtype=dtype, copy=copy)

    def resampled(self, sampling_rate: float) -> Recording:
        """Return the recording at another rate, by :func:`scipy.signal.resample_poly`; itself if the rate is its own.

        Nothing is delayed: the first sample stays the first. Frequencies above half the lower rate are lost.

        Raises
        ------
        ValueError
            A recording whose file states no rate, a rate that is not positive and finite, rates whose ratio needs
            numbers above 10,000, or more samples than the limit in force.
        """
        if self.sampling_rate is None:
            raise ValueError(f"The {WHAT} states no sampling rate, so it cannot be resampled to {sampling_rate:g} Hz.")
        if not (np.isfinite(sampling_rate) and sampling_rate > 0):
            raise ValueError(f"sampling_rate is {sampling_rate!r} Hz; it must be a positive, finite number.")
        if sampling_rate == self.sampling_rate:
            return self
        ratio = Fraction(sampling_rate) / Fraction(self.sampling_rate)
        up, down = ratio.numerator, ratio.denominator
        if max(up, down) > MOST_TERMS:
            raise ValueError(
                f"The {WHAT} has {self.sampling_rate:,.10g} samples a second and {sampling_rate:,.10g} are asked for; "
                f"their ratio is {up} : {down}, and numbers up to {MOST_TERMS:,} are allowed."
            )
        _check_size(len(self.channels), -(-self.channels.shape[1] * up // down))
        # A line continues the recording beyond its ends, so that an offset makes no step to zero.
        channels = scipy.signal.resample_poly(self.channels, up, down, axis=1, padtype="line")
        return Recording(channels, sampling_rate, self.mended_lines, self.resampled_from or self.sampling_rate)

    def channel(self, number: int) -> Recording:
        """Return one channel, from 1, as a recording of its own; ValueError if there is no such channel."""
        count = len(self.channels)
        if not 1 <= number <= count:
            raise ValueError(f"The channel number is {number}; the {WHAT} has {count}, counted from 1.")
        return replace(self, channels=self.channels[number - 1 : number])

    @property
    def clock(self) -> int | None:
        """Return the index of a channel among several that rises evenly (times or counts, not a signal), or None."""
        if len(self.channels) == 1:
            return None
        return next((number for number, channel in enumerate(self.channels) if _rises_evenly(channel)), None)


def at_one_rate(first: Recording, second: Recording) -> tuple[Recording, Recording]:
    """Return both at the lower of their rates, which keeps all the frequencies that they can have in common.

    If the file of one states no rate, both are assumed to have the same and returned unchanged.

    Raises
    ------
    ValueError
        As :meth:`Recording.resampled`.
    """
    if first.sampling_rate is None or second.sampling_rate is None:
        return first, second
    lower = min(first.sampling_rate, second.sampling_rate)
    return first.resampled(lower), second.resampled(lower)


def read_signal(source: Source) -> Recording:
    """Read a recording: WAV, FLAC, OGG, MP3, AIFF, NPY or text.

    Text holds one number per line, or several in columns (comma, semicolon, tab or space between them), which become
    channels. Lines before the first number are a header; lines that begin with ``#``, ``%`` or ``//`` and blank
    lines are skipped. A comma may be the decimal sign unless it separates the columns. Up to 5 damaged lines, at most
    one in a hundred, are mended and counted: NUL bytes after a number are removed, and an empty field is interpolated
    between its neighbours.
    An NPY array has one dimension, or two, of which the longer is time. Audio given by its path is streamed.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.

    Returns
    -------
    recording
        Its ``channels``, (channels, samples) float64 or, if long, float32, and its ``sampling_rate`` in Hz or None.

    Raises
    ------
    ValueError
        An empty, damaged or unknown file; a word, a NUL byte, NaN or a missing number in a text (with its line);
        fewer than 2 samples, more in all than the limit in force (320 million unless set otherwise, an hour of two
        channels) or than fit into the memory of one job, or more than 64 channels.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> recording = sl.read_signal(samples.recordings()["coast"].signal_1)
    >>> recording.channels.shape, recording.sampling_rate  # (channels, samples), Hz
    ((1, 176401), 44100.0)
    """
    sampling_rate, mended_lines = None, 0
    if isinstance(source, str | PathLike) and _is_audio(head := _head(source)):
        # An hour has more bytes than `read_bytes` accepts.
        channels, sampling_rate = _parse_audio(str(source), head)
    elif _is_audio(data := read_bytes(source, WHAT)):
        channels, sampling_rate = _parse_audio(_AudioBytes(data), data[:HEADER_BYTES])
    elif data.startswith(NPY_MAGIC):
        channels = _parse_npy(data)
    else:
        channels, mended_lines = parse_columns(data)
        _check_size(*channels.shape)
    bad = sum(channel.size - int(np.isfinite(channel).sum()) for channel in channels)
    if bad:
        raise ValueError(f"The {WHAT} holds {bad} NaN or infinite samples; every sample must be a finite number.")
    return Recording(channels, sampling_rate, mended_lines)


def _check_size(channels: int, samples: int) -> None:
    if not 1 <= channels <= MAX_CHANNELS:
        raise ValueError(f"The {WHAT} has {channels} channels; allowed are 1 to {MAX_CHANNELS}.")
    if samples < 2:
        raise ValueError(f"The {WHAT} holds {samples} samples; at least 2 are needed.")
    if channels * samples > limits().max_samples:
        raise ValueError(
            f"The {WHAT} holds {channels} × {samples} samples; at most {limits().max_samples:,} in all are accepted."
        )
    if channels * samples > LONGEST_DOUBLE:
        check_memory(Estimate(channels * samples * np.dtype(np.float32).itemsize, 0.0))


def _float_type(samples: int) -> Literal["float32", "float64"]:
    return "float64" if samples <= LONGEST_DOUBLE else "float32"


def _rises_evenly(channel: npt.NDArray[np.floating[Any]]) -> bool:
    """Return whether a channel never falls and follows a straight line, apart from the rounding of its numbers."""
    if channel.size < FEWEST_TICKS or channel[-1] <= channel[0] or (channel[1:] < channel[:-1]).any():
        return False
    even = np.linspace(channel[0], channel[-1], channel.size)
    return bool(np.abs(channel - even).max() <= UNEVENNESS * (channel[-1] - channel[0]))


def _head(path: str | PathLike[str]) -> bytes:
    with Path(path).open("rb") as file:
        return file.read(HEADER_BYTES)


def _is_audio(data: bytes) -> bool:
    return data.startswith(_AUDIO_MARKS + _MP3_SYNCS)


class _AudioBytes(io.BytesIO):
    """Bytes that ignore an impossible seek: damaged files make libsndfile ask for negative positions."""

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        try:
            return super().seek(offset, whence)
        except ValueError:
            return self.tell()


def _parse_audio(stream: str | _AudioBytes, head: bytes) -> tuple[Channels, float]:
    try:
        with soundfile.SoundFile(stream) as file:
            _check_size(file.channels, file.frames)
            channels, sampling_rate = _samples(file), float(file.samplerate)
    except RuntimeError as error:  # the base class of soundfile's own errors
        if head.startswith(b"FORM") and b"DWVW" in head:
            raise ValueError(f"The {WHAT} is an AIFF in the encoding DWVW, which is not accepted.") from error
        raise ValueError(
            f"The {WHAT} is an audio file that is damaged, cut short or without channels; accepted are {ACCEPTED}."
        ) from error
    _check_size(*channels.shape)
    if sampling_rate <= 0:
        raise ValueError(f"The {WHAT} has a sampling rate of {sampling_rate:g} Hz; it must be above 0.")
    return channels, sampling_rate


def _samples(file: soundfile.SoundFile) -> Channels:
    """Return the (channels, samples) of an opened file, decoded block by block into the final array.

    A header may promise more than follows: memory that is never written to costs nothing. Some encodings (GSM 6.10)
    cannot be read in one go at all.
    """
    dtype = _float_type(file.channels * file.frames)
    channels = np.empty((file.channels, file.frames), dtype=dtype)
    count, size = 0, max(1, _BLOCK // file.channels)
    while count < channels.shape[1]:
        block = file.read(min(size, channels.shape[1] - count), dtype=dtype, always_2d=True)
        if not len(block):
            return channels[:, :count].copy()
        channels[:, count : count + len(block)] = block.T
        count += len(block)
    return channels


def _parse_npy(data: bytes) -> Channels:
    array = parse_npy(data, WHAT)
    if array.ndim not in (1, 2):
        raise ValueError(f"The {WHAT} (.npy) has shape {array.shape}; allowed are (samples,) and (channels, samples).")
    channels = np.atleast_2d(array)
    if channels.shape[0] > channels.shape[1]:
        channels = channels.T
    _check_size(*channels.shape)
    with np.errstate(invalid="ignore", over="ignore"):  # signalling NaN; the caller counts all non-finite samples
        return np.array(channels, dtype=_float_type(channels.size), order="C")
