"""Sound from untrusted bytes: audio files by libsndfile; videos, phones' formats and the rest by FFmpeg."""

from __future__ import annotations

import io
import re
from collections import deque
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import numpy as np
import numpy.typing as npt
import soundfile

from stereolag.io.clocks import MAX_CHANNELS, Channels, Gap, Recording, check_size, chosen_track, float_type
from stereolag.io.formats import WHAT, SoundFormat
from stereolag.io.sources import HEADER_BYTES, quote

if TYPE_CHECKING:  # loaded on first use, since it takes tens of megabytes
    from av.audio.frame import AudioFrame
    from av.audio.stream import AudioStream
    from av.container import InputContainer

BLOCK = 2**20
"""Samples decoded at a time."""


CODECS = frozenset(
    [
        *("aac", "aac_latm", "mp3", "mp3float", "mp2", "mp2float", "ac3", "eac3", "opus", "libopus", "vorbis", "flac"),
        *("alac", "amrnb", "amrwb", "libopencore_amrnb", "libopencore_amrwb", "wmav1", "wmav2", "wmapro", "gsm_ms"),
        *("adpcm_ms", "adpcm_ima_wav", "adpcm_ima_qt", "adpcm_swf", "adpcm_yamaha", "speex", "libspeex"),
    ]
)
"""The codecs that phones, cameras and editors write, besides PCM; FFmpeg has hundreds more."""

ANEW = "export it again, best as WAV or FLAC"

DELAYED = "its format states no delay of the codec: the sound may be up to 2,112 samples late"

UNKNOWN_FRAMES = 2**62
"""libsndfile's number of samples of a FLAC that does not state it is larger."""

MOST_CHUNKS = 1000
MOST_PADDING = 8
"""Bytes behind the samples of a WAV that may be no chunk."""
_CHUNKS = frozenset(
    [b"fmt ", b"data", b"LIST", b"fact", b"bext", b"JUNK", b"junk", b"cue ", b"smpl", b"iXML", b"id3 ", b"PAD "]
)
_PRINTABLE = re.compile(rb"[ -~]{4}")
_TAGS = b"ID3", b"TAG"
"""Beginnings of what players write behind the chunks: title and artist."""
_PLAIN = (1, 3, 6, 7, 0xFFFE)
"""Codings of a WAV that are always decoded: PCM, floats, A-law, µ-law, and those of the extended header."""

_STATE_LENGTH = ("mov", "flac")
"""Formats whose length FFmpeg reads instead of guessing it."""

MICROSECONDS = 1_000_000
_LATE_S = 0.1
"""Sound later than this is missing from a file: shorter steps are the rounding of its times."""


def read_sound(source: Path | bytes, form: SoundFormat, track: int | str = 1) -> Recording:
    """Return the sound of a file; of several tracks, one.

    The delay that AAC, MP3 and Opus add at the beginning (1,024 to 2,112 samples for AAC) is removed where the file
    states it: in the edit list of MP4 and MOV, the codec delay of Matroska and WebM, the header of Opus, and the LAME
    tag of MP3. Plain AAC (ADTS), AVI, Windows Media and MPEG state none: there the sound stays that much late.
    Sound begins with the file, as the pictures of a video do: what is missing by its times, at the beginning or later,
    is filled with silence and, above 0.1 s, named as a gap.

    Parameters
    ----------
    source
        A path, which is streamed, or the bytes of the file.
    form
        Its format, from :func:`sound_format`.
    track
        Number, from 1, or name of the audio track.

    Raises
    ------
    ValueError
        No sound, no such track, a codec that is not decoded, a damaged file, or a size beyond the limits.
    """
    with closing(source.open("rb") if isinstance(source, Path) else io.BytesIO(source)) as stream:
        wave = _Wave(stream) if form.name == "WAV" else None
        if form.is_audio:
            with suppress(RuntimeError):  # the base class of soundfile's own errors
                if wave and wave.is_wrong:
                    recording = _by_libsndfile(_Spliced(stream, wave.head(), wave.start))
                    recording = replace(recording, notes=(wave.mended, *recording.notes))
                else:
                    recording = _by_libsndfile(str(source) if isinstance(source, Path) else _Spliced(stream))
                return replace(recording, track=chosen_track(recording.tracks, track))
        import av

        stream.seek(0)
        try:
            return _by_ffmpeg(str(source) if isinstance(source, Path) else stream, form, track)
        except (av.FFmpegError, EOFError) as error:
            fault = wave.fault if wave else "damaged, cut short or in an unknown coding"
            stream.seek(0)
            if form.name == "AIFF" and b"DWVW" in stream.read(HEADER_BYTES):
                fault = "in the coding DWVW, which is not decoded"
            raise ValueError(f"The {WHAT} is {form.a_file} that is {fault}; {ANEW}.") from error


# By libsndfile.


class _Spliced(io.RawIOBase):
    """A stream from `start` on with another beginning; an impossible seek is ignored.

    Damaged files make libsndfile ask for negative positions.
    """

    def __init__(self, stream: BinaryIO, head: bytes = b"", start: int = 0) -> None:
        super().__init__()
        self._stream, self._head, self._start, self._place = stream, head, start, 0
        self._size = len(head) + stream.seek(0, io.SEEK_END) - start

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        place = offset + (0, self._place, self._size)[whence]
        self._place = place if place >= 0 else self._place
        return self._place

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        part = self._head[self._place : self._place + len(view)]
        if not part:
            self._stream.seek(self._place - len(self._head) + self._start)
            part = self._stream.read(len(view))
        view[: len(part)] = part
        self._place += len(part)
        return len(part)


def _by_libsndfile(stream: str | _Spliced) -> Recording:
    with soundfile.SoundFile(stream) as file:
        if file.frames >= UNKNOWN_FRAMES or (not file.frames and file.format != "WAV"):
            raise RuntimeError("the header does not state the number of samples")
        check_size(file.channels, file.frames)
        if file.samplerate <= 0:
            raise ValueError(f"The {WHAT} has a sampling rate of {file.samplerate} Hz; it must be above 0.")
        channels, stated, rate = _samples(file), file.frames, float(file.samplerate)
    short = channels.shape[1] < stated
    notes = (f"cut short: {channels.shape[1]:,} of {stated:,} samples are there",) if short else ()
    return Recording(channels, rate, notes=notes)


def _samples(file: soundfile.SoundFile) -> Channels:
    """Return the (channels, samples) of an opened file, decoded block by block into the final array.

    A header may promise more than follows: memory that is never written to costs nothing. Some encodings (GSM 6.10)
    cannot be read in one go at all.
    """
    dtype = float_type(file.channels * file.frames)
    channels = np.empty((file.channels, file.frames), dtype=dtype)
    count, size = 0, max(1, BLOCK // file.channels)
    while count < channels.shape[1]:
        block = file.read(min(size, channels.shape[1] - count), dtype=dtype, always_2d=True)
        if not len(block):
            return channels[:, :count].copy()
        channels[:, count : count + len(block)] = block.T
        count += len(block)
    return channels


# The header of a WAV, which an interrupted recording leaves unfinished.


class _Wave:
    """The chunks of a WAV up to its samples.

    Attributes
    ----------
    layout
        The content of the chunk that describes the samples; empty if there is none.
    start, claimed, there
        Where the samples begin, how many bytes of them the header claims, and how many follow; all 0 if none do.
    is_wrong
        Whether the header contradicts the file, which nevertheless holds samples.
    """

    def __init__(self, stream: BinaryIO) -> None:
        size, self._stream = stream.seek(0, io.SEEK_END), stream
        self._magic = self._at(0, 4)
        self._order: Literal["little", "big"] = "big" if self._magic == b"RIFX" else "little"
        self.layout, self.start, self.claimed, self.there = b"", 0, 0, 0
        offset, odd, size_64 = 12, False, 0
        for _ in range(MOST_CHUNKS):
            name, length = self._chunk(offset)
            if name == b"fmt ":
                self.layout = self._at(offset + 8, min(length, 256))
            elif name == b"ds64":
                size_64 = int.from_bytes(self._at(offset + 16, 8), "little")
            elif name == b"data":
                self.start, self.there = offset + 8, size - offset - 8
                self.claimed = size_64 if length == 2**32 - 1 and size_64 else length
                break
            elif len(name) < 4:
                break
            offset += 8 + length
            if length % 2:
                unpadded = self._chunk(offset)[0] in _CHUNKS and self._chunk(offset + 1)[0] not in _CHUNKS
                odd, offset = odd or unpadded, offset + (not unpadded)
        goes_on = self.claimed < self.there and not self._is_chunk(self.start + self.claimed, size)
        self.is_wrong = self.there > 0 and bool(self.layout) and (self.claimed > self.there or goes_on or odd)

    def _at(self, offset: int, count: int) -> bytes:
        self._stream.seek(offset)
        return self._stream.read(count)

    def _chunk(self, offset: int) -> tuple[bytes, int]:
        head = self._at(offset, 8)
        return head[:4], int.from_bytes(head[4:], self._order)

    def _is_chunk(self, offset: int, size: int) -> bool:
        """Return whether another chunk, a tag or only a few bytes follow; with the padding byte or without it."""
        for place in (offset + offset % 2, offset):
            name, length = self._chunk(place)
            is_named = _PRINTABLE.fullmatch(name) and place + 8 + length <= size + 1
            if place + MOST_PADDING >= size or name.startswith(_TAGS) or is_named:
                return True
        return False

    def head(self) -> bytes:
        """Return a header that is right for all the bytes there are."""
        length = min(self.there, 2**32 - 64 - len(self.layout))
        parts = b"WAVEfmt ", len(self.layout), self.layout + b"\0" * (len(self.layout) % 2) + b"data", length
        body = b"".join(part if isinstance(part, bytes) else part.to_bytes(4, self._order) for part in parts)
        whole = (len(body) + length).to_bytes(4, self._order)
        return (b"RIFX" if self._order == "big" else b"RIFF") + whole + body

    @property
    def mended(self) -> str:
        """What was wrong, in words."""
        said = "no length" if self.claimed == 2**32 - 1 else f"{self.claimed:,} bytes of sound"
        return f"header mended: it states {said}, and {self.there:,} bytes are there"

    @property
    def fault(self) -> str:
        """What makes a file unreadable, in words."""
        if len(self.layout) < 16:
            return "cut short before the layout of its samples is stated"
        channels = int.from_bytes(self.layout[2:4], self._order)
        if not 1 <= channels <= MAX_CHANNELS:
            return f"of {channels} channels by its header, where 1 to {MAX_CHANNELS} are allowed"
        if not self.start:
            return "without sound: it ends before its samples, or holds none"
        coding = int.from_bytes(self.layout[:2], self._order)
        return "damaged" if coding in _PLAIN else f"in the coding {coding:#06x}, which is not decoded, or damaged"


# By FFmpeg.


def _by_ffmpeg(file: str | BinaryIO, form: SoundFormat, track: int | str) -> Recording:
    import av

    # Never let FFmpeg guess: some formats it knows are lists of addresses that it would fetch.
    options = {"protocol_whitelist": "file"}
    with av.open(file, "r", format=form.demuxer, options=options, metadata_errors="replace") as container:
        streams = container.streams.audio
        if not streams:
            raise ValueError(f"The {WHAT} is {form.a_file} without sound.")
        names = tuple(f"{number}{_described(stream)}" for number, stream in enumerate(streams, start=1))
        number = chosen_track(names, track)
        context = streams[number - 1].codec_context
        if context is None:
            raise EOFError("an unknown codec")
        if not (context.name in CODECS or context.name.startswith("pcm_")):
            coding = quote(context.name)
            raise ValueError(f"The {WHAT} is {form.a_file} in the coding {coding}, which is not decoded; {ANEW}.")
        context.thread_count = 1
        stream = streams[number - 1]
        recording = _decoded(container, stream)
        notes = list(recording.notes)
        if not (form.states_delay or context.name.startswith("pcm_")):
            notes.append(DELAYED)
        stated = round(float((stream.duration or 0) * (stream.time_base or 0)) * context.sample_rate)
        there = recording.channels.shape[1]
        if form.demuxer in _STATE_LENGTH and stated - there > _LATE_S * context.sample_rate:
            notes.append(f"cut short: {there:,} of {stated:,} samples are there")
        return replace(recording, tracks=names, track=number, notes=tuple(notes))


def _described(stream: AudioStream) -> str:
    said = [stream.metadata.get("title", ""), stream.metadata.get("language", "")]
    said = [text for text in said if text and text != "und"]
    return f" ({', '.join(said)})" if said else ""


def _decoded(container: InputContainer, stream: AudioStream) -> Recording:
    """Return the sound of a stream from the beginning of its file on; where there is none, it is silent."""
    blocks: deque[npt.NDArray[Any]] = deque()
    gaps: list[Gap] = []
    faults: list[Exception] = []
    count, rate, number = 0, 0, 0
    start_s = (container.start_time or 0) / MICROSECONDS
    for frame in _frames(container, stream, faults):
        block = _samples_of(frame)
        if not rate:
            rate, number = frame.sample_rate, len(block)
        if frame.sample_rate != rate or len(block) != number:
            continue
        late = 0 if frame.time is None else round((frame.time - start_s) * rate) - count
        if late > (_LATE_S * rate if blocks else 0):
            check_size(number, count + late)
            blocks.append(np.zeros((number, late), block.dtype))
            if late > _LATE_S * rate:
                gaps.append(Gap(count / rate, late / rate))
            count += late
        blocks.append(block)
        count += block.shape[1]
        check_size(number, max(count, 2))
    if rate <= 0:
        raise EOFError("no packet can be decoded")
    check_size(number, count)
    channels = np.empty((number, count), float_type(number * count))
    place = 0
    while blocks:
        block = blocks.popleft()
        channels[:, place : place + block.shape[1]] = _scaled(block)
        place += block.shape[1]
    notes = (f"damaged in {len(faults)} place{'s' * (len(faults) > 1)}: sound is missing there",) if faults else ()
    return Recording(channels, float(rate), gaps=tuple(gaps), notes=notes)


def _frames(container: InputContainer, stream: AudioStream, faults: list[Exception]) -> Iterator[AudioFrame]:
    """Yield all frames that can be decoded; errors about others are added to `faults`."""
    import av

    try:
        for packet in container.demux(stream):
            try:
                yield from packet.decode()
            except av.FFmpegError as error:  # the sound of this packet is lost; that of later ones may be intact
                faults.append(error)
    except av.FFmpegError as error:
        faults.append(error)


def _samples_of(frame: AudioFrame) -> npt.NDArray[Any]:
    """Return the (channels, samples) of a frame, in the type it was decoded to."""
    samples = frame.to_ndarray()
    return samples if frame.format.is_planar else samples.reshape(-1, frame.layout.nb_channels).T


def _scaled(samples: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return samples of any type scaled to -1..1."""
    if samples.dtype.kind == "f":
        return samples
    half = 2.0 ** (8 * samples.dtype.itemsize - 1)
    return samples / half - (samples.dtype.kind == "u")
