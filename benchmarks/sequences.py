"""Frames a second of a whole sequence, from files to files and video, beside the same by hand with OpenCV."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import av
import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.pairs import DATA
from stereolag import preset
from stereolag.loops.bands import available_cores
from stereolag.sequences import open_sequence, run_sequence
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
ASKED = {'preset("fast")': ("≥ 10", "≥ 30", "≥ 0.5", "≥ 0.8"), 'preset("accurate")': ("≥ 5", "≥ 10", "", "")}
"""Frames a second and their share of the peer's, each what must and what should be."""

Grey = npt.NDArray[np.uint8]


def by_hand(compute: Callable[[Grey, Grey], npt.NDArray[np.int16]], folder: Path) -> None:
    """Write the maps and the video of the drive with OpenCV and PyAV alone, one frame after the other."""
    stream: av.VideoStream | None = None
    with av.open(str(folder / "drive.mp4"), "w", options={"movflags": "faststart"}) as container:
        for path in sorted((DRIVE / "left").iterdir()):
            left, right = (
                np.asarray(cv2.imread(str(DRIVE / side / path.name), cv2.IMREAD_GRAYSCALE), np.uint8)
                for side in ("left", "right")
            )
            disparity = np.maximum(compute(left, right), 0)
            cv2.imwrite(str(folder / path.name), (disparity * 16).astype(np.uint16))
            share = np.minimum(disparity * np.float32(255 / 16 / NUM_DISPARITIES), 255).astype(np.uint8)
            coloured = cv2.applyColorMap(share, cv2.COLORMAP_VIRIDIS)
            picture = np.concatenate([cv2.cvtColor(left, cv2.COLOR_GRAY2BGR), coloured], axis=1)
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
    """Return how long a pipeline takes into an empty folder."""
    with TemporaryDirectory() as folder:
        start = time.perf_counter()
        work(Path(folder))
        return time.perf_counter() - start


def pipelines() -> dict[str, Callable[[Path], object]]:
    """Return every pipeline by its name."""
    block = cv2.StereoBM.create(NUM_DISPARITIES, 21)
    semi_global = cv2.StereoSGBM.create(0, NUM_DISPARITIES, 5, 8 * 25, 32 * 25)

    def ours(matcher: StereoMatcher) -> Callable[[Path], object]:
        # Opened anew in each round, as by hand the folder is listed anew.
        return lambda folder: run_sequence(
            open_sequence(DRIVE / "left", DRIVE / "right"), matcher, folder / "maps", video=folder / "drive.mp4"
        )

    found = {name: ours(matcher) for name, matcher in OURS.items()}
    found["cv2.StereoBM by hand"] = lambda folder: by_hand(block.compute, folder)
    found["cv2.StereoSGBM by hand"] = lambda folder: by_hand(semi_global.compute, folder)
    return found


def sequence_table() -> tuple[str, dict[str, dict[str, float]]]:
    """Return the table of frames a second as Markdown, and its figures: the best of rounds in turn."""
    jobs, frames = pipelines(), len(open_sequence(DRIVE / "left", DRIVE / "right"))
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for round_number in range(ROUNDS + 1):
        for name, job in jobs.items():
            seconds = seconds_of(job)
            if round_number:
                times[name].append(seconds)
    rates = {name: frames / min(taken) for name, taken in times.items()}
    peers = {
        name: rates[
            "cv2.StereoSGBM by hand" if name in ('preset("accurate")', "sl.StereoSGBM") else "cv2.StereoBM by hand"
        ]
        for name in rates
    }
    lines = [
        "| pipeline | frames a second | must | aim | × its peer by hand | must | aim | s for 1500 frames |",
        "|---|---|---|---|---|---|---|---|",
    ]
    figures = {}
    for name, rate in rates.items():
        must, aim, must_share, aim_share = ASKED.get(name, ("", "", "", ""))
        share = rate / peers[name]
        lines.append(
            f"| {name} | {rate:.1f} | {must} | {aim} | {share:.2f} | {must_share} | {aim_share} | {1500 / rate:.0f} |"
        )
        spread = statistics.median(times[name]) / min(times[name])
        figures[name] = {"frames_per_second": rate, "of_peer": share, "median_of_best": spread}
    lines += [
        "",
        f"KITTI, {frames} grey pairs of 1226 × 370 px, {NUM_DISPARITIES} disparities: PNGs read, matched, a 16-bit PNG "
        f"and an H.264 video of picture and map written; ours with the table of figures besides. The best of {ROUNDS} "
        f"rounds in turn on {available_cores()} cores, load {os.getloadavg()[0]:.1f}. Peer of accurate and SGBM: SGBM, "
        "of the others BM.",
    ]
    return "\n".join(lines), figures
