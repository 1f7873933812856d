"""Figures as JSON that any program can read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def figures_json(figures: Mapping[str, Any], *, indent: int | None = None) -> str:
    """Return figures as JSON, on one line unless indented; NaN and infinity, which JSON lacks, become null."""
    return json.dumps(_plain(figures), allow_nan=False, indent=indent)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value
