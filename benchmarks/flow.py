"""Accuracy and speed of the optical flow compared with OpenCV's Farnebäck and DIS, on exactly known motions."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.drive_motion import drive_lines
from benchmarks.flow_kinds import kinds_lines
from benchmarks.pairs import DATA, true_pairs
from benchmarks.timing import interleaved
from stereolag import optical_flow, read_disparity, read_image
from stereolag.core.inputs import as_grey
from stereolag.samples import DriveExample, drives, stereo_pairs

Picture: TypeAlias = npt.NDArray[np.uint8]
Flow: TypeAlias = npt.NDArray[np.float32]
"""(2, H, W): dy, dx; px."""
Motion: TypeAlias = Callable[[Any, Any], tuple[Any, Any]]
"""Maps (row, col) in the second frame to the (dy, dx) by which that pixel moved."""

OURS, FARNEBACK_15, FARNEBACK_21, DIS = "ours", "Farnebäck(15)", "Farnebäck(21)", "DIS medium"
MAX_MOTION_PX = 30
"""Largest synthetic motion, px."""

NOISE_LEVELS = 4.0
"""Standard deviation of the noise, grey levels."""

WRONG_PX = 3.0
"""Error above which a pixel counts as wrong, px."""


@dataclass(frozen=True)
class Case:
    """Two frames, the true flow from the first to the second (NaN: unknown), and the pixels visible in both."""

    name: str
    kind: str
    first: Picture
    second: Picture
    truth: Flow
    seen: npt.NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class FlowErrors:
    """Mean end-point error, px; % of pixels off by more than 3 px; mean error of pixels visible in both frames, px."""

    epe: float
    wrong: float
    epe_seen: float | None


def farneback(window: int, first: Picture, second: Picture) -> Flow:
    """Return OpenCV's Farnebäck flow with common parameters."""
    flow = cv2.calcOpticalFlowFarneback(as_grey(first), as_grey(second), None, 0.5, 5, window, 3, 7, 1.5, 0)  # type: ignore[call-overload]
    return np.asarray(np.moveaxis(flow, 2, 0)[::-1])


def dis(first: Picture, second: Picture) -> Flow:
    """Return OpenCV's dense inverse search flow."""
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(as_grey(first), as_grey(second), None)  # type: ignore[call-overload]
    return np.asarray(np.moveaxis(flow, 2, 0)[::-1])


def ours(first: Picture, second: Picture) -> Flow:
    """Return our flow with default settings and filled gaps."""
    flow = optical_flow(first, second, filling=True)
    return np.stack([flow.dy, flow.dx])


METHODS: dict[str, Callable[[Picture, Picture], Flow]] = {
    OURS: ours,
    FARNEBACK_15: lambda first, second: farneback(15, first, second),
    FARNEBACK_21: lambda first, second: farneback(21, first, second),
    DIS: dis,
}


def cases() -> Iterator[Case]:
    """Yield every case: our pictures moved, our stereo pairs, and the external pairs if present."""
    for number, (name, example) in enumerate(stereo_pairs().items()):
        left = read_image(example.left)
        yield moved(f"{name}, affine", left, affine(left.shape, 2 * number), 2 * number)
        yield moved(f"{name}, smooth", left, smooth(left.shape, 2 * number + 1), 2 * number + 1)
        seen = read_image(example.occlusion) == 0
        yield stereo_as_motion(name, left, read_image(example.right), read_disparity(example.disparity), seen)
    if DATA.is_dir():
        for pair in true_pairs():
            yield stereo_as_motion(pair.name, pair.left, pair.right, pair.truth, None)


def stereo_as_motion(
    name: str, left: Picture, right: Picture, disparity: npt.NDArray[np.float32], seen: npt.NDArray[np.bool_] | None
) -> Case:
    """Return a stereo pair as two frames in which everything moves left by its disparity."""
    return Case(name, "stereo pair", left, right, np.stack([disparity * 0, -disparity]), seen)


def affine(shape: tuple[int, ...], seed: int) -> Motion:
    """Return an affine motion with a shift, of about 30 px at most within the frame."""
    random = np.random.default_rng(seed)
    rows, cols = shape[:2]
    matrix = random.uniform(-1, 1, (2, 2)) * MAX_MOTION_PX / math.hypot(rows, cols)
    shift = random.uniform(-0.5, 0.5, 2) * MAX_MOTION_PX
    return lambda row, col: (
        matrix[0, 0] * (row - rows / 2) + matrix[0, 1] * (col - cols / 2) + shift[0],
        matrix[1, 0] * (row - rows / 2) + matrix[1, 1] * (col - cols / 2) + shift[1],
    )


def smooth(shape: tuple[int, ...], seed: int) -> Motion:
    """Return waves about as long as the picture with a shift, of about 24 px at most."""
    random = np.random.default_rng(seed)
    wave, phase = 2 * np.pi * 1.3 / math.hypot(*shape[:2]), random.uniform(0, 2 * np.pi, 4)
    shift = random.uniform(-0.3, 0.3, 2) * MAX_MOTION_PX
    return lambda row, col: (
        0.5 * MAX_MOTION_PX * np.sin(wave * col + phase[0]) * np.cos(wave * row + phase[1]) + shift[0],
        0.5 * MAX_MOTION_PX * np.cos(wave * col + phase[2]) * np.sin(wave * row + phase[3]) + shift[1],
    )


def moved(name: str, picture: Picture, motion: Motion, seed: int) -> Case:
    """Return a picture and its moved version, with three rectangles moving independently in front, and noise."""
    random = np.random.default_rng(100 + seed)
    rows, cols = picture.shape[:2]
    row, col = np.mgrid[:rows, :cols].astype(np.float64)
    dy, dx = motion(row, col)
    source = (col - dx).astype(np.float32), (row - dy).astype(np.float32)
    first = picture.copy()
    second = np.asarray(cv2.remap(picture, *source, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101), np.uint8)
    truth = np.zeros((2, rows, cols))
    for _ in range(60):
        # The motion is a function of its end point, so the flow at the start point is found by iteration.
        truth = np.stack(motion(row + truth[0], col + truth[1]))
    other = picture[::-1, ::-1]
    for _ in range(3):
        height, width = int(random.integers(rows // 8, rows // 4)), int(random.integers(cols // 8, cols // 4))
        y, x = int(random.integers(20, rows - height - 20)), int(random.integers(20, cols - width - 20))
        to_y, to_x = y + int(random.integers(-15, 16)), x + int(random.integers(-15, 16))
        patch = other[y : y + height, x : x + width]
        first[y : y + height, x : x + width] = patch
        second[to_y : to_y + height, to_x : to_x + width] = patch
        truth[:, y : y + height, x : x + width] = np.array([to_y - y, to_x - x])[:, None, None]
    frames = [
        np.clip(np.rint(one + random.normal(0, NOISE_LEVELS, one.shape)), 0, 255).astype(np.uint8)
        for one in (first, second)
    ]
    return Case(name, "moved picture", frames[0], frames[1], truth.astype(np.float32))


def errors_of(flow: Flow, case: Case) -> FlowErrors:
    """Return the errors of a flow over all pixels with ground truth, and over those visible in both frames."""
    error = np.hypot(*(flow - case.truth))
    known = np.isfinite(case.truth[1])
    seen = None if case.seen is None else float(error[known & case.seen].mean())
    return FlowErrors(float(error[known].mean()), 100 * float((error[known] > WRONG_PX).mean()), seen)


def flow_table() -> tuple[str, dict[str, object]]:
    """Return the table as Markdown, and its figures."""
    found: dict[str, tuple[Case, dict[str, FlowErrors], dict[str, float]]] = {}
    for case in cases():
        jobs: Mapping[str, Callable[[], Flow]] = {
            title: lambda method=method, case=case: method(case.first, case.second)  # type: ignore[misc]
            for title, method in METHODS.items()
        }
        judgements = {title: errors_of(job(), case) for title, job in jobs.items()}
        found[f"{case.name} ({case.kind})"] = case, judgements, interleaved(jobs, runs=5)
    lines = [f"| frames | {' | '.join(METHODS)} |", "|---" * (1 + len(METHODS)) + "|"]
    for name, (_, judgements, seconds) in found.items():
        cells = [
            f"{one.epe:.2f}, {one.wrong:.1f} %, {1e3 * seconds[title]:.0f} ms" for title, one in judgements.items()
        ]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    merits = {f"EPE, {OURS} / {peer}": merit(found.values(), peer) for peer in list(METHODS)[1:]}
    times = {
        f"time, {OURS} / {peer}": statistics.median(seconds[OURS] / seconds[peer] for _, _, seconds in found.values())
        for peer in list(METHODS)[1:]
    }
    seen = {
        name: {title: one.epe_seen for title, one in judgements.items()}
        for name, (case, judgements, _) in found.items()
        if case.seen is not None
    }
    lines += ["", "EPE where both cameras see the pixel:", "", *lines[:2]]
    lines += [f"| {name} | {' | '.join(f'{value:.2f}' for value in row.values())} |" for name, row in seen.items()]
    summary = ["| figure of merit | measured |", "|---|---|"]
    summary += [f"| {name} | {value:.3f} |" for name, value in (merits | times).items()]
    heading = "Each cell: mean end-point error in px over all pixels with truth, % off by more than 3 px, time."
    values: dict[str, object] = {
        "merit": merits | times,
        "frames": {
            name: {title: asdict(one) | {"seconds": seconds[title]} for title, one in judgements.items()}
            for name, (_, judgements, seconds) in found.items()
        },
    }
    for name, drive in _drives().items():
        more, values[name] = drive_lines(drive, METHODS)
        lines += more
    more, values["kinds"] = kinds_lines()
    return "\n".join([*summary, "", heading, "", *lines, "", *more]), values


def _drives() -> dict[str, DriveExample]:
    try:
        return drives()
    except FileNotFoundError:
        return {}


def merit(found: Any, peer: str) -> float:
    """Return the geometric mean of the ratio of our end-point error to a peer's."""
    ratios = [math.log(judgements[OURS].epe / judgements[peer].epe) for _, judgements, _ in found]
    return math.exp(math.fsum(ratios) / len(ratios))
