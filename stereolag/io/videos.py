"""Videos from untrusted bytes, with exact access to each frame by its number."""

from __future__ import annotations

import io
import threading
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property, lru_cache
from operator import attrgetter, itemgetter
from os import PathLike
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.audio.stream import AudioStream
from av.container import InputContainer
from av.stream import Disposition
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from stereolag.core.arrays import Vector
from stereolag.core.inputs import Image
from stereolag.core.jobs import limits
from stereolag.io.formats import sound_format
from stereolag.io.guard import GuardedObject
from stereolag.io.sources import Source, beginning, check_pixels, quote, read_bytes

ACCEPTED = "MP4, MOV, MKV, WebM, AVI, WMV, FLV and MPEG-TS"
WHAT = "video"
DAMAGED = f"The {WHAT} is damaged or cut short; accepted are whole files of {ACCEPTED}."
VIDEO_SUFFIXES = frozenset(["mp4", "m4v", "mov", "3gp", "mkv", "webm", "avi", "wmv", "asf", "flv", "ts", "mts", "m2ts"])

CAMERA_CODECS = ["h264", "hevc", "av1", "libdav1d", "vp8", "vp9", "mpeg4", "mjpeg", "ffv1", "png", "rawvideo", "h263"]
EDITOR_CODECS = ["prores", "cfhd", "dvvideo", "huffyuv", "ffvhuff", "msmpeg4v2", "msmpeg4", "wmv1", "wmv2", "wmv3"]
CODECS = frozenset([*CAMERA_CODECS, *EDITOR_CODECS])
"""The codecs that cameras and editors write; FFmpeg has hundreds more, few of them tested on hostile bytes."""

DEFAULT_RATE_HZ = 10.0
"""Frame rate of videos and pictures that state no plausible one, Hz."""

MIN_RATE_HZ, MAX_RATE_HZ = 0.01, 1000
"""Range of plausible frame rates."""

GAP_RATIO = 1.5
"""Intervals between frames that are this many times as long as usual are gaps: frames were dropped."""

_DEMUXERS = ("mov", "matroska", "avi", "asf", "flv", "mpegts")
_MAX_LATER_FRAMES = 64
"""Later frames that are decoded before a missing frame counts as damaged."""


class VideoFile:
    """The frames of a video by their numbers; a path is opened again after unpickling.

    It can be used by several threads, which take turns.

    Raises
    ------
    ValueError
        A file of another kind, without pictures, with an unsupported codec, damaged, or beyond the current limits
        (megapixels, frames, seconds). All are checked before a frame is decoded.
    """

    def __init__(self, source: Source, track: int = 0) -> None:
        self.source: Path | bytes = (
            Path(source).resolve() if isinstance(source, str | PathLike) else read_bytes(source, WHAT)
        )
        """The resolved path of the file, or its bytes."""
        self._track = track
        self._lock = threading.Lock()
        self._next = -1
        self._frames: Iterator[VideoFrame] | None = None
        stream = self._stream
        self.tracks = len(self._streams)
        """Number of tracks with pictures of one size, from the first on."""
        self._frame_times, self._keyframes = self._index()
        self.times_s = (np.array(self._frame_times) - self._frame_times[0]) * float(stream.time_base or 1)
        """Times at which the frames are shown, s after the first."""
        self.start_s = float(
            self._frame_times[0] * (stream.time_base or 1) - (self._container.start_time or 0) / av.time_base
        )
        """Time of the first frame, s after the file begins: its sound, or another track, may begin earlier."""
        interval = usual_interval(self.times_s)
        # The mean rate of the stream is rounder, but dropped frames lower it.
        gaps = interval is not None and (np.diff(self.times_s) > GAP_RATIO * interval).any()
        rate = 1 / interval if interval and gaps else stream.average_rate or stream.guessed_rate
        self.frame_rate = float(rate) if rate and MIN_RATE_HZ <= rate <= MAX_RATE_HZ else DEFAULT_RATE_HZ
        """Hz; gaps where frames were dropped do not count."""

    def __reduce__(self) -> tuple[Any, ...]:
        opened = _open_once if isinstance(self.source, Path) else type(self)
        return opened, (self.source, self._track)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.times_s)

    def frame(self, number: int) -> Image:
        """Return a frame, (rows, cols) grey or (rows, cols, 3) RGB, uint8, by its number, from 0.

        Successive frames are decoded in sequence; for any other, decoding starts at the last keyframe before it.
        A frame of a camera that was held upright or upside down, or mirrored, is turned as the file says.

        Raises
        ------
        IndexError
            No such number.
        ValueError
            A damaged frame; others are not affected.
        """
        self._check(number)
        with self._lock:
            try:
                frame = self._decode(number)
                image = frame.to_ndarray(format="gray" if frame.format.name.startswith("gray") else "rgb24")
                return _as_shown(image, frame.side_data.get("DISPLAYMATRIX"))
            except (av.FFmpegError, ValueError, EOFError) as error:
                self._frames = None
                raise ValueError(f"Frame {number} of the {WHAT} is damaged and cannot be decoded.") from error

    def _check(self, number: int) -> None:
        if not 0 <= number < len(self):
            raise IndexError(f"frame {number} of a {WHAT} of {len(self)}; allowed are 0 to {len(self) - 1}.")

    @cached_property
    def _container(self) -> InputContainer:
        form = sound_format(beginning(self.source))
        # Never let FFmpeg guess: some formats it knows are lists of addresses that it would fetch.
        if form is None or form.demuxer not in _DEMUXERS:
            raise ValueError(
                f"This is not a {WHAT} that can be read, or its beginning is damaged; accepted are {ACCEPTED}."
            )
        file = str(self.source) if isinstance(self.source, Path) else io.BytesIO(self.source)
        try:
            return av.open(
                file, "r", format=form.demuxer, options={"protocol_whitelist": "file"}, metadata_errors="replace"
            )
        except av.FFmpegError as error:
            raise ValueError(DAMAGED) from error

    @cached_property
    def _streams(self) -> list[VideoStream]:
        """The first track, and all others with pictures of its size."""
        every = [one for one in self._container.streams.video if not one.disposition & Disposition.attached_pic]
        if not every:
            raise ValueError(f"The {WHAT} holds no pictures.")
        return [one for one in every if _size(one) == _size(every[0])]

    @cached_property
    def _stream(self) -> VideoStream:
        stream = self._streams[self._track]
        context = stream.codec_context
        if context is None or context.name not in CODECS:
            name = quote(context.name if context else "unknown")
            raise ValueError(
                f"The {WHAT} is coded as {name}; accepted are H.264, H.265, AV1, VP9, ProRes, Motion JPEG and others."
            )
        check_pixels(context.width, context.height, WHAT)
        # Frames may grow within a stream: FFmpeg refuses a larger one before it allocates memory for it.
        context.options = {"max_pixels": str(limits().max_pixels), "err_detect": "explode"}
        context.thread_count = 1  # leaves the cores to the matching
        return stream

    def _index(self) -> tuple[list[int], list[tuple[int, int]]]:
        """Return the sorted times of all frames, and of keyframes with the times to seek, in units of the stream."""
        max_frames, max_s = limits().max_frames, limits().max_video_s
        times: list[int] = []
        keyframes: list[tuple[int, int]] = []
        # An MPEG transport stream has no index: FFmpeg looks for the times at which frames are decoded.
        is_searched = self._container.format.name == "mpegts"
        with suppress(av.FFmpegError):  # of the end of a file cut short
            for packet in self._container.demux(self._stream):
                if packet.size == 0 or packet.is_discard:
                    continue
                time = packet.pts if packet.pts is not None else packet.dts
                if time is None:
                    raise ValueError(f"The {WHAT} does not say when its frames are shown; save it as MP4.")
                times.append(time)
                if packet.is_keyframe:
                    keyframes.append((time, packet.dts if is_searched and packet.dts is not None else time))
                if len(times) > max_frames:
                    raise ValueError(f"The {WHAT} holds more than {max_frames:,} frames, the most that is accepted.")
        if not keyframes:
            raise ValueError(DAMAGED)
        seconds = (max(times) - min(times)) * float(self._stream.time_base or 0)
        if seconds > max_s:
            raise ValueError(f"The {WHAT} is {seconds:,.0f} s long; at most {max_s:,} s are accepted.")
        return sorted(set(times)), sorted(keyframes)

    def _decode(self, number: int) -> VideoFrame:
        wanted = self._frame_times[number]
        if self._frames is None or number != self._next:
            place = bisect_right(self._keyframes, wanted, key=itemgetter(0)) - 1
            self._container.seek(self._keyframes[max(place, 0)][1], stream=self._stream, backward=True)
            self._stream.codec_context.flush_buffers()
            self._frames = decoded_frames(self._container, self._stream, faults=[])
        later_frames = 0
        for frame in self._frames:
            time = frame.pts if frame.pts is not None else frame.dts
            if time == wanted:
                self._next = number + 1
                if frame.is_corrupt:
                    raise ValueError("decoded from damaged packets")
                return frame
            later_frames += time is not None and time > wanted
            if later_frames > _MAX_LATER_FRAMES:
                break
        raise ValueError("the frame is missing")


def decoded_frames(
    container: InputContainer, stream: VideoStream | AudioStream, faults: list[Exception]
) -> Iterator[Any]:
    """Yield all frames that can be decoded, in the order in which they are shown.

    They begin at the container's current position. Errors of the others are added to `faults`.
    """
    try:
        for packet in container.demux(stream):
            try:
                yield from packet.decode()
            except av.FFmpegError as error:  # this packet is lost; later ones may be intact
                faults.append(error)
    except av.FFmpegError as error:
        faults.append(error)


class GuardedVideo(VideoFile):
    """An untrusted video, which a worker of the guard opens and decodes; otherwise as :class:`VideoFile`."""

    def __init__(self, source: Source, track: int = 0) -> None:
        self.source, self._track = read_bytes(source, WHAT), track
        self._guarded = GuardedObject(VideoFile, self.source, track)
        self.times_s, self.start_s, self.tracks, self.frame_rate = self._guarded.ask(
            attrgetter("times_s", "start_s", "tracks", "frame_rate")
        )

    def frame(self, number: int) -> Image:
        """Return a frame."""
        self._check(number)
        image: Image = self._guarded.ask(VideoFile.frame, number)
        return image


def _as_shown(image: Image, display_matrix: Any) -> Image:
    """Return a frame turned and mirrored, by the matrix, if any, that takes (x, y) to where it is shown."""
    if display_matrix is None:
        return image
    terms = np.frombuffer(display_matrix, np.int32, 5).astype(float)
    x_to_x, x_to_y, _, y_to_x, y_to_y = np.rint(terms / max(1, np.abs(terms).max())).astype(int)
    seen = image.swapaxes(0, 1) if x_to_y else image
    return np.ascontiguousarray(seen[:: x_to_y or y_to_y, :: y_to_x or x_to_x])


def _size(stream: VideoStream) -> tuple[int, int]:
    return stream.codec_context.width, stream.codec_context.height


def usual_interval(times_s: Vector) -> float | None:
    """Return the mean interval between frames without the gaps of dropped ones, s; None for a single frame."""
    steps = np.diff(times_s)
    return float(steps[steps <= GAP_RATIO * np.median(steps)].mean()) if len(steps) else None


@lru_cache(maxsize=8)
def _open_once(path: Path, track: int) -> VideoFile:
    """Return the video at a path, which a worker process that reads frame after frame opens only once."""
    return VideoFile(path, track)
