"""A video in pieces equals one in a single file, and can be watched before it is complete."""

from __future__ import annotations

import io
from pathlib import Path

import av
import numpy as np
from small_drives import COLS, DISPARITIES, ROWS, write_folders

from stereolag.sequences import SequenceVideo, open_sequence, run_sequence
from stereolag.sequences.targets import SequenceMemory
from stereolag.sequences.video import VideoPieces, whole_video
from stereolag.stereo.opencv import StereoBM

RATE = 5


def ramp(count: int) -> list[np.ndarray]:
    return [np.full((64, 96, 3), 20 + 8 * number, np.uint8) for number in range(count)]


def levels(data: bytes) -> list[float]:
    with av.open(io.BytesIO(data), "r") as video:
        return [float(frame.to_ndarray(format="gray").mean()) for frame in video.decode(video=0)]


def test_every_piece_adds_a_second_that_can_be_shown() -> None:
    video = VideoPieces(RATE)
    for number, picture in enumerate(ramp(13)):
        video.write(picture)
        assert video.collected == number // RATE * RATE
    assert len(video.pieces) == 3  # the header for decoders, and two whole seconds
    assert len(levels(b"".join(video.pieces))) == 2 * RATE
    video.close()
    assert video.collected == 13
    shown = levels(b"".join(video.pieces))
    np.testing.assert_allclose(np.diff(shown), 8, atol=2.5)


def test_the_whole_video_has_all_pictures_and_its_index_first() -> None:
    video = VideoPieces(RATE)
    for picture in ramp(13):
        video.write(picture)
    video.close()
    file = whole_video(video.pieces)
    assert file.index(b"moov") < file.index(b"mdat")
    assert b"moof" not in file
    assert levels(file) == levels(b"".join(video.pieces))
    with av.open(io.BytesIO(file), "r") as container:
        stream = container.streams.video[0]
        assert (stream.frames, stream.average_rate) == (13, RATE)


def test_the_job_draws_into_pieces(tmp_path: Path) -> None:
    left, right, _ = write_folders(tmp_path / "frames")
    video, kept = VideoPieces(10.0), SequenceMemory()
    run_sequence(
        open_sequence(left, right),
        {"bm": StereoBM(num_disparities=16, block_size=9)},
        kept,
        video=SequenceVideo(video),
    )
    video.close()
    assert [number for number, _ in kept.records] == [*range(len(DISPARITIES))]
    assert video.frames == video.collected == len(DISPARITIES)
    assert kept.colours is not None
    with av.open(io.BytesIO(b"".join(video.pieces)), "r") as container:
        assert container.streams.video[0].width == 2 * COLS
        assert container.streams.video[0].height == ROWS
