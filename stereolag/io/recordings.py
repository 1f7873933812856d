"""Recordings as files: sound, tables and arrays, read from untrusted bytes; WAV and aligned recordings, written."""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import soundfile

from stereolag.core.arrays import Vector
from stereolag.core.typography import counted
from stereolag.io.arrays import MAT_MAGIC, NPY_MAGIC, mat_arrays, npz_arrays, parse_npy
from stereolag.io.clocks import Channels, Recording, check_size, chosen_track, float_type
from stereolag.io.column_clocks import is_time_heading, recording_from_table, time_unit, times_from_numbers
from stereolag.io.columns import MAX_STATED, MIN_STATED, read_columns
from stereolag.io.formats import UNPACK, WHAT, check_text, sound_format
from stereolag.io.sounds import read_sound
from stereolag.io.sources import Source, beginning, is_archive, read_archive, read_bytes
from stereolag.io.stamps import read_stamps

if TYPE_CHECKING:
    from stereolag.signals import SignalLag

_RATE_NAMES = re.compile(
    r"(?:f_?s|sr|f_?sample|(?:sampl\w*_?)?(?:rate|freq(?:uency)?))(?:_?(?P<kilo>k?)hz)?", re.IGNORECASE
)
_STEP_NAMES = re.compile(
    r"(?:dt|ts|t?(?:sampl\w*_?)?(?:interval|period|increment)|sampl\w*_?time|x_?inc(?:rement)?)(?:_[num]?s(?:ec)?)?",
    re.IGNORECASE,
)


def read_signal(source: Source, *, track: int | str = 1) -> Recording:
    """Read a recording: sound of audio files and videos, columns of numbers, or an array.

    Sound is that of WAV, W64, FLAC, OGG, MP3, AIFF, AU and CAF, and of MP4, M4A, MOV, MKV, WebM, AVI, AAC, 3GP, AMR,
    Windows Media, FLV and MPEG (:func:`stereolag.io.sounds.read_sound` says which codec delays remain). A WAV from an
    interrupted recording is read as far as it goes. Audio given by its path is streamed.

    Text holds one number per line, or several in columns separated by comma, semicolon, tab, bar or space, as loggers,
    oscilloscopes and spreadsheets write them (:func:`stereolag.io.columns.read_columns`). A column of times is not a
    channel: it gives the sampling rate, the start and the gaps. Samples at uneven times are put on an even clock.

    An array of NPY, NPZ or MAT (version 7 and older) has one dimension, or two, of which the longer is time. In NPZ
    and MAT, an array named like a time ("t") gives the clock, and a number named like a rate ("fs") the rate.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object.
    track
        Which audio track of a video, array of an NPZ or MAT file, or sensor of a text in which several take turns: its
        number, from 1, or its name.

    Returns
    -------
    recording
        Its ``channels``, (channels, samples) float64 or, if long, float32, and its ``sampling_rate`` in Hz or None;
        its ``notes`` list repairs and omissions.

    Raises
    ------
    ValueError
        An empty or damaged file, or one of another kind, which the error names; no such track; in text, a field that
        is not a number (with its line and column), or times that go back; fewer than 2 samples, more in total than the
        current limit (320 million unless set otherwise, an hour of two channels) or than fit into the memory of one
        job, or more than 64 channels.
    OSError
        A path that cannot be opened.

    Examples
    --------
    >>> import stereolag as sl
    >>> from stereolag import samples
    >>> recording = sl.read_signal(samples.recordings()["coast"].signal_1)
    >>> recording.channels.shape, recording.sampling_rate  # (channels, samples), Hz
    ((1, 176401), 44100.0)
    """
    file = Path(source) if isinstance(source, str | PathLike) else read_bytes(source, WHAT)
    head = beginning(file)
    form = sound_format(head)
    if form is not None:  # by its path, since an hour of audio has more bytes than `read_bytes` accepts
        recording = read_sound(file, form, track)
        bad = sum(channel.size - int(np.isfinite(channel).sum()) for channel in recording.channels)
        if bad:
            raise ValueError(
                f"The {WHAT} holds {counted(bad, 'NaN or infinite sample')}; every sample must be a finite number."
            )
        return recording
    data = read_bytes(file, WHAT)
    if data.startswith(NPY_MAGIC):
        return _from_arrays({"1": parse_npy(data, WHAT)}, track, "NPY")
    if is_archive(data):
        return _from_arrays(_read_npz(data), track, "NPZ")
    if MAT_MAGIC.match(data):
        return _from_arrays(mat_arrays(data, WHAT, _check_samples), track, "MAT")
    check_text(head)
    return read_columns(data, track)


# Arrays.


def _read_npz(data: bytes) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of numbers in an NPZ archive; the error for any other archive names its kind."""
    archive = read_archive(data)
    arrays = npz_arrays(archive, WHAT, "biufMm")
    if not arrays:
        names = set(archive.names)
        office = "xl/workbook.xml" in names or "content.xml" in names
        what, remedy = ("a workbook (XLSX, ODS)", "save the sheet as CSV") if office else ("a ZIP archive", UNPACK)
        raise ValueError(f"The {WHAT} is {what}, which is not read: {remedy}.")
    return {
        name: array.astype("timedelta64[ns]").astype(np.float64) / 1e9 if array.dtype.kind == "m" else array
        for name, array in arrays.items()
    }


def _check_samples(shape: tuple[int, ...]) -> None:
    if max(shape) > 1:
        check_size(min(shape), max(shape))


def _from_arrays(arrays: Mapping[str, npt.NDArray[Any]], track: int | str, form: str) -> Recording:
    """Return one of several arrays as a recording, on the clock given by the others."""
    series = {name: array for name, array in arrays.items() if array.size != 1} or arrays
    times = {
        name: array.ravel()
        for name, array in series.items()
        if len(series) > 1
        and (is_time_heading(name) or array.dtype.kind == "M")
        and array.size == max(array.shape, default=1)
    }
    tracks = tuple(name for name in series if name not in times) or tuple(series)
    number = chosen_track(tracks, track)
    channels = _channels(series[tracks[number - 1]], form)
    clock = next(
        (
            read_stamps(np.datetime_as_string(array.astype("datetime64[ns]")).tolist())
            if array.dtype.kind == "M"
            else times_from_numbers(array.astype(np.float64), name)[0]
            for name, array in times.items()
            if array.size == channels.shape[1] and (array == array).any()  # NaN and NaT do not equal themselves
        ),
        None,
    )
    recording = recording_from_table(
        channels,
        ("",) * len(channels),
        range(1, len(channels) + 1),
        clock=clock,
        stated_rate=_stated_rate(arrays),
    )
    return replace(recording, tracks=tracks, track=number)


def _stated_rate(arrays: Mapping[str, npt.NDArray[Any]]) -> float | None:
    """Return the sampling rate, Hz, by the first number named like a rate or an interval; None if there is none."""
    numbers = {
        name: float(array.flat[0]) for name, array in arrays.items() if array.size == 1 and array.dtype.kind in "iuf"
    }
    for name, value in numbers.items():
        if MIN_STATED < value < MAX_STATED:
            if named := _RATE_NAMES.fullmatch(name):
                return value * (1000 if named["kilo"] else 1)
            if _STEP_NAMES.fullmatch(name):
                return 1 / (value * (time_unit(name) or 1.0))
    return None


def _channels(array: npt.NDArray[Any], form: str) -> Channels:
    """Return the (channels, samples) floats of an array of one or two dimensions; NaN is allowed."""
    if array.ndim not in (1, 2):
        raise ValueError(
            f"The {WHAT} ({form}) has shape {array.shape}; allowed are (samples,) and (channels, samples)."
        )
    if array.dtype.kind == "M":
        raise ValueError(f"The {WHAT} ({form}) holds {array.dtype.name}; allowed are integers and floats.")
    if array.dtype.kind == "c":
        raise ValueError(f"The {WHAT} ({form}) holds complex numbers; save their real part or their magnitude.")
    channels = np.atleast_2d(array)
    if channels.shape[0] > channels.shape[1]:
        channels = channels.T
    check_size(*channels.shape)
    with np.errstate(invalid="ignore", over="ignore"):  # signalling NaN
        channels = np.array(channels, dtype=float_type(channels.size), order="C")
    bad = sum(int(np.isinf(channel).sum()) for channel in channels)
    if bad:
        raise ValueError(f"The {WHAT} holds {counted(bad, 'infinite sample')}; every sample must be a finite number.")
    return channels


# Writing.


def wav(signal: npt.ArrayLike, sampling_rate: float) -> bytes:
    """Return finite numbers as a 16-bit WAV file, as loud as it can be without clipping.

    The sampling rate is rounded, since a WAV file stores a whole number.
    """
    samples = np.asarray(signal, dtype=np.float64)
    peak = float(np.abs(samples).max(initial=0.0)) or 1.0
    stream = io.BytesIO()
    soundfile.write(stream, (samples / peak * 32767).astype(np.int16), round(sampling_rate), format="WAV")
    return stream.getvalue()


# Writing recording 2 on the clock of recording 1.

MAX_WAV_BYTES = 2**32
"""Size of a WAV file, which stores it in 32 bits; 32-bit floats take 4 bytes per sample."""

WAV_RATE_LIMITS_HZ = (1, 500_000_000)
"""Whole sampling rates for which the bytes per second also fit into the header of a WAV file."""


def write_aligned(
    file: Path | IO[bytes],
    suffix: str,
    signal_1: npt.ArrayLike,
    signal_2: npt.ArrayLike,
    lag: SignalLag | float,
    sampling_rate: float,
) -> None:
    """Write recording 2 on the clock of recording 1 (:func:`stereolag.align`), as long as recording 1.

    ``".wav"``: 32-bit floats; if a value is outside -1..1, where players clip, all are divided by the largest
    magnitude. ``".csv"``: ``time_s`` after the first sample of recording 1, and ``recording_2``.

    Parameters
    ----------
    file
        A path, which is not opened if the lag is refused, or a binary file.
    suffix
        The format: ``".wav"`` or ``".csv"``.
    signal_1, signal_2
        (N1,) and (N2,) finite numbers.
    lag
        The result for them, or a constant lag, samples.
    sampling_rate
        Samples per second; rounded in a WAV file, which stores a whole number.

    Raises
    ------
    ValueError
        A lag that is not sure, or at which the recordings do not overlap; and as :func:`check_wav`.
    OSError
        The folder does not exist, and so on.
    """
    from stereolag.signals.alignment import aligned_blocks

    # The signals keep their type: a converted copy of an hour would take a gigabyte.
    first, second = np.asarray(signal_1), np.asarray(signal_2)
    rest = aligned_blocks(first, second, lag)
    blocks = itertools.chain([next(rest)], rest)  # errors about the lag come before the file is opened
    if suffix == ".wav":
        check_wav(first.size, sampling_rate)
    with file.open("wb") if isinstance(file, Path) else nullcontext(file) as stream:
        if suffix == ".wav":
            scale = max(1.0, float(second.max()), -float(second.min()))
            with soundfile.SoundFile(stream, "w", round(sampling_rate), 1, "FLOAT", format="WAV") as sound:
                for block in blocks:
                    sound.write((block / scale).astype(np.float32))
        else:
            _write_csv(stream, blocks, sampling_rate)


def _write_csv(table: IO[bytes], blocks: Iterator[Vector], sampling_rate: float) -> None:
    table.write(b"time_s,recording_2\n")
    first = 0
    for block in blocks:
        seconds = np.arange(first, first + block.size) / sampling_rate
        np.savetxt(table, np.column_stack((seconds, block)), fmt="%.10g", delimiter=",")
        first += block.size


def aligned_file(
    suffix: str, signal_1: npt.ArrayLike, signal_2: npt.ArrayLike, lag: SignalLag | float, sampling_rate: float
) -> bytes:
    """Return the file that :func:`write_aligned` writes."""
    stream = io.BytesIO()
    write_aligned(stream, suffix, signal_1, signal_2, lag, sampling_rate)
    return stream.getvalue()


def check_wav(samples: int, sampling_rate: float) -> None:
    """Refuse an aligned recording that does not fit into a WAV file, without writing one.

    Raises
    ------
    ValueError
        A sampling rate or a number of samples that a WAV file cannot store.
    """
    from stereolag.signals.alignment import BLOCK

    lowest, highest = WAV_RATE_LIMITS_HZ
    if not lowest <= sampling_rate <= highest:
        raise ValueError(
            f"sampling_rate is {sampling_rate:g}; a WAV file holds {lowest} to {highest:,} samples a second."
        )
    max_samples = MAX_WAV_BYTES // 4 - BLOCK
    if samples > max_samples:
        raise ValueError(f"The aligned recording has {samples:,} samples; a WAV file holds {max_samples:,}.")
