"""The fields of settings classes in their reference: default, meaning and bounds, from the one declaration."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

from stereolag.core.settings import Settings, allowed_values, base_type, choices, nested

BEFORE_NUMPYDOC = 400
"""Priority of the hook: numpydoc lays out the section that is added here."""

LATER_SECTIONS = ("Raises", "See Also", "Notes", "Examples")


def _is_settings(thing: Any) -> bool:
    return inspect.isclass(thing) and issubclass(thing, Settings)


def _section(kind: type[Settings]) -> Iterator[str]:
    """Give the lines of a numpydoc section on the fields of a class."""
    yield from ("", "Parameters", "----------")
    for name, field in kind.model_fields.items():
        yield f"{name} : default {field.default!r}"
        yield f"    {field.description or field.title or ''}"
        within = [f":class:`~{one.__module__}.{one.__name__}`" for one in nested(field)]
        if within:
            yield f"    Its settings: {' or '.join(within)}."
        elif choices(field) or base_type(field) in (int, float):
            yield f"    Allowed {allowed_values(field)}."


def _add_fields(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    if _is_settings(thing) and thing.model_fields:
        place = next((place for place, line in enumerate(lines) if line in LATER_SECTIONS), len(lines))
        lines[place:] = [*_section(thing), "", *lines[place:]]


def _name_fields(
    app: Any, what: str, name: str, thing: Any, options: Any, signature: str | None, annotation: str | None
) -> tuple[str | None, str | None]:
    """Return for settings a signature of names alone: defaults and bounds stand below it.

    That of anything else stays; numpydoc, asked next, would fail on aliases of types.
    """
    if not _is_settings(thing):
        return signature, annotation
    names = ", ".join(f"{field}=…" for field in thing.model_fields)
    return f"(*, {names})" if names else "()", annotation


def setup(app: Any) -> dict[str, Any]:
    """Connect the hooks."""
    app.connect("autodoc-process-docstring", _add_fields, priority=BEFORE_NUMPYDOC)
    app.connect("autodoc-process-signature", _name_fields, priority=BEFORE_NUMPYDOC)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
