"""Videos of the maps of a sequence: an MP4 file, or its pieces while it is being written."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO, Self
from uuid import uuid4

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, Colorspace

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image
from stereolag.figures.pictures import NO_ANSWER, as_rgb, coloured

MAX_WIDTH_PX = 3840
"""Largest width that decoders in browsers and phones reliably accept, px."""


@dataclass(frozen=True)
class SequenceVideo:
    """The video of a sequence: the left pictures beside the maps of every method, in one colour range.

    Attributes
    ----------
    file
        An ".mp4" path, a binary file, or a video writer, which is left open.
    colours
        The disparities at the ends of the colour range, px; None: chosen from five frames.
    with_truth
        Whether the true disparity is shown too, after the maps.

    Raises
    ------
    ValueError
        If `colours` is not a range.
    """

    file: str | os.PathLike[str] | BinaryIO | VideoWriter
    colours: tuple[float, float] | None = None
    with_truth: bool = False

    def __post_init__(self) -> None:
        if self.colours is not None:
            low, high = self.colours
            if not -math.inf < low < high < math.inf:
                raise ValueError(
                    f"colours are {low:g} and {high:g} px; allowed are two finite numbers, the lower first."
                )


def panels(
    left: Image,
    maps: Sequence[FloatMap],
    colours: tuple[float, float],
    *,
    others: Sequence[Rgb] = (),
) -> Rgb:
    """Return the left picture, the maps (near is bright) and other pictures side by side, (H, n * W, 3) uint8.

    Each is cropped to even width and height: H.264 stores one colour per 2 × 2 px, which must not span two pictures.
    """
    rows, cols = (side // 2 * 2 for side in left.shape[:2])
    parts = [as_rgb(left), *(coloured(one, *colours) for one in maps), *others]
    return np.concatenate([part[:rows, :cols] for part in parts], axis=1)


def index_first(max_frames: int) -> dict[str, str]:
    """Return the options for an MP4 with its index first, with room for `max_frames` pictures."""
    return {"moov_size": str(8192 + 32 * max_frames)}


class VideoWriter:
    """Writer of pictures to a video that every browser plays: H.264, yuv420p, in an MP4 with its index first.

    Every second begins with a keyframe, so that players can seek. A file gets its final name when it is closed; if the
    work is cancelled or fails, it has the pictures written so far.

    Parameters
    ----------
    target
        A path that ends in ".mp4", or a readable, writable and seekable binary file object.
    frame_rate
        Hz.
    max_frames
        Largest number of pictures that will be written; space for their index is reserved.
    fragmented
        Whether to write pieces of a second, each with its own index, which can be read while the next is written.

    Raises
    ------
    ValueError
        If the path has another ending.
    """

    def __init__(
        self,
        target: str | os.PathLike[str] | BinaryIO | _Sink,
        frame_rate: float,
        max_frames: int,
        *,
        fragmented: bool = False,
    ) -> None:
        self._path = Path(target) if isinstance(target, str | os.PathLike) else None
        if self._path is not None and self._path.suffix.lower() != ".mp4":
            raise ValueError(f"video ends in {self._path.suffix!r}; a video is written as '.mp4'.")
        self._part = self._path and self._path.with_name(f".{uuid4().hex}.part")
        self._rate = Fraction(frame_rate).limit_denominator(1001)
        # A fragmented file consists of pieces that begin with a keyframe, each with its own index. Otherwise the index
        # takes some 20 bytes per picture; reserving its space avoids moving the pictures later.
        self._container = av.open(
            str(self._part) if self._part else target,
            "w",
            format="mp4",
            options={"movflags": "frag_keyframe+empty_moov+default_base_moof"}
            if fragmented
            else index_first(max_frames),
        )
        self._stream: av.VideoStream | None = None
        self._leading_blanks = 0
        self._fragmented = fragmented
        self.frames = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def write(self, picture: Rgb) -> None:
        """Append a picture, (H, W, 3) uint8; all take the size of the first one, made even."""
        if self._stream is None:
            self._stream = self._add_stream(picture.shape[1], picture.shape[0])
            for _ in range(self._leading_blanks):
                self.write_blank()
        fitted = _fitted(picture, self._stream.width, self._stream.height)
        planes = np.asarray(cv2.cvtColor(fitted, cv2.COLOR_RGB2YUV_I420), dtype=np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts = self.frames
        self.frames += 1
        self._container.mux(self._stream.encode(frame))

    def write_blank(self) -> None:
        """Append a grey picture in place of a damaged frame, so that later frames keep their time."""
        if self._stream is None:
            self._leading_blanks += 1  # written once the size is known
        else:
            self.write(np.full((self._stream.height, self._stream.width, 3), NO_ANSWER, np.uint8))

    def close(self) -> None:
        """Complete the file and give it its final name; without any pictures there is no file."""
        try:
            if self._stream is not None:
                self._container.mux(self._stream.encode())
            self._container.close()
            if self._path is not None and self._part is not None and self.frames:
                self._part.replace(self._path)
        finally:
            if self._part is not None:
                self._part.unlink(missing_ok=True)

    def _add_stream(self, width: int, height: int) -> av.VideoStream:
        shrink = min(1.0, MAX_WIDTH_PX / width)
        stream = self._container.add_stream("libx264", rate=self._rate)
        stream.width, stream.height = (max(2, int(side * shrink) // 2 * 2) for side in (width, height))
        stream.pix_fmt = "yuv420p"
        stream.codec_context.time_base = 1 / self._rate
        stream.codec_context.gop_size = max(1, round(self._rate))
        # As OpenCV converts: limited range, with the weights of Rec. 601.
        stream.codec_context.color_range, stream.codec_context.colorspace = ColorRange.MPEG, Colorspace.ITU601
        # A fixed quantiser looks no worse than a constant rate factor (41 to 48 dB), which estimates a picture's cost.
        # With zero latency each picture is encoded before the next one arrives, and a piece ends with its second.
        stream.options = {"preset": "ultrafast", "qp": "20", **({"tune": "zerolatency"} if self._fragmented else {})}
        return stream


def _fitted(picture: Rgb, width: int, height: int) -> Rgb:
    """Return a picture at another size: cropped by a pixel to an even size, or scaled."""
    rows, cols = picture.shape[:2]
    if cols - width in (0, 1) and rows - height in (0, 1):
        return np.ascontiguousarray(picture[:height, :width])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


class VideoPieces(VideoWriter):
    """Writer of pictures to a fragmented MP4 (ISO/IEC 14496-12, §8.8), in memory.

    The first piece has the data that decoders need to start; each following piece is a second of pictures that begins
    with a keyframe. Players append the pieces as they arrive (Media Source Extensions).

    Parameters
    ----------
    frame_rate
        Hz.

    Attributes
    ----------
    pieces
        The complete pieces, oldest first.
    collected
        Number of pictures in them.
    """

    def __init__(self, frame_rate: float) -> None:
        self.pieces: list[bytes] = []
        self.collected = 0
        self._sink = _Sink()
        super().__init__(self._sink, frame_rate, 0, fragmented=True)

    def write(self, picture: Rgb) -> None:
        """Append a picture, as :meth:`VideoWriter.write` does."""
        super().write(picture)
        # The picture just written opens the next piece.
        self._collect(self.frames - 1)

    def close(self) -> None:
        """Complete the last piece."""
        super().close()
        self._collect(self.frames)

    def _collect(self, frames: int) -> None:
        if self._sink.written:
            self.collected = frames if self.pieces else 0
            self.pieces.append(bytes(self._sink.written))
            self._sink.written.clear()


class _Sink:
    """A stream that can only be written to, as bytes already taken cannot be changed."""

    def __init__(self) -> None:
        self.written = bytearray()

    def write(self, data: Any) -> int:
        self.written += data
        return len(data)


def whole_video(pieces: Sequence[bytes]) -> bytes:
    """Return the pieces of a video as one file with its index first, without re-encoding the pictures."""
    file = io.BytesIO()
    with av.open(io.BytesIO(b"".join(pieces)), "r") as source:
        pictures = source.streams.video[0]
        packets = [packet for packet in source.demux(pictures) if packet.dts is not None]
        with av.open(file, "w", format="mp4", options=index_first(len(packets))) as target:
            stream = target.add_stream_from_template(pictures)
            for packet in packets:
                packet.stream = stream
                target.mux(packet)
    return file.getvalue()
