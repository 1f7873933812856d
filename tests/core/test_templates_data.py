"""Template search in pictures made by others, and in the bundled mazes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stereolag.templates import TemplateMethod, TemplateSearch, match_template

MAZES = Path(__file__).resolve().parents[2] / "assets" / "maze"


def read(path: Path) -> npt.NDArray[Any]:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return np.asarray(image)


def places(search: TemplateSearch) -> list[tuple[int, int]]:
    return [(match.row, match.col) for match in search.matches]


@pytest.mark.parametrize(
    ("scene", "template", "method"),
    [
        ("boofcv_desktop/scene.png", "boofcv_desktop/template_paint.png", "fft"),
        ("boofcv_desktop/scene.png", "boofcv_desktop/template_paint.png", "direct"),
        ("boofcv_desktop/scene.png", "boofcv_desktop/template_paint.png", "sampled"),
        ("simplecv/scene.png", "simplecv/template.png", "fft"),
        ("simplecv/scene.png", "simplecv/template.png", "sampled"),
    ],
)
def test_exact_copies(data_dir: Path, method: TemplateMethod, scene: str, template: str) -> None:
    scene_path, template_path = data_dir / "template" / scene, data_dir / "template" / template
    notes = json.loads((scene_path.parent / "notes.json").read_text())["templates"][template_path.name]
    search = match_template(read(scene_path), read(template_path), method=method, seed=0)
    assert places(search) == [tuple(reversed(notes["best_xy"]))]
    assert search.matches[0].score == pytest.approx(1, abs=1e-6)


def test_a_recompressed_template(data_dir: Path) -> None:
    folder = data_dir / "template" / "opencv_messi"
    search = match_template(read(folder / "scene.jpg"), read(folder / "template.jpg"))
    assert places(search) == [(85, 220)]
    assert search.matches[0].score == pytest.approx(0.992, abs=5e-4)


def test_the_cursor_needs_its_mask(data_dir: Path) -> None:
    folder = data_dir / "template" / "boofcv_desktop"
    scene, cursor = read(folder / "scene.png"), read(folder / "template_cursor.png")
    assert places(match_template(scene, cursor)) == [(265, 210)]
    assert places(match_template(scene, cursor, mask=read(folder / "mask.png"))) == [(6, 271)]


def test_the_cursor_by_exact_pixels_under_its_mask(data_dir: Path) -> None:
    folder = data_dir / "template" / "boofcv_desktop"
    scene, cursor = read(folder / "scene.png"), read(folder / "template_cursor.png")
    search = match_template(scene, cursor, method="sampled", mask=read(folder / "mask.png"), seed=0)
    assert places(search) == [(6, 271)]


@pytest.mark.parametrize("method", ["fft", "direct", "sampled"])
def test_the_browser_icon_is_not_in_the_scene(data_dir: Path, method: TemplateMethod) -> None:
    folder = data_dir / "template" / "boofcv_desktop"
    search = match_template(read(folder / "scene.png"), read(folder / "template_browser.png"), method=method)
    assert not search.found
    assert search.matches == []


def test_rocketman_in_the_maze() -> None:
    maze, rocketman = read(MAZES / "maze.png"), read(MAZES / "rocketman.png")
    assert places(match_template(maze, rocketman)) == [(528, 982)]
    for seed in range(5):
        search = match_template(maze, rocketman, method="sampled", seed=seed)
        assert places(search) == [(528, 982)]
        assert search.candidates < 1000


def test_rocketman_dulled_and_partly_covered() -> None:
    dulled = next(maze for maze in json.loads((MAZES / "mazes.json").read_text()) if maze["name"] == "maze_dulled")
    maze, rocketman = read(MAZES / dulled["picture"]), read(MAZES / dulled["template"])
    search = match_template(maze, rocketman)
    assert (places(search), search.reason) == ([(dulled["row"], dulled["col"])], "clear")
    assert not match_template(maze, rocketman, method="sampled", seed=0).found
