"""The house: imports point down, and the core knows no screen."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "stereolag"
FORBIDDEN = {
    "core": ("streamlit", "plotly", "stereolag.figures", "stereolag.ui"),
    "figures": ("streamlit", "stereolag.ui"),
}


def imports(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def layer(path: Path) -> str:
    folder = path.relative_to(PACKAGE).parts[0]
    return folder if folder in ("figures", "ui") else "core"


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_down(path: Path) -> None:
    upward = FORBIDDEN.get(layer(path), ())
    broken = [name for name in imports(path) if name.startswith(upward)] if upward else []
    assert not broken


def test_importing_the_library_brings_in_no_screen() -> None:
    code = "import stereolag, sys; sys.exit(', '.join({'streamlit', 'plotly'} & set(sys.modules)) or 0)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=PACKAGE.parent)
