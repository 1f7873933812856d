"""Frames per second of whole sequences, from files to maps and video, compared with the same work by hand in OpenCV."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import av
import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.pairs import DATA
from stereolag import preset
from stereolag.loops.bands import available_cores
from stereolag.samples import drives as example_drives
from stereolag.sequences import StereoSequence, example_sequence, open_sequence, run_sequence
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import StereoBM, StereoSGBM

DRIVE = DATA / "sequences" / "kitti_seq1"
NUM_DISPARITIES = 64
ROUNDS = 3

OURS: dict[str, StereoMatcher] = {
    'preset("fast")': preset("fast", num_disparities=NUM_DISPARITIES),
    'preset("accurate")': preset("accurate", num_disparities=NUM_DISPARITIES),
    "sl.StereoBM": StereoBM(num_disparities=NUM_DISPARITIES, block_size=21),
    "sl.StereoSGBM": StereoSGBM(num_disparities=NUM_DISPARITIES),
}
REQUIRED = {'preset("fast")': ("≥ 10", "≥ 30", "≥ 0.5", "≥ 0.8"), 'preset("accurate")': ("≥ 5", "≥ 10", "", "")}
"""Frames per second and their ratio to the peer's, each with the required and the desired value."""

OF_SGBM = ('preset("accurate")', "sl.StereoSGBM")
"""Pipelines whose peer is SGBM by hand; the peer of the others is BM."""

Grey = npt.NDArray[np.uint8]


class Drive(NamedTuple):
    """The frames of a drive, opened by the library and as files."""

    name: str
    open: Callable[[], StereoSequence]
    files: list[tuple[Path, Path]]


def drives() -> list[Drive]:
    """Return the example drive, and KITTI's if present."""
    found = []
    for name, example in example_drives().items():
        found.append(Drive(name, partial(example_sequence, example), [*zip(example.left, example.right, strict=True)]))
    if DRIVE.is_dir():
        files = [(path, DRIVE / "right" / path.name) for path in sorted((DRIVE / "left").iterdir())]
        found.append(Drive("KITTI", lambda: open_sequence(DRIVE / "left", DRIVE / "right"), files))
    return found


def by_hand(
    compute: Callable[[Grey, Grey], npt.NDArray[np.int16]], files: list[tuple[Path, Path]], folder: Path
) -> None:
    """Write the maps and the video of a drive with only OpenCV and PyAV, frame by frame."""
    stream: av.VideoStream | None = None
    with av.open(str(folder / "drive.mp4"), "w", options={"movflags": "faststart"}) as container:
        for paths in files:
            pictures = [np.asarray(cv2.imread(str(path), cv2.IMREAD_ANYCOLOR), np.uint8) for path in paths]
            left, right = (
                np.asarray(cv2.cvtColor(one, cv2.COLOR_BGR2GRAY), np.uint8) if one.ndim == 3 else one
                for one in pictures
            )
            disparity = np.maximum(compute(left, right), 0)
            cv2.imwrite(str(folder / f"{paths[0].stem}.png"), (disparity * 16).astype(np.uint16))
            share = np.minimum(disparity * np.float32(255 / 16 / NUM_DISPARITIES), 255).astype(np.uint8)
            coloured = cv2.applyColorMap(share, cv2.COLORMAP_VIRIDIS)
            shown = pictures[0] if pictures[0].ndim == 3 else cv2.cvtColor(left, cv2.COLOR_GRAY2BGR)
            picture = np.concatenate([shown, coloured], axis=1)
            rows, cols = (side // 2 * 2 for side in picture.shape[:2])
            if stream is None:
                stream = container.add_stream("libx264", rate=10, options={"preset": "ultrafast", "crf": "20"})
                stream.width, stream.height, stream.pix_fmt = cols, rows, "yuv420p"
                stream.codec_context.gop_size = 10
            planes = np.asarray(cv2.cvtColor(picture[:rows, :cols], cv2.COLOR_BGR2YUV_I420), np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(planes, format="yuv420p")))
        if stream is not None:
            container.mux(stream.encode())


def seconds_of(work: Callable[[Path], object]) -> float:
    """Return the seconds that a pipeline takes to write into an empty folder."""
    with TemporaryDirectory() as folder:
        start = time.perf_counter()
        work(Path(folder))
        return time.perf_counter() - start


def pipelines(drive: Drive) -> dict[str, Callable[[Path], object]]:
    """Return every pipeline over a drive, by name."""
    block = cv2.StereoBM.create(NUM_DISPARITIES, 21)
    semi_global = cv2.StereoSGBM.create(0, NUM_DISPARITIES, 5, 8 * 25, 32 * 25)

    def ours(matcher: StereoMatcher) -> Callable[[Path], object]:
        # Opened in every round, because the pipelines by hand also read every file again.
        return lambda folder: run_sequence(drive.open(), matcher, folder / "maps", video=folder / "drive.mp4")

    found = {name: ours(matcher) for name, matcher in OURS.items()}
    found["cv2.StereoBM by hand"] = partial(by_hand, block.compute, drive.files)
    found["cv2.StereoSGBM by hand"] = partial(by_hand, semi_global.compute, drive.files)
    return found


def sequence_table() -> tuple[str, dict[str, dict[str, dict[str, float]]]]:
    """Return the table of frames per second as Markdown, and its figures by drive: the best of interleaved rounds."""
    lines = [
        "| drive | pipeline | frames a second | must | aim | × its peer by hand | must | aim | s for 1500 frames |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    figures = {}
    for drive in drives():
        figures[drive.name] = {}
        times = rounds_in_turn(pipelines(drive))
        rates = {name: len(drive.files) / min(taken) for name, taken in times.items()}
        for name, rate in rates.items():
            must, aim, must_share, aim_share = REQUIRED.get(name, ("", "", "", ""))
            share = rate / rates["cv2.StereoSGBM by hand" if name in OF_SGBM else "cv2.StereoBM by hand"]
            lines.append(
                f"| {drive.name} | {name} | {rate:.1f} | {must} | {aim} | {share:.2f} | {must_share} | {aim_share} | "
                f"{1500 / rate:.0f} |"
            )
            spread = statistics.median(times[name]) / min(times[name])
            figures[drive.name][name] = {"frames_per_second": rate, "of_peer": share, "median_of_best": spread}
    lines += [
        "",
        f"KITTI: 51 grey pairs of 1226 × 370 px, PNG; motorway: 60 coloured pairs of 881 × 400 px, WebP. Read, matched "
        f"({NUM_DISPARITIES} disparities), a 16-bit PNG and an H.264 video of picture and map written; ours with the "
        f"table of figures besides, on the motorway with errors against the truth. The best of {ROUNDS} rounds in turn "
        f"on {available_cores()} cores, load {os.getloadavg()[0]:.1f}. Peer of accurate and SGBM: SGBM, of the others "
        "BM.",
    ]
    return "\n".join(lines), figures


def rounds_in_turn(jobs: dict[str, Callable[[Path], object]]) -> dict[str, list[float]]:
    """Return the seconds of every job in interleaved rounds, after one warm-up round."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for round_number in range(ROUNDS + 1):
        for name, job in jobs.items():
            seconds = seconds_of(job)
            if round_number:
                times[name].append(seconds)
    return times
