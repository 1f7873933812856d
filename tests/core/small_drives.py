"""Small stereo sequences made for the tests: textures of known disparity, as pictures, archives and videos."""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import av
import numpy as np
from pairs import texture

from stereolag import StereoBM
from stereolag.core.arrays import EightBit, FloatMap
from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress
from stereolag.io.disparities import kitti_png
from stereolag.io.images import image_png
from stereolag.stereo.matcher import PixelMatches
from tests.archives import zipped

ROWS, COLS = 80, 120
DISPARITIES = (4, 5, 6, 7, 8, 9)
"""The constant disparity of each frame, px."""


def pair(disparity: int, seed: int) -> tuple[EightBit, EightBit]:
    """Return a left and a right picture of a plane at a disparity."""
    wide = np.rint(np.clip(texture(ROWS, COLS + 32, seed=seed), 0, 255)).astype(np.uint8)
    return wide[:, :COLS].copy(), wide[:, disparity : COLS + disparity].copy()


def pairs_of(disparities: Sequence[int] = DISPARITIES) -> list[tuple[EightBit, EightBit]]:
    return [pair(disparity, seed) for seed, disparity in enumerate(disparities)]


def write_folders(folder: Path, disparities: Sequence[int] = DISPARITIES) -> tuple[Path, Path, Path]:
    """Write pictures and truths to three folders, and return the folders."""
    truths = (np.full((ROWS, COLS), disparity, np.float32) for disparity in disparities)
    pairs = pairs_of(disparities)
    return write_frames(folder, [(*both, truth) for both, truth in zip(pairs, truths, strict=True)])


def write_frames(folder: Path, frames: Iterable[tuple[EightBit, EightBit, FloatMap]]) -> tuple[Path, Path, Path]:
    """Write left and right pictures and truths to three folders, and return the folders."""
    folders = folder / "left", folder / "right", folder / "truth"
    for one in folders:
        one.mkdir(parents=True)
    for number, (left, right, truth) in enumerate(frames):
        for one, content in zip(folders, (image_png(left), image_png(right), kitti_png(truth)), strict=True):
            (one / f"{number:03d}.png").write_bytes(content)
    return folders


def archive(disparities: Sequence[int] = DISPARITIES) -> bytes:
    """Return a ZIP with left/ and right/."""
    pairs = enumerate(pairs_of(disparities))
    sides = ("left", "right")
    return zipped({f"{side}/{n:03d}.png": image_png(both[i]) for n, both in pairs for i, side in enumerate(sides)})


def rows_of(out: Path) -> list[dict[str, str]]:
    with (out / "frames.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def contents(out: Path) -> dict[str, bytes]:
    """Return the maps in an output folder."""
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*.png")}


matched: list[int] = []


class Counting(StereoBM):
    """A matcher that records every frame it matches."""

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        matched.append(1)
        return super().match(left, right, progress)


def numbered(count: int, width: int = 96, height: int = 64) -> list[EightBit]:
    """Return colour pictures, each showing the 8 bits of its number as black and white blocks."""
    pictures = []
    for number in range(count):
        picture = np.zeros((height, width, 3), np.uint8)
        for bit in range(8):
            picture[:, bit * width // 8 : (bit + 1) * width // 8] = 235 if number >> bit & 1 else 20
        pictures.append(picture)
    return pictures


def number_in(picture: EightBit) -> int:
    """Return the number shown by one of these pictures."""
    width = picture.shape[1]
    grey = picture.reshape(*picture.shape[:2], -1).mean(axis=(0, 2))
    return sum(int(grey[(2 * bit + 1) * width // 16] > 127) << bit for bit in range(8))


def video(
    *tracks: Sequence[EightBit | None],
    codec: str = "libx264",
    kind: str = "mp4",
    rate: int = 10,
    every: int = 12,
    options: dict[str, str] | None = None,
    pixels: str = "yuv420p",
    rotation: int = 0,
    mirrored: bool = False,
    dropped: Sequence[int] = (),
    sound: np.ndarray | None = None,
) -> bytes:
    """Return pictures as a video of one track or more, by default with bidirectionally predicted frames.

    Players turn its frames by `rotation` degrees, and then show them `mirrored`; frames that are None, or whose numbers
    are `dropped`, leave gaps in time. Its sound has 8,000 samples a second.
    """
    stream = io.BytesIO()
    with av.open(stream, "w", format=kind) as container:
        written = []
        for pictures in tracks:
            track = container.add_stream(codec, rate=rate, options=options or {})
            assert isinstance(track, av.VideoStream)
            written.append(track)
            (track.height, track.width), track.pix_fmt = (
                next(one.shape[:2] for one in pictures if one is not None),
                pixels,
            )
            track.codec_context.gop_size = every
            if rotation or mirrored:
                track.set_display_rotation(rotation, hflip=mirrored)
        heard = None if sound is None else container.add_stream("pcm_s16le", rate=8000, layout="mono")
        for number in sorted({*range(len(tracks[0]))} - {*dropped}):
            for track, pictures in zip(written, tracks, strict=True):
                picture = pictures[number]
                if picture is None:
                    continue
                frame = av.VideoFrame.from_ndarray(picture, format="rgb24" if picture.ndim == 3 else "gray")
                frame.pts = number
                container.mux(track.encode(frame))
        for track in written:
            container.mux(track.encode())
        if heard is not None and sound is not None:
            samples = av.AudioFrame.from_ndarray(sound[None], "s16", "mono")
            samples.sample_rate = 8000
            container.mux(heard.encode(samples))
    return stream.getvalue()
