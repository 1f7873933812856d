"""``python -m tools.house [REVISION]``: the weight of the house by package, beside that of a revision if one is named.

Counted are statements (nodes of the syntax tree, but no docstrings) and modules of ``stereolag/``, lines of JavaScript
and of tests, functions with twelve parameters or more, and the files that touch the inside of Streamlit or Numba.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tarfile
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]

MANY_PARAMETERS = 12

INSIDE = re.compile(
    r"\bstreamlit\.(?:runtime|proto|elements|web|delta_generator|testing|components\.v2\.)"
    r"|\bnumba\.(?:core|misc|np)\b|\bfrom streamlit import runtime\b"
    r"|data-testid|\.st[A-Z]\w+|\[data-test"
)
"""Imports of names that Streamlit and Numba do not document, and the marks of Streamlit's own elements."""


@dataclass
class Weight:
    """The counts of one checkout."""

    statements: Counter[str] = field(default_factory=Counter)
    modules: Counter[str] = field(default_factory=Counter)
    script_lines: int = 0
    test_lines: int = 0
    many: list[str] = field(default_factory=list)
    inside: list[str] = field(default_factory=list)


def weigh(root: Path) -> Weight:
    """Count what stands below a folder."""
    weight = Weight()
    for path in sorted((root / "stereolag").rglob("*.py")):
        within = path.relative_to(root / "stereolag")
        package = within.parts[0] if len(within.parts) > 1 else "(top level)"
        tree = ast.parse(path.read_text(encoding="utf-8"))
        weight.statements[package] += sum(_is_counted(node) for node in ast.walk(tree))
        weight.modules[package] += 1
        weight.many += [f"{within}: {name}" for name in _functions_of_many_parameters(tree)]
    scripts = [path for path in (root / "stereolag").rglob("*.js") if path.stem not in {"fflate", "lit_html"}]
    weight.script_lines = sum(map(_lines, scripts))
    weight.test_lines = sum(map(_lines, (root / "tests").rglob("*.py")))
    sources = [path for path in (root / "stereolag").rglob("*") if path.suffix in {".py", ".css", ".js"}]
    pages = [root / "app.py", *(root / "pages").glob("*.py")]
    weight.inside = [
        path.relative_to(root).as_posix() for path in sorted(sources + pages) if INSIDE.search(path.read_text("utf-8"))
    ]
    return weight


def _is_counted(node: ast.AST) -> bool:
    is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    return isinstance(node, ast.stmt) and not is_text


def _functions_of_many_parameters(tree: ast.AST) -> list[str]:
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    return [one.name for one in functions if _parameters(one.args) >= MANY_PARAMETERS]


def _parameters(arguments: ast.arguments) -> int:
    return len(arguments.posonlyargs) + len(arguments.args) + len(arguments.kwonlyargs)


def _lines(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def weigh_revision(revision: str) -> Weight:
    """Count a revision of the project's repository."""
    with tempfile.TemporaryDirectory() as folder:
        archive = Path(folder, "revision.tar")
        archive.write_bytes(
            subprocess.run(["git", "archive", revision], cwd=PROJECT, capture_output=True, check=True).stdout
        )
        with tarfile.open(archive) as whole:
            whole.extractall(folder, filter="data")
        return weigh(Path(folder))


def main() -> None:
    """Print the table."""
    after = weigh(PROJECT)
    before = weigh_revision(sys.argv[1]) if len(sys.argv) > 1 else None
    shown = [weight for weight in (before, after) if weight is not None]
    print("package, then its statements and modules" + (", before and now" if before else ""))
    for package in sorted({package for weight in shown for package in weight.statements}):
        numbers = [number for weight in shown for number in (weight.statements[package], weight.modules[package])]
        print(f"{package:14}" + "".join(f"{number:>9}" for number in numbers))
    for title, weight in (("before", before), ("now", after)):
        if weight is not None:
            print(
                f"{title}: {weight.statements.total():,} statements in {weight.modules.total()} modules, "
                f"{weight.script_lines:,} lines of JavaScript, {weight.test_lines:,} lines of tests, "
                f"{len(weight.many)} functions with {MANY_PARAMETERS} parameters or more, "
                f"{len(weight.inside)} files that touch Streamlit's or Numba's inside"
            )
    print(*(f"many parameters: {one}" for one in after.many), sep="\n")
    print(*(f"inside: {one}" for one in after.inside), sep="\n")


if __name__ == "__main__":
    main()
