"""The places found by a template search, as files."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, fields, is_dataclass
from typing import Any

import numpy as np

from stereolag.core.searches import TemplateQuery
from stereolag.io.documents import figures_json
from stereolag.templates import TemplateMatch, TemplateSearch


def search_figures(result: TemplateSearch, query: TemplateQuery) -> dict[str, Any]:
    """Return the figures printed by ``stereolag find --json``: all results but the score map, and the settings."""
    found = {field.name: getattr(result, field.name) for field in fields(result)}
    figures = {name: _figures_of(value) for name, value in found.items() if not isinstance(value, np.ndarray)}
    figures.pop("score_map", None)
    return {"command": "find", "found": result.found} | figures | {"settings": query.model_dump()}


def matches_json(result: TemplateSearch, query: TemplateQuery) -> str:
    """Return :func:`search_figures` as an indented JSON document; a figure that is NaN or infinite is null."""
    return figures_json(search_figures(result, query), indent=2) + "\n"


def matches_csv(result: TemplateSearch) -> str:
    """Return the matches as CSV, best first: one line per match below a line with the names of its fields.

    The last field is ``clear``: 1 if a match fits clearly better than every other place and can be relied on, else 0.
    """
    text = io.StringIO()
    table = csv.DictWriter(text, [*(field.name for field in fields(TemplateMatch)), "clear"], lineterminator="\n")
    table.writeheader()
    for number, match in enumerate(result.matches):
        table.writerow(asdict(match) | {"clear": int(number < result.clear)})
    return text.getvalue()


def _figures_of(value: Any) -> Any:
    """Return a value with dictionaries in place of matches, also inside lists and tuples."""
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, list | tuple):
        return [_figures_of(one) for one in value]
    return value
