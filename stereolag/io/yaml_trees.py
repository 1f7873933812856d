"""YAML from untrusted bytes: only text, lists and dictionaries, of bounded size and depth.

Every scalar stays text and every tag is ignored: no tag makes an object, and no type of YAML 1.1 is resolved (its
base-60 numbers alone can take minutes).
"""

from __future__ import annotations

import re
from typing import Any

import yaml

MAX_DEPTH = 16
MAX_NODES = 50_000
"""Scalars, lists and dictionaries, each counted as often as an alias repeats it."""

# The loader in C is ten times as fast; every wheel of PyYAML has it.
_LOADER: Any = yaml.CBaseLoader if yaml.__with_libyaml__ else yaml.BaseLoader

_OPENCV_DIRECTIVE = re.compile(r"\A\s*%YAML:[^\n]*")
"""OpenCV writes ``%YAML:1.0``, which is not a YAML directive."""


def parse_yaml(text: str, what: str) -> Any:
    """Return the first document of a YAML text.

    Raises
    ------
    ValueError
        Not YAML, more than 16 levels or 50,000 nodes, or an alias of a node that is missing or incomplete.
    """
    text = _OPENCV_DIRECTIVE.sub("", text, count=1)
    try:
        _check(text, what)
        loader = _LOADER(text)
        try:
            return loader.get_data()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f" at line {error.problem_mark.line + 1}"
        raise ValueError(f"The {what} cannot be parsed as YAML: it is broken or cut short{line}.") from error
    except yaml.YAMLError as error:
        raise ValueError(f"The {what} cannot be parsed as YAML: it holds characters that are not allowed.") from error


def _check(text: str, what: str) -> None:
    """Refuse a text that is too large once its aliases are followed, before anything is built from it."""
    nodes = 0
    opened: list[tuple[str | None, int]] = []
    sizes: dict[str | None, int] = {}
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes:
                raise ValueError(f"The {what} (YAML) has an alias of something that does not exist or contains itself.")
            nodes += sizes[event.anchor]
        elif isinstance(event, yaml.ScalarEvent):
            nodes += 1
            sizes[event.anchor] = 1
        elif isinstance(event, yaml.CollectionStartEvent):
            opened.append((event.anchor, nodes))
            nodes += 1
            sizes.pop(event.anchor, None)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = opened.pop()
            sizes[anchor] = nodes - before
        elif isinstance(event, yaml.DocumentEndEvent):
            return
        if len(opened) > MAX_DEPTH:
            raise ValueError(f"The {what} (YAML) is nested more than {MAX_DEPTH} levels deep.")
        if nodes > MAX_NODES:
            raise ValueError(f"The {what} (YAML) holds more than {MAX_NODES:,} values, its aliases followed.")
