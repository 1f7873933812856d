"""One decorator compiles every loop of the package."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from stereolag.loops.compilation import compiled

PACKAGE = Path(__file__).resolve().parents[2] / "stereolag"
HOME = PACKAGE / "loops" / "compilation.py"
COMPILERS = {"njit", "jit", "vectorize", "guvectorize", "generated_jit", "cfunc", "stencil"}


def compilers_of_numba(source: str) -> Iterator[int]:
    """Yield the lines that mention a compiler of Numba, under whatever name the module or the compiler is imported."""
    tree = ast.parse(source)
    modules = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules |= {name.asname or name.name for name in node.names if name.name == "numba"}
        elif isinstance(node, ast.ImportFrom) and node.module == "numba":
            yield from (node.lineno for name in node.names if name.name in COMPILERS)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in COMPILERS and isinstance(node.value, ast.Name):
            yield from [node.lineno] * (node.value.id in modules)


@pytest.mark.parametrize("source", ["from numba import njit as fast", "import numba as nb\n@nb.njit\ndef f(): ..."])
def test_another_compiler_is_seen(source: str) -> None:
    assert list(compilers_of_numba(source))


def test_nothing_else_compiles() -> None:
    found = {path for path in PACKAGE.rglob("*.py") if list(compilers_of_numba(path.read_text(encoding="utf-8")))}
    assert found == {HOME}


def test_nothing_is_divided_by_zero_with_an_error_and_nan_is_an_answer() -> None:
    @compiled
    def ratio(a: float, b: float) -> float:
        return a / b

    @compiled(fastmath={"reassoc", "contract"})
    def loose(a: float, b: float) -> float:
        return a / b

    for function in (ratio, loose):
        assert np.isnan(function(0.0, 0.0)) and function(1.0, 0.0) == np.inf
