"""Rocketman resized and rotated, and templates that are not there: how often the answer is right or wrong."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.pairs import DATA
from stereolag import TemplateSearch, match_template, read_image
from stereolag.samples import mazes, stereo_pairs

Array = npt.NDArray[Any]

SCALES, ROTATIONS = (0.7, 1.4), (-30.0, 30.0)
TRIALS = 20
FINER = 4

NEAR_PX, NEAR_SCALE, NEAR_DEGREES = 4.0, 0.03, 2.0
"""Tolerances of a right answer: centre, size and angle."""


@dataclass(frozen=True)
class Scene:
    """A picture, a template and its pose: centre (row, col), scale and rotation; None if it is not in the picture."""

    name: str
    picture: Array
    template: Array
    truth: tuple[float, float, float, float] | None
    poses: bool
    mask: Array | None = None

    def search(self) -> TemplateSearch:
        """Search, with sizes and angles if the scene has them."""
        ranges: dict[str, Any] = {"scales": SCALES, "rotations": ROTATIONS} if self.poses else {}
        return match_template(self.picture, self.template, mask=self.mask, **ranges)

    def right(self, result: TemplateSearch) -> bool:
        """Return whether the answer is right: found at the true pose, or not found if it is not there."""
        if self.truth is None or not result.found:
            return (self.truth is None) is not result.found
        row, col, scale, rotation = self.truth
        best = result.matches[0]
        away = np.hypot(best.row + best.height / 2 - row, best.col + best.width / 2 - col)
        return bool(
            away <= NEAR_PX
            and abs(best.scale / scale - 1) <= NEAR_SCALE
            and abs(best.rotation - rotation) <= NEAR_DEGREES
        )


def maze() -> tuple[Array, Array, int, int]:
    """Return the picture, Rocketman, and his row and column."""
    example = mazes()["maze"]
    return read_image(example.picture), read_image(example.template), example.row, example.col


def painted_over(picture: Array, template: Array, row: int, col: int) -> Array:
    """Return the picture with Rocketman replaced by another part of it, of his size."""
    height, width = template.shape[:2]
    painted = picture.copy()
    painted[row : row + height, col : col + width] = picture[row : row + height, col + 300 : col + 300 + width]
    return painted


def drawn(picture: Array, template: Array, row: float, col: float, scale: float, rotation: float) -> Array:
    """Return the picture with the template drawn into it, centred at (row, col) and supersampled `FINER` times."""
    reach = int(np.hypot(*template.shape[:2]) * scale / 2) + 3
    top, left, side = round(row) - reach, round(col) - reach, 2 * reach
    matrix = cv2.getRotationMatrix2D(
        (template.shape[1] / 2 - 0.5, template.shape[0] / 2 - 0.5), rotation, scale * FINER
    )
    centre = np.array([(col - left) * FINER, (row - top) * FINER]) - 0.5
    matrix[:, 2] += centre - np.array([template.shape[1] / 2 - 0.5, template.shape[0] / 2 - 0.5])
    layers = template.astype(np.float32)
    layers[:, :, :3] *= layers[:, :, 3:] / 255
    fine = cv2.warpAffine(layers, matrix, (side * FINER, side * FINER), flags=cv2.INTER_CUBIC)
    little = cv2.resize(fine, (side, side), interpolation=cv2.INTER_AREA)
    cover = np.clip(little[:, :, 3:] / 255, 0, 1)
    shown = picture.copy()
    part = shown[top : top + side, left : left + side]
    part[:] = np.clip(np.rint(part * (1 - cover) + little[:, :, :3]), 0, 255)
    return shown


def posed_scenes(count: int = TRIALS) -> Iterator[Scene]:
    """Yield scenes with Rocketman at random places, sizes and angles in the maze."""
    picture, template, row, col = maze()
    empty = painted_over(picture, template, row, col)
    random = np.random.default_rng(0)
    for _ in range(count):
        scale, rotation = float(np.exp(random.uniform(*np.log(SCALES)))), float(random.uniform(*ROTATIONS))
        at = float(random.uniform(130, picture.shape[0] - 130)), float(random.uniform(130, picture.shape[1] - 130))
        name = f"Rocketman × {scale:.2f}, {rotation:+.0f}°"
        yield Scene(name, drawn(empty, template, *at, scale, rotation), template, (*at, scale, rotation), poses=True)


def absent_scenes() -> Iterator[Scene]:
    """Yield 20 searches for templates that are not there."""
    picture, template, row, col = maze()
    empty = painted_over(picture, template, row, col)
    mirrored = np.ascontiguousarray(template[:, ::-1])
    smaller = np.asarray(cv2.resize(template, None, fx=0.9, fy=0.9, interpolation=cv2.INTER_AREA))
    for poses in (False, True):
        also = ", all sizes and angles" if poses else ""
        yield Scene(f"painted over{also}", empty, template, None, poses)
        yield Scene(f"mirrored{also}", picture, mirrored, None, poses)
        yield Scene(f"mirrored, painted over{also}", empty, mirrored, None, poses)
        for order in ((1, 2, 0), (2, 1, 0), (0, 2, 1)):
            recoloured = template[:, :, (*order, 3)]
            yield Scene(f"colours {order}{also}", picture, recoloured, None, poses)
        for pair in list(stereo_pairs().values())[:3]:
            other = read_image(pair.left)
            top, left = other.shape[0] // 3, other.shape[1] // 3
            yield Scene(f"part of {pair.name}{also}", picture, other[top : top + 90, left : left + 90], None, poses)
    yield Scene("0.9 of his size", picture, smaller, None, poses=False)
    yield Scene("his negative, all sizes and angles", picture, _negative(template), None, poses=True)


def _negative(template: Array) -> Array:
    return np.dstack([255 - template[:, :, :3], template[:, :, 3:]])


def shared_scenes(folder: Path = DATA / "template") -> Iterator[Scene]:
    """Yield scenes from external pictures, with and without sizes and angles."""
    for scene, name, place, mask in (
        ("boofcv_desktop/scene.png", "template_paint.png", (222, 338), None),
        ("simplecv/scene.png", "template.png", (33, 363), None),
        ("opencv_messi/scene.jpg", "template.jpg", (85, 220), None),
        ("boofcv_desktop/scene.png", "template_cursor.png", (265, 210), None),
        ("boofcv_desktop/scene.png", "template_cursor.png", None, "mask.png"),
        ("boofcv_desktop/scene.png", "template_browser.png", None, None),
    ):
        path = folder / scene
        picture, template = read_image(path), read_image(path.parent / name)
        marks = None if mask is None else read_image(path.parent / mask)[:, :, :3].max(axis=2)
        height, width = template.shape[:2]
        truth = None if place is None else (place[0] + height / 2, place[1] + width / 2, 1.0, 0.0)
        called = f"{path.parent.name}, {name}{'' if mask is None else ' with its mask (three copies)'}"
        for poses in (False, True):
            also = ", all sizes and angles" if poses else ""
            yield Scene(called + also, picture, template, truth, poses, marks)


def rocketman_table() -> tuple[str, dict[str, Any]]:
    """Return the answers as Markdown, and as figures."""
    first = next(posed_scenes(1))
    first.search()  # compiles the loops
    figures: dict[str, Any] = {}
    lines = [
        "| search | answer | score | best rival | scale | angle | s | CPU s | right |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    groups = {"posed": posed_scenes(), "absent": absent_scenes(), "others": shared_scenes() if DATA.is_dir() else ()}
    summary = []
    for group, scenes in groups.items():
        told: list[dict[str, Any]] = []
        for scene in scenes:
            started, cpu = time.perf_counter(), time.process_time()
            result = scene.search()
            seconds, cpu = time.perf_counter() - started, time.process_time() - cpu
            best, rival = result.best, result.rivals[0] if result.rivals else None
            entry: dict[str, Any] = {
                "answer": result.reason,
                "score": None if best is None else round(best.score, 3),
                "rival": None if rival is None else round(rival.score, 3),
                "scale": None if best is None else round(best.scale, 3),
                "rotation": None if best is None else round(best.rotation, 1),
                "seconds": round(seconds, 2),
                "cpu_seconds": round(cpu, 2),
                "right": scene.right(result),
            }
            figures[scene.name] = entry
            told.append(entry)
            cells = [scene.name, *entry.values()]
            lines.append("| " + " | ".join("–" if cell is None else str(cell) for cell in cells) + " |")
        if told:
            right = sum(bool(entry["right"]) for entry in told)
            longest, busiest = (max(entry[name] for entry in told) for name in ("seconds", "cpu_seconds"))
            summary.append(
                f"{group}: {right} of {len(told)} right, at the most {longest:.2f} s, {busiest:.2f} s of CPU"
            )
    return "\n".join([*lines, "", "; ".join(summary) + "."]), figures
