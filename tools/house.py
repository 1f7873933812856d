"""``python -m tools.house [REVISION]``: the size of the code by package, compared with a revision if one is given.

It counts statements (nodes of the syntax tree, without docstrings) and modules of ``stereolag/``, lines of JavaScript
and of tests, functions with twelve parameters or more, and files that use internals of Streamlit or Numba.
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

INTERNALS = re.compile(
    r"\bstreamlit\.(?:runtime|proto|elements|web|delta_generator|testing|components\.v2\.)"
    r"|\bnumba\.(?:core|misc|np)\b|\bfrom streamlit import runtime\b"
    r"|data-testid|\.st[A-Z]\w+|\[data-test"
)
"""Imports of undocumented names of Streamlit and Numba, and selectors of Streamlit's own elements."""


@dataclass
class Counts:
    """The counts of one checkout."""

    statements: Counter[str] = field(default_factory=Counter)
    modules: Counter[str] = field(default_factory=Counter)
    script_lines: int = 0
    test_lines: int = 0
    many_parameters: list[str] = field(default_factory=list)
    internals: list[str] = field(default_factory=list)


def count(root: Path) -> Counts:
    """Return the counts of the code in a folder."""
    counts = Counts()
    for path in sorted((root / "stereolag").rglob("*.py")):
        within = path.relative_to(root / "stereolag")
        package = within.parts[0] if len(within.parts) > 1 else "(top level)"
        tree = ast.parse(path.read_text(encoding="utf-8"))
        counts.statements[package] += sum(_is_counted(node) for node in ast.walk(tree))
        counts.modules[package] += 1
        counts.many_parameters += [f"{within}: {name}" for name in _functions_of_many_parameters(tree)]
    scripts = [path for path in (root / "stereolag").rglob("*.js") if path.stem not in {"fflate", "lit_html"}]
    counts.script_lines = sum(map(_lines, scripts))
    counts.test_lines = sum(map(_lines, (root / "tests").rglob("*.py")))
    sources = [path for path in (root / "stereolag").rglob("*") if path.suffix in {".py", ".css", ".js"}]
    pages = [root / "app.py", *(root / "pages").glob("*.py")]
    counts.internals = [
        path.relative_to(root).as_posix()
        for path in sorted(sources + pages)
        if INTERNALS.search(path.read_text("utf-8"))
    ]
    return counts


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


def count_revision(revision: str) -> Counts:
    """Return the counts of a revision of the project's repository."""
    with tempfile.TemporaryDirectory() as folder:
        archive = Path(folder, "revision.tar")
        archive.write_bytes(
            subprocess.run(["git", "archive", revision], cwd=PROJECT, capture_output=True, check=True).stdout
        )
        with tarfile.open(archive) as whole:
            whole.extractall(folder, filter="data")
        return count(Path(folder))


def main() -> None:
    """Print the table."""
    after = count(PROJECT)
    before = count_revision(sys.argv[1]) if len(sys.argv) > 1 else None
    shown = [counts for counts in (before, after) if counts is not None]
    print("package, then its statements and modules" + (", before and now" if before else ""))
    for package in sorted({package for counts in shown for package in counts.statements}):
        numbers = [number for counts in shown for number in (counts.statements[package], counts.modules[package])]
        print(f"{package:14}" + "".join(f"{number:>9}" for number in numbers))
    for title, counts in (("before", before), ("now", after)):
        if counts is not None:
            print(
                f"{title}: {counts.statements.total():,} statements in {counts.modules.total()} modules, "
                f"{counts.script_lines:,} lines of JavaScript, {counts.test_lines:,} lines of tests, "
                f"{len(counts.many_parameters)} functions with {MANY_PARAMETERS} parameters or more, "
                f"{len(counts.internals)} files that use Streamlit's or Numba's internals"
            )
    print(*(f"many parameters: {one}" for one in after.many_parameters), sep="\n")
    print(*(f"uses internals: {one}" for one in after.internals), sep="\n")


if __name__ == "__main__":
    main()
