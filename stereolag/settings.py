"""The one base of every settings object: immutable, validated, printable as JSON."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Settings(BaseModel):
    """Immutable, validated settings.

    Each field carries title, description, bounds and step, so that one declaration makes the validation,
    the control on a page, the flag of a command and the JSON. A bad value raises ``pydantic.ValidationError``,
    which is a ``ValueError``, and names the field, the value and what is allowed.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
