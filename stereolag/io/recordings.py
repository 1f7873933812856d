"""Recordings as files: audio, columns of numbers and NumPy arrays, read from untrusted bytes; WAV, written."""

from __future__ import annotations

import codecs
import io
import itertools
import math
import re
from collections.abc import Iterator
from contextlib import suppress
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
from stereolag.io.sources import HEADER_BYTES, NPY_MAGIC, Source, parse_npy, quote, read_bytes

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

BLOCK = 2**20
"""Samples decoded or written, and characters parsed, at a time."""

_MP3_SYNCS = (b"\xff\xfb", b"\xff\xfa", b"\xff\xf3", b"\xff\xf2", b"\xff\xe3", b"\xff\xe2")
_AUDIO_MARKS = (b"RIFF", b"RIFX", b"RF64", b"fLaC", b"OggS", b"ID3", b"FORM", *_MP3_SYNCS)


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
    sampling_rate, mended_lines, data = None, 0, b""
    if isinstance(source, str | PathLike):
        with Path(source).open("rb") as file:
            data = file.read(HEADER_BYTES)
    streamed = data.startswith(_AUDIO_MARKS)  # an hour has more bytes than `read_bytes` accepts
    data = data if streamed else read_bytes(source, WHAT)
    if data.startswith(_AUDIO_MARKS):
        channels, sampling_rate = _parse_audio(str(source) if streamed else _AudioBytes(data), data[:HEADER_BYTES])
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
    count, size = 0, max(1, BLOCK // file.channels)
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


# Columns of numbers in a text.

ALLOWED = "allowed are finite numbers, in columns separated by comma, semicolon, tab or space"
MAX_TEXT_BYTES = 64 * 2**20
MAX_HEADER_LINES = 200

MOST_MENDED = 5
LINES_PER_MENDED = 100
"""At most `MOST_MENDED` damaged lines are mended, and at most one in `LINES_PER_MENDED`."""

_STRAY_NULS = re.compile(r"(?<=[0-9.])\0+(?=[ \t,;\n]|\Z)")
"""NUL characters directly after a complete number."""
_COMMENT = re.compile(r"(?:#|%|//)[^\n]*")


def parse_columns(data: bytes) -> tuple[npt.NDArray[np.float64], int]:
    """Return the columns of a text as (columns, rows), and the number of mended lines.

    A few lines (at most 5, and one in a hundred) may be damaged: NUL bytes after a complete number are removed, and an
    empty field is interpolated between the numbers above and below it.

    Parameters
    ----------
    data
        The text: UTF-8, UTF-16 with its byte order mark, or Latin-1; lines end in LF, CRLF or CR.

    Raises
    ------
    ValueError
        No number at all, too long a text, or a line with anything else, a NUL byte, or another count of numbers than
        the first; the error names the line.
    """
    text = _decoded(data)
    allowed = min(MOST_MENDED, (text.count("\n") + 1) // LINES_PER_MENDED)
    text, mended = _without_nuls(text, allowed)
    text = _COMMENT.sub("", text)
    first_line, separator, columns = _layout(text)
    parts = []
    for line, block in _blocks(text, first_line):
        part, filled = _numbers(block, line, separator, columns, allowed - mended)
        parts.append(part)
        mended += filled
    table = np.concatenate(parts, axis=1)
    for column in table if mended else ():
        missing = np.isnan(column)
        column[missing] = np.interp(np.flatnonzero(missing), np.flatnonzero(~missing), column[~missing])
    return table, mended


def _decoded(data: bytes) -> str:
    if len(data) > MAX_TEXT_BYTES:
        raise ValueError(
            f"The text has {len(data) / 1e6:.0f} MB; at most {MAX_TEXT_BYTES / 1e6:.0f} MB are accepted: save it as "
            "WAV or NPY instead."
        )
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _without_nuls(text: str, allowed: int) -> tuple[str, int]:
    """Return the text without stray NUL characters, and the number of lines that had some."""
    if "\0" not in text:
        return text, 0
    mended = _STRAY_NULS.sub("", text)
    lines = {text.count("\n", 0, found.start()) for found in itertools.islice(_STRAY_NULS.finditer(text), allowed + 1)}
    if "\0" in mended or len(lines) > allowed:
        raise ValueError(f"Line {text.count(chr(10), 0, text.index(chr(0))) + 1} holds a NUL byte; {ALLOWED}.")
    return mended, len(lines)


def _layout(text: str) -> tuple[int, str | None, int]:
    """Return the number of the first line of numbers, its separator (None: spaces) and its count of columns."""
    lines = ((number, line.strip()) for number, line in enumerate(io.StringIO(text), start=1))
    for number, line in itertools.islice((one for one in lines if one[1]), MAX_HEADER_LINES):
        for separator in (";", "\t", ",", None):
            fields = (line if separator == "," else line.replace(",", ".")).split(separator)
            if (separator is None or separator in line) and None not in map(_number, fields):
                return number, separator, len(fields)
    raise ValueError(f"No line of the text holds numbers alone; {ALLOWED}.")


def _number(field: str) -> float | None:
    """Return the number in a field as NumPy reads it, None if there is none."""
    try:
        return None if "_" in field else float(field)
    except ValueError:
        return None


def _blocks(text: str, first_line: int) -> Iterator[tuple[int, str]]:
    """Yield blocks of whole lines from `first_line` on, not only blank ones, with the number of their first line."""
    lines = io.StringIO(text)
    for _ in range(first_line - 1):
        lines.readline()
    while block := lines.readlines(BLOCK):
        joined = "".join(block)
        if not joined.isspace():
            yield first_line, joined
        first_line += len(block)


def _numbers(
    block: str, first_line: int, separator: str | None, columns: int, allowed: int
) -> tuple[npt.NDArray[np.float64], int]:
    """Return the (columns, rows) of a block, NaN in fields that were empty, and the number of lines with such."""
    if separator != ",":
        block = block.replace(",", ".")  # a decimal comma
    with suppress(ValueError):
        table = np.loadtxt(io.StringIO(block), delimiter=separator, comments=None, ndmin=2)
        if table.shape[1] == columns and np.isfinite(table).all():
            return table.T, 0
    lines = [[field.strip() for field in line.split(separator)] for line in block.split("\n")]
    gaps = sum(len(fields) == columns and any(fields) and not all(fields) for fields in lines)
    rows = [
        _row(fields, number, columns, may_fill=gaps <= allowed)
        for number, fields in enumerate(lines, start=first_line)
        if fields not in ([], [""])
    ]
    return np.array(rows).T, gaps


def _row(fields: list[str], line: int, columns: int, *, may_fill: bool) -> list[float]:
    """Return the numbers of a line, NaN in empty fields that may be filled; ValueError about anything else."""
    may_fill = may_fill and any(fields) and len(fields) == columns
    row = []
    for field in fields:
        number = math.nan if may_fill and not field else _number(field)
        if number is None:
            raise ValueError(f"Line {line} {f'holds {quote(field)}' if field else 'lacks a number'}; {ALLOWED}.")
        if field and not math.isfinite(number):
            raise ValueError(f"Line {line} holds {number}; {ALLOWED}.")
        row.append(number)
    if len(row) != columns:
        raise ValueError(f"Line {line} holds {len(row)} numbers and the lines before it {columns}; {ALLOWED}.")
    return row


# Writing.

WAV_BYTES = 2**32
"""A WAV file counts its bytes in 32 bits; two channels of 32-bit floats take 8 bytes per sample."""

WAV_RATES = (1, 500_000_000)
"""Whole sampling rates, Hz, for which a WAV file can also store its bytes per second."""


def wav(signal: npt.ArrayLike, sampling_rate: float) -> bytes:
    """Return a recording as a 16-bit WAV file, as loud as it can be without clipping.

    Parameters
    ----------
    signal
        (samples,) finite numbers.
    sampling_rate
        Samples per second, rounded, since a WAV file stores a whole number.
    """
    samples = np.asarray(signal, dtype=np.float64)
    loudest = float(np.abs(samples).max(initial=0.0)) or 1.0
    stream = io.BytesIO()
    soundfile.write(stream, (samples / loudest * 32767).astype(np.int16), round(sampling_rate), format="WAV")
    return stream.getvalue()


def aligned_wav(signal_1: npt.ArrayLike, signal_2: npt.ArrayLike, lag: int, sampling_rate: float) -> bytes:
    """Return both recordings as one stereo WAV of 32-bit floats, sensor 1 on the left, with the lag removed.

    Nothing is cut off: before a recording begins and after it ends, its mean takes its place. Values are kept unless
    one is outside -1..1, where players would clip it: then both recordings are divided by the largest.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) finite numbers.
    lag
        Samples, positive where signal 2 hears the event later.
    sampling_rate
        Samples per second, rounded, since a WAV file stores a whole number.

    Raises
    ------
    ValueError
        As :func:`check_aligned_wav` does.
    """
    from stereolag.signals.lag import aligned, aligned_length  # not loaded by those who only read

    # They keep their type: a converted copy of an hour would take a gigabyte.
    first, second = np.asarray(signal_1), np.asarray(signal_2)
    check_aligned_wav(first.size, second.size, lag, sampling_rate)
    length = aligned_length(first.size, second.size, lag)
    loudest = max(1.0, *(max(float(signal.max()), -float(signal.min())) for signal in (first, second)))
    means = float(first.mean(dtype=np.float64)), float(second.mean(dtype=np.float64))
    stream = io.BytesIO()
    with soundfile.SoundFile(stream, "w", round(sampling_rate), 2, "FLOAT", format="WAV") as file:
        for start in range(0, length, BLOCK):
            part = aligned(first, second, lag, start, min(start + BLOCK, length), means=means)
            file.write((part / loudest).astype(np.float32))
    return stream.getvalue()


def check_aligned_wav(size_1: int, size_2: int, lag: int, sampling_rate: float) -> None:
    """Refuse recordings that :func:`aligned_wav` cannot store; far quicker than trying.

    Raises
    ------
    ValueError
        A sampling rate that a WAV file cannot store, or recordings too long for one.
    """
    from stereolag.signals.lag import aligned_length

    lowest, highest = WAV_RATES
    if not lowest <= sampling_rate <= highest:
        raise ValueError(
            f"sampling_rate is {sampling_rate:g}; a WAV file holds {lowest} to {highest:,} samples a second."
        )
    most = WAV_BYTES // 8 - BLOCK
    length = aligned_length(size_1, size_2, lag)
    if length > most:
        raise ValueError(f"The aligned recordings have {length:,} samples; a stereo WAV file holds {most:,}.")
