"""A video that can be watched while it is written: the same as a file, in one-second pieces."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import av

from stereolag.core.arrays import Rgb
from stereolag.sequences.video import VideoWriter, index_first


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
        written = self._sink.taken()
        if written:
            self.collected = frames if self.pieces else 0
            self.pieces.append(written)


class _Sink(io.RawIOBase):
    """A stream that buffers written bytes until they are taken."""

    def __init__(self) -> None:
        super().__init__()
        self._written = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self._written += data
        return len(data)

    def taken(self) -> bytes:
        """Return the bytes written since the last call."""
        written, self._written = bytes(self._written), bytearray()
        return written


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
