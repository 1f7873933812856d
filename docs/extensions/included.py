"""Pages that are files of the project: their links, written for where they lie, lead on from the pages."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

INCLUDE = re.compile(r"^```\{include\} (\S+)", re.MULTILINE)
LINK = re.compile(r"\]\((?![a-z]+:|#)([^)#\s]+)")


def _pages(folder: Path) -> dict[Path, str]:
    """Return which page begins with which file of the project."""
    found = ((INCLUDE.match(page.read_text(encoding="utf-8")), page.name) for page in folder.glob("*.md"))
    return {(folder / include[1]).resolve(): name for include, name in found if include}


def _lead_on(app: Any, path: Path, parent: str, content: list[str]) -> None:
    folder = Path(app.srcdir)
    pages = _pages(folder)

    def target(link: re.Match[str]) -> str:
        file = (folder / path.parent / link[1]).resolve()
        return f"]({pages.get(file, os.path.relpath(file, folder.resolve()))}"

    content[0] = LINK.sub(target, content[0])


def setup(app: Any) -> dict[str, Any]:
    """Connect the hook."""
    app.connect("include-read", _lead_on)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
