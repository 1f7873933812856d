"""Texts for readers, kept as plain files: a changed sentence shows in a diff, where a person can judge it.

A test that takes the fixture `snapshot` calls it once, with everything it holds. The text is in `snapshots/` beside the
test, in a file named after the test file and the test. ``REWRITE_SNAPSHOTS=1 python -m pytest tests/app/test_x.py``
writes the files of the tests that run; with `tests/core/test_snapshots.py` it also deletes those of no test.
"""

import ast
import os
from collections.abc import Callable, Mapping, Sequence
from difflib import unified_diff
from pathlib import Path

Texts = Mapping[str, str | Sequence[str]]
"""By name: one text, or several to stand on a line each."""

Snapshot = Callable[[Texts], None]

REWRITE = "REWRITE_SNAPSHOTS" in os.environ

NO_BREAK = "⍽"
"""Stands for a no-break space, which nobody could see in a diff."""


def as_written(texts: Texts) -> str:
    """Return the content of a snapshot: each name, and below it, indented, its text."""
    paragraphs = []
    for name, text in texts.items():
        lines = text.splitlines() if isinstance(text, str) else text
        paragraphs.append("\n".join([name, *(f"    {line}" for line in lines)]))
    return "\n\n".join(paragraphs).replace("\N{NO-BREAK SPACE}", NO_BREAK) + "\n"


def place_of(test_file: Path, test: str) -> Path:
    """Return the file with the snapshot of a test function."""
    return test_file.parent / "snapshots" / f"{test_file.stem.removeprefix('test_')}.{test.removeprefix('test_')}.txt"


def compare(place: Path, texts: Texts) -> None:
    """Compare texts with a snapshot, or write it if asked to."""
    written = as_written(texts)
    if REWRITE:
        place.parent.mkdir(exist_ok=True)
        place.write_text(written, encoding="utf-8")
    assert place.exists(), f"there is no {place}; REWRITE_SNAPSHOTS=1 writes it"
    before = place.read_text(encoding="utf-8").splitlines()
    change = "\n".join(unified_diff(before, written.splitlines(), "the snapshot", "the texts now", lineterm="", n=1))
    assert not change, f"{place} differs; if meant so, REWRITE_SNAPSHOTS=1 writes it\n{change}"


def expected_below(folder: Path) -> set[Path]:
    """Return the snapshot files that the tests below a folder use."""
    return {
        place_of(file, node.name)
        for file in folder.rglob("test_*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and "snapshot" in {one.arg for one in node.args.args}
        if node.name.startswith("test_")
    }
