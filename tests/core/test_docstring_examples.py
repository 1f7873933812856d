"""Every public name has an example in its docstring, and all examples run."""

from __future__ import annotations

import doctest
import importlib
import io
import re
from pathlib import Path

import pytest

import stereolag

PACKAGE = Path(stereolag.__file__).resolve().parent
PUBLIC = [name for name in stereolag.__all__ if name != "__version__"]
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


WITH_EXAMPLES = sorted(module_of(path) for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_name_has_an_example(name: str) -> None:
    described, _, shown = (getattr(stereolag, name).__doc__ or "").partition("\n    Examples\n    --------\n")
    assert described.strip()
    assert doctest.DocTestParser().get_examples(shown)


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_the_examples_run(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runner, report = doctest.DocTestRunner(optionflags=OPTIONS), io.StringIO()
    for example in doctest.DocTestFinder().find(importlib.import_module(module)):
        runner.run(example, out=report.write)
    assert runner.tries > 0
    assert runner.failures == 0, report.getvalue()


def test_help_names_everything_that_is_public() -> None:
    tour = stereolag.__doc__ or ""
    assert not [name for name in PUBLIC if not re.search(rf"`{name}`|sl\.{name}\(", tour)]
