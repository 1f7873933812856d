"""The house: every room imports from the floors below, no module from itself in the end, and the library no screen."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "stereolag"

FLOORS = (
    {"arrays", "progress", "version", "samples", "typography"},
    {"settings", "inputs", "loops"},
    {"limits", "searches", "figures.pictures"},
    {"estimates", "figures.flow", "figures.outlines"},
    {"signals", "templates", "geometry", "stereo.estimates", "stereo.reasons"},
    {"stereo.matcher"},
    {"stereo.finishing"},
    {"stereo.windows", "stereo.semi_global", "stereo.opencv", "stereo.evaluation"},
    {"stereo.methods", "motion"},
    {"tuning", "doctor", "reading"},
    {"explaining", "export"},
    {"sequences"},
    {"stereolag"},
    {"figures", "warming"},
    {"ui", "commands"},
)
"""From the ground up: a room imports from the floors below, and within itself. Of the figures some modules stand lower:
arrays as coloured pictures, flows and outlines, which videos are made of too."""

ALLOWED_BESIDE = {("export", "stereolag")}
"""A program that was written out calls the public names: what writes it asks which these are."""

SCREENS = {"streamlit": ("ui", "commands"), "plotly": ("figures", "ui")}


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").removesuffix(".")


MODULES = {module_of(path): path for path in PACKAGE.rglob("*.py") if "app" not in path.relative_to(PACKAGE).parts[:1]}


def room_of(module: str) -> str:
    parts = module.split(".")
    names = (".".join(parts[:length]) for length in (2, 1))
    known = set().union(*FLOORS)
    return "stereolag" if not module else next(name for name in names if name in known)


@cache
def imports(module: str) -> frozenset[str]:
    """Return the modules of ours, and the packages of others, that a module imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(_ours(name) for name in found)


def _ours(name: str) -> str:
    """Return the module of ours that a name comes from; of another package, its name."""
    top, _, inner = name.partition(".")
    if top != "stereolag":
        return f"other {top}"
    while inner and inner not in MODULES:
        inner = inner.rpartition(".")[0]
    return inner


def of_ours(module: str) -> set[str]:
    return {name for name in imports(module) if not name.startswith("other ")}


@pytest.mark.parametrize("module", sorted(set(MODULES) - {"stereo"}))
def test_a_room_imports_from_the_floors_below(module: str) -> None:
    room = room_of(module)
    floor = next(number for number, rooms in enumerate(FLOORS) if room in rooms)
    below = set().union(*FLOORS[:floor], {room})
    for name in of_ours(module) - {"stereo"}:
        other = room_of(name)
        assert other in below or (room, other) in ALLOWED_BESIDE, f"{module} imports {name}"


def test_no_module_leads_back_to_itself() -> None:
    done: set[str] = set()

    def follow(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join((*path[path.index(module) :], module))
        if module not in done:
            for name in of_ours(module) - {""}:
                follow(name, (*path, module))
            done.add(module)

    for module in MODULES:
        follow(module, ())


@pytest.mark.parametrize("screen", SCREENS)
def test_only_the_upper_floors_know_the_screen(screen: str) -> None:
    knowing = {room_of(module) for module in MODULES if f"other {screen}" in imports(module)}
    assert knowing <= set(SCREENS[screen])


def test_no_module_is_longer_than_300_lines() -> None:
    lengths = {module: len(path.read_text(encoding="utf-8").splitlines()) for module, path in MODULES.items()}
    assert not {module: length for module, length in lengths.items() if length > 300}


def test_importing_the_library_brings_in_nothing_before_it_is_used() -> None:
    code = "import stereolag, sys; sys.exit(', '.join({'numpy', 'numba', 'cv2'} & set(sys.modules)) or 0)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=PACKAGE.parent)


def test_everything_that_is_public_brings_in_no_screen() -> None:
    code = "from stereolag import *; import sys; sys.exit(', '.join({'streamlit', 'plotly'} & set(sys.modules)) or 0)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=PACKAGE.parent)
