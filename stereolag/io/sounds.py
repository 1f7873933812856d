"""Sound from untrusted bytes: audio files by libsndfile; videos and formats of phones by FFmpeg."""

from __future__ import annotations

import io
import re
from collections import deque
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import numpy as np
import numpy.typing as npt
import soundfile

from stereolag.core.typography import counted
from stereolag.io.clocks import MAX_CHANNELS, Channels, Gap, Recording, check_size, chosen_track, float_type
from stereolag.io.formats import WHAT, SoundFormat
from stereolag.io.sources import HEADER_BYTES, quote

if TYPE_CHECKING:  # loaded on first use, since it takes tens of megabytes
    from av.audio.frame import AudioFrame
    from av.audio.stream import AudioStream
    from av.container import InputContainer

BLOCK_SAMPLES = 2**20
"""Samples decoded at a time."""


CODECS = frozenset(
    [
        *("aac", "aac_latm", "mp3", "mp3float", "mp2", "mp2float", "ac3", "eac3", "opus", "libopus", "vorbis", "flac"),
        *("alac", "amrnb", "amrwb", "libopencore_amrnb", "libopencore_amrwb", "wmav1", "wmav2", "wmapro", "gsm_ms"),
        *("adpcm_ms", "adpcm_ima_wav", "adpcm_ima_qt", "adpcm_swf", "adpcm_yamaha", "speex", "libspeex"),
    ]
)
"""Codecs of phones, cameras and editors, besides PCM; FFmpeg has hundreds more."""

EXPORT_AGAIN = "export it again, best as WAV or FLAC"

UNKNOWN_DELAY = "its format states no delay of the codec: the sound may be up to 2,112 samples late"

MIN_UNKNOWN_FRAMES = 2**62
"""Number of samples from which libsndfile means that a FLAC does not state it."""

MAX_CHUNKS = 1000
"""Chunks of a WAV that are searched for its samples."""
MAX_PADDING_BYTES = 8
"""Bytes after the samples of a WAV that need not be a chunk."""
_CHUNK_NAMES = frozenset(
    [b"fmt ", b"data", b"LIST", b"fact", b"bext", b"JUNK", b"junk", b"cue ", b"smpl", b"iXML", b"id3 ", b"PAD "]
)
_CHUNK_NAME = re.compile(rb"[ -~]{4}")
_TAGS = b"ID3", b"TAG"
"""Beginnings of the tags, title and artist, that players write after the chunks."""
_DECODED_CODINGS = (1, 3, 6, 7, 0xFFFE)
"""Codings of a WAV that are always decoded: PCM, floats, A-law, µ-law, and the extended header."""

_DEMUXERS_WITH_LENGTH = ("mov", "flac")
"""Formats whose length FFmpeg reads from the file instead of estimating it."""

_MIN_GAP_S = 0.1
"""Delay between frames above which sound is missing; shorter delays come from the rounding of times."""


def read_sound(source: Path | bytes, form: SoundFormat, track: int | str = 1) -> Recording:
    """Return one audio track of a file.

    The delay that AAC, MP3 and Opus add at the beginning (1,024 to 2,112 samples for AAC) is removed where the file
    states it: in the edit list of MP4 and MOV, the codec delay of Matroska and WebM, the header of Opus, and the LAME
    tag of MP3. Plain AAC (ADTS), AVI, Windows Media and MPEG do not state it: there the sound remains late.
    Sound begins with the file, as the pictures of a video do: sound missing by its times, at the beginning or later,
    is replaced by silence and, above 0.1 s, reported as a gap.

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
        header = _WavHeader(stream) if form.name == "WAV" else None
        if form.is_audio:
            with suppress(RuntimeError):  # the base class of soundfile's own errors
                if header and header.is_inconsistent:
                    recording = _by_libsndfile(_SplicedStream(stream, header.mended(), header.start))
                    recording = replace(recording, notes=(header.mended_note, *recording.notes))
                else:
                    recording = _by_libsndfile(str(source) if isinstance(source, Path) else _SplicedStream(stream))
                return replace(recording, track=chosen_track(recording.tracks, track))
        import av

        stream.seek(0)
        try:
            return _by_ffmpeg(str(source) if isinstance(source, Path) else stream, form, track)
        except (av.FFmpegError, EOFError) as error:
            fault = header.fault if header else "damaged, cut short or in an unknown coding"
            stream.seek(0)
            if form.name == "AIFF" and b"DWVW" in stream.read(HEADER_BYTES):
                fault = "in the coding DWVW, which is not decoded"
            raise ValueError(f"The {WHAT} is {form.a_file} that is {fault}; {EXPORT_AGAIN}.") from error


# By libsndfile.


class _SplicedStream(io.RawIOBase):
    """A stream whose beginning, up to `start`, is replaced by `head`.

    Seeks to negative positions, which libsndfile tries on damaged files, are ignored.
    """

    def __init__(self, stream: BinaryIO, head: bytes = b"", start: int = 0) -> None:
        super().__init__()
        self._stream, self._head, self._start, self._place = stream, head, start, 0
        self._size = len(head) + stream.seek(0, io.SEEK_END) - start

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


def _by_libsndfile(stream: str | _SplicedStream) -> Recording:
    with soundfile.SoundFile(stream) as file:
        if file.frames >= MIN_UNKNOWN_FRAMES or (not file.frames and file.format != "WAV"):
            raise RuntimeError("the header does not state the number of samples")
        check_size(file.channels, file.frames)
        if file.samplerate <= 0:
            raise ValueError(f"The {WHAT} has a sampling rate of {file.samplerate} Hz; it must be above 0.")
        channels, stated, rate = _decode_samples(file), file.frames, float(file.samplerate)
    is_short = channels.shape[1] < stated
    notes = (f"cut short: {channels.shape[1]:,} of {stated:,} samples are there",) if is_short else ()
    return Recording(channels, rate, notes=notes)


def _decode_samples(file: soundfile.SoundFile) -> Channels:
    """Return the (channels, samples) of an opened file, decoded block by block into the final array.

    If a header promises more samples than there are, the rest of the array is never written to and takes no memory.
    Some encodings (GSM 6.10) cannot be read in one call at all.
    """
    dtype = float_type(file.channels * file.frames)
    channels = np.empty((file.channels, file.frames), dtype=dtype)
    count, size = 0, max(1, BLOCK_SAMPLES // file.channels)
    while count < channels.shape[1]:
        block = file.read(min(size, channels.shape[1] - count), dtype=dtype, always_2d=True)
        if not len(block):
            return channels[:, :count].copy()
        channels[:, count : count + len(block)] = block.T
        count += len(block)
    return channels


# The header of a WAV, which is left unfinished if a recording is interrupted.


class _WavHeader:
    """The chunks of a WAV up to its samples.

    Attributes
    ----------
    layout
        The content of the chunk that describes the samples; empty if there is none.
    start, stated, present
        Offset of the samples, and their bytes, as stated in the header and as present in the file; 0 without samples.
    is_inconsistent
        Whether the file holds samples, but its header contradicts it.
    """

    def __init__(self, stream: BinaryIO) -> None:
        size, self._stream = stream.seek(0, io.SEEK_END), stream
        self._order: Literal["little", "big"] = "big" if self._read_at(0, 4) == b"RIFX" else "little"
        self.layout, self.start, self.stated, self.present = b"", 0, 0, 0
        offset, lacks_padding, size_64 = 12, False, 0
        for _ in range(MAX_CHUNKS):
            name, length = self._chunk(offset)
            if name == b"fmt ":
                self.layout = self._read_at(offset + 8, min(length, 256))
            elif name == b"ds64":
                size_64 = int.from_bytes(self._read_at(offset + 16, 8), "little")
            elif name == b"data":
                self.start, self.present = offset + 8, size - offset - 8
                self.stated = size_64 if length == 2**32 - 1 and size_64 else length
                break
            elif len(name) < 4:
                break
            offset += 8 + length
            if length % 2:
                unpadded = self._chunk(offset)[0] in _CHUNK_NAMES and self._chunk(offset + 1)[0] not in _CHUNK_NAMES
                lacks_padding, offset = lacks_padding or unpadded, offset + (not unpadded)
        is_understated = self.stated < self.present and not self._is_end(self.start + self.stated, size)
        self.is_inconsistent = bool(self.layout and self.present > 0) and (
            self.stated > self.present or is_understated or lacks_padding
        )

    def _read_at(self, offset: int, count: int) -> bytes:
        self._stream.seek(offset)
        return self._stream.read(count)

    def _chunk(self, offset: int) -> tuple[bytes, int]:
        head = self._read_at(offset, 8)
        return head[:4], int.from_bytes(head[4:], self._order)

    def _is_end(self, offset: int, size: int) -> bool:
        """Return whether samples end at an offset: a chunk, a tag or a few bytes follow, with or without padding."""
        for place in (offset + offset % 2, offset):
            name, length = self._chunk(place)
            is_chunk = _CHUNK_NAME.fullmatch(name) and place + 8 + length <= size + 1
            if place + MAX_PADDING_BYTES >= size or name.startswith(_TAGS) or is_chunk:
                return True
        return False

    def mended(self) -> bytes:
        """Return a header that states the bytes present."""
        length = min(self.present, 2**32 - 64 - len(self.layout))
        parts = b"WAVEfmt ", len(self.layout), self.layout + b"\0" * (len(self.layout) % 2) + b"data", length
        body = b"".join(part if isinstance(part, bytes) else part.to_bytes(4, self._order) for part in parts)
        size = (len(body) + length).to_bytes(4, self._order)
        return (b"RIFX" if self._order == "big" else b"RIFF") + size + body

    @property
    def mended_note(self) -> str:
        """The contradiction as a phrase."""
        length = "no length" if self.stated == 2**32 - 1 else f"{self.stated:,} bytes of sound"
        return f"header mended: it states {length}, and {self.present:,} bytes are there"

    @property
    def fault(self) -> str:
        """The reason why a file cannot be read, as a phrase."""
        if len(self.layout) < 16:
            return "cut short before the layout of its samples is stated"
        channels = int.from_bytes(self.layout[2:4], self._order)
        if not 1 <= channels <= MAX_CHANNELS:
            return f"of {channels} channels by its header, where 1 to {MAX_CHANNELS} are allowed"
        if not self.start:
            return "without sound: it ends before its samples, or holds none"
        coding = int.from_bytes(self.layout[:2], self._order)
        if coding in _DECODED_CODINGS:
            return "damaged"
        return f"in the coding {coding:#06x}, which is not decoded, or damaged"


# By FFmpeg.


def _by_ffmpeg(file: str | BinaryIO, form: SoundFormat, track: int | str) -> Recording:
    import av

    # Never let FFmpeg guess: some formats it knows are lists of addresses that it would fetch.
    with av.open(
        file, "r", format=form.demuxer, options={"protocol_whitelist": "file"}, metadata_errors="replace"
    ) as container:
        streams = container.streams.audio
        if not streams:
            raise ValueError(f"The {WHAT} is {form.a_file} without sound.")
        names = tuple(f"{number}{_stream_label(stream)}" for number, stream in enumerate(streams, start=1))
        number = chosen_track(names, track)
        stream = streams[number - 1]
        context = stream.codec_context
        if context is None:
            raise EOFError("an unknown codec")
        if not (context.name in CODECS or context.name.startswith("pcm_")):
            raise ValueError(
                f"The {WHAT} is {form.a_file} in the coding {quote(context.name)}, which is not decoded; "
                f"{EXPORT_AGAIN}."
            )
        context.thread_count = 1
        recording = _decode_stream(container, stream)
        notes = list(recording.notes)
        if not (form.states_delay or context.name.startswith("pcm_")):
            notes.append(UNKNOWN_DELAY)
        stated = round(float((stream.duration or 0) * (stream.time_base or 0)) * context.sample_rate)
        present = recording.channels.shape[1]
        if form.demuxer in _DEMUXERS_WITH_LENGTH and stated - present > _MIN_GAP_S * context.sample_rate:
            notes.append(f"cut short: {present:,} of {stated:,} samples are there")
        return replace(recording, tracks=names, track=number, notes=tuple(notes))


def _stream_label(stream: AudioStream) -> str:
    known = [tag for tag in map(stream.metadata.get, ("title", "language")) if tag and tag != "und"]
    return f" ({', '.join(known)})" if known else ""


def _decode_stream(container: InputContainer, stream: AudioStream) -> Recording:
    """Return the sound of a stream from the beginning of its file on, silent where it has none."""
    from stereolag.io.videos import decoded_frames

    blocks: deque[npt.NDArray[Any]] = deque()
    gaps: list[Gap] = []
    faults: list[Exception] = []
    sample_count, rate, channel_count = 0, 0, 0
    start_s = (container.start_time or 0) / 1_000_000  # FFmpeg counts microseconds
    for frame in decoded_frames(container, stream, faults):
        block = _frame_samples(frame)
        if not rate:
            rate, channel_count = frame.sample_rate, len(block)
        if frame.sample_rate != rate or len(block) != channel_count:
            continue
        missing = 0 if frame.time is None else round((frame.time - start_s) * rate) - sample_count
        if missing > (_MIN_GAP_S * rate if blocks else 0):
            check_size(channel_count, sample_count + missing)
            blocks.append(np.zeros((channel_count, missing), block.dtype))
            if missing > _MIN_GAP_S * rate:
                gaps.append(Gap(sample_count / rate, missing / rate))
            sample_count += missing
        blocks.append(block)
        sample_count += block.shape[1]
        check_size(channel_count, max(sample_count, 2))
    if rate <= 0:
        raise EOFError("no packet can be decoded")
    check_size(channel_count, sample_count)
    channels = np.empty((channel_count, sample_count), float_type(channel_count * sample_count))
    place = 0
    while blocks:  # each block is freed once it is copied
        block = blocks.popleft()
        channels[:, place : place + block.shape[1]] = _scale(block)
        place += block.shape[1]
    notes = (f"damaged in {counted(len(faults), 'place')}: sound is missing there",) if faults else ()
    return Recording(channels, float(rate), gaps=tuple(gaps), notes=notes)


def _frame_samples(frame: AudioFrame) -> npt.NDArray[Any]:
    """Return the (channels, samples) of a frame, in the type of its decoder."""
    samples = frame.to_ndarray()
    return samples if frame.format.is_planar else samples.reshape(-1, frame.layout.nb_channels).T


def _scale(samples: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return samples of any type scaled to -1..1."""
    if samples.dtype.kind == "f":
        return samples
    full_scale = 2.0 ** (8 * samples.dtype.itemsize - 1)
    return samples / full_scale - (samples.dtype.kind == "u")
