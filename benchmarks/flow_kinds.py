"""Frames with nothing or everything in common: the flow that we, OpenPIV and DIS find between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from openpiv import pyprocess

from stereolag import optical_flow, read_image
from stereolag.core.inputs import as_grey
from stereolag.samples import stereo_pairs

Picture: TypeAlias = npt.NDArray[np.uint8]
Frames: TypeAlias = tuple[Picture, Picture, npt.NDArray[Any] | None]
"""Both frames and the true flow (2, H, W), px; None: they have nothing in common."""

ROWS, COLS = 220, 280
"""Size of the frames, px."""

REACH = 48
"""Reach of the search, px."""

WRONG_PX = 1.5
"""Error above which a measured pixel counts as wrong, px."""

PIV_WINDOW_PX = 32
"""Side of OpenPIV's window, px."""

PIV_AREA_PX = 64
"""Side of OpenPIV's search area, px."""

MIN_PEAK_RATIO = 1.3
"""Least ratio of the two highest peaks at which a vector of OpenPIV is kept."""


def photograph(random: np.random.Generator, which: int | None = None) -> Picture:
    """Return a part of one of our pictures."""
    pictures = [*stereo_pairs().values()]
    whole = as_grey(read_image(pictures[random.integers(len(pictures)) if which is None else which].left))
    row, col = random.integers(0, whole.shape[0] - ROWS + 1), random.integers(0, whole.shape[1] - COLS + 1)
    return np.ascontiguousarray(whole[row : row + ROWS, col : col + COLS])


def noisy(random: np.random.Generator, image: npt.ArrayLike, noise: float) -> Picture:
    return np.clip(np.rint(image + random.normal(0, noise, np.shape(image))), 0, 255).astype(np.uint8)


def particles(random: np.random.Generator, background: npt.ArrayLike = 8.0, brightness: float = 140.0) -> Frames:
    """Return particles in a vortex in front of a static background."""
    places = random.uniform((-20, -20), (ROWS + 20, COLS + 20), (int(random.uniform(600, 2500)), 2))
    shift, spin = random.uniform(-6, 6, 2), random.uniform(-0.04, 0.04)
    row, col = np.mgrid[:ROWS, :COLS].astype(np.float64)
    truth = np.stack([shift[0] + spin * (col - COLS / 2), shift[1] - spin * (row - ROWS / 2)])
    moved = places + shift + spin * (places - (ROWS / 2, COLS / 2))[:, ::-1] * (1, -1)
    frames = []
    for at in (places, moved):
        image = np.zeros((ROWS, COLS))
        for y, x in at:
            near = np.s_[max(0, int(y) - 5) : max(0, int(y) + 6), max(0, int(x) - 5) : max(0, int(x) + 6)]
            image[near] += brightness * np.exp(-((row[near] - y) ** 2 + (col[near] - x) ** 2) / 2)
        frames.append(noisy(random, background + image, 3))
    return frames[0], frames[1], truth


def screen(random: np.random.Generator) -> Picture:
    """Return boxes with text."""
    image = np.full((ROWS, COLS), random.integers(200, 255), np.uint8)
    for _ in range(5):
        y, x = int(random.integers(0, ROWS - 60)), int(random.integers(0, COLS - 100))
        height, width = int(random.integers(40, 120)), int(random.integers(80, 180))
        cv2.rectangle(image, (x, y), (x + width, y + height), int(random.integers(120, 255)), -1)
        cv2.rectangle(image, (x, y), (x + width, y + height), 40, 1)
        for top in range(y + 12, y + height, 13):
            letters = "".join(
                chr(random.integers(97, 122)) if random.random() > 0.2 else " " for _ in range(width // 8)
            )
            cv2.putText(image, letters, (x + 4, top), cv2.FONT_HERSHEY_SIMPLEX, 0.36, 20, 1, cv2.LINE_AA)
    return image


def other_photographs(random: np.random.Generator) -> Frames:
    one, other = random.choice(len(stereo_pairs()), 2, replace=False)
    return photograph(random, one), photograph(random, other), None


def other_particles(random: np.random.Generator) -> Frames:
    return particles(random)[0], particles(random)[1], None


def other_screens(random: np.random.Generator) -> Frames:
    return screen(random), screen(random), None


def blank_second(random: np.random.Generator) -> Frames:
    level, noise = random.uniform(0, 255), random.choice([0.0, 3.0])
    return photograph(random), noisy(random, np.full((ROWS, COLS), level), noise), None


def identical(random: np.random.Generator) -> Frames:
    frame = screen(random) if random.random() < 0.5 else photograph(random)
    return frame, frame.copy(), np.zeros((2, ROWS, COLS))


def before_a_background(random: np.random.Generator) -> Frames:
    return particles(random, photograph(random) * random.uniform(0.3, 0.8), random.uniform(50, 120))


def noisy_and_still(random: np.random.Generator) -> Frames:
    frame, noise = photograph(random), random.uniform(1, 8)
    return noisy(random, frame, noise), noisy(random, frame, noise), np.zeros((2, ROWS, COLS))


def smooth_and_still(random: np.random.Generator) -> Frames:
    """Return a slope of the grey levels, darker towards the corners, and noise."""
    row, col = np.mgrid[:ROWS, :COLS] / ROWS - 0.5
    angle, noise = random.uniform(0, 2 * np.pi), random.uniform(1, 4)
    scene = 150 + 60 * (row * np.sin(angle) + col * np.cos(angle)) - random.uniform(0, 60) * (row**2 + col**2)
    return noisy(random, scene, noise), noisy(random, scene, noise), np.zeros((2, ROWS, COLS))


def bricks(random: np.random.Generator) -> Frames:
    """Return a wall of bricks, of which every other row is set off by half a brick."""
    height, width = random.integers(14, 30), 2 * random.integers(10, 20)
    row, col = np.mgrid[: 2 * ROWS, : 2 * COLS]
    joints = (row % height < 2) | ((col + row // height % 2 * width // 2) % width < 2)
    wall, (dy, dx) = np.where(joints, 60, 170), random.integers(-12, 13, 2)
    frames = [noisy(random, wall[30 + y : 30 + y + ROWS, 30 + x : 30 + x + COLS], 2) for y, x in ((0, 0), (-dy, -dx))]
    return frames[0], frames[1], np.stack([np.full((ROWS, COLS), float(part)) for part in (dy, dx)])


KINDS: dict[str, Callable[[np.random.Generator], Frames]] = {
    "other photographs": other_photographs,
    "other particles": other_particles,
    "other screens": other_screens,
    "second frame blank, half of them with noise": blank_second,
    "identical": identical,
    "particles before a static background": before_a_background,
    "the same scene, noise": noisy_and_still,
    "the same particles": particles,
    "a smooth scene that stands still, noise": smooth_and_still,
    "a wall of bricks": bricks,
}


def openpiv(first: Picture, second: Picture) -> tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]:
    """Return the kept vectors (2, N), px, their places (2, N), and whether each vector is kept."""
    u, v, ratio = pyprocess.extended_search_area_piv(
        first.astype(np.int32),
        second.astype(np.int32),
        window_size=PIV_WINDOW_PX,
        overlap=PIV_WINDOW_PX // 2,
        search_area_size=PIV_AREA_PX,
        sig2noise_method="peak2peak",
    )
    x, y = pyprocess.get_coordinates(first.shape, PIV_AREA_PX, PIV_WINDOW_PX // 2)
    kept = np.isfinite(u) & np.isfinite(v) & (ratio > MIN_PEAK_RATIO)
    return np.stack([v[kept], u[kept]]), np.stack([y[kept], x[kept]]).astype(np.intp), kept


def kinds_lines(trials: int = 10, seed: int = 1000) -> tuple[list[str], dict[str, Any]]:
    """Return the lines of the table, and its figures: shares of the pixels, or of OpenPIV's vectors, in %."""
    lines = [
        f"Frames of {COLS} × {ROWS} px, {trials} pairs of each kind, seeds from {seed} on: % measured, and % of those "
        f"off by more than {WRONG_PX} px (all, where there is nothing to measure).",
        "",
        f"| frames | ours | OpenPIV, s2n > {MIN_PEAK_RATIO} | DIS medium | our verdicts |",
        "|---|---|---|---|---|",
    ]
    figures: dict[str, Any] = {}
    for name, kind in KINDS.items():
        shares: dict[str, list[tuple[float, float]]] = {"ours": [], "OpenPIV": [], "DIS": []}
        verdicts: Counter[str] = Counter()
        for number in range(trials):
            first, second, truth = kind(np.random.default_rng(seed + number))
            flow = optical_flow(first, second, search=REACH)
            verdicts[flow.verdict] += 1
            vectors, (row, col), kept = openpiv(first, second)
            dense = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(first, second, None)  # type: ignore[call-overload]
            for title, found, true, share in (
                (
                    "ours",
                    np.stack([flow.dy, flow.dx])[:, flow.valid],
                    truth if truth is None else truth[:, flow.valid],
                    flow.coverage,
                ),
                ("OpenPIV", vectors, truth if truth is None else truth[:, row, col], kept.mean()),
                ("DIS", np.moveaxis(dense, 2, 0)[::-1], truth, 1.0),
            ):
                wrong = (
                    1.0 if true is None else float((np.hypot(*(found - true)) > WRONG_PX).mean()) if found.size else 0.0
                )
                shares[title].append((100 * float(share), 100 * wrong))
        cells = []
        for title, rows in shares.items():
            measured, wrong = np.mean(rows, axis=0)
            figures[f"{name}, {title}"] = {"measured": measured, "wrong": wrong}
            cells.append(f"{measured:.1f}, {wrong:.1f}" if measured else "0")
        said = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common())
        lines.append(f"| {name} | {' | '.join(cells)} | {said} |")
    return lines, figures
