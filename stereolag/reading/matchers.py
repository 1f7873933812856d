"""The settings of stereo matchers, from untrusted bytes."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import ValidationError

from stereolag.reading.sources import Source, quoted, read_bytes
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS

WHAT = "settings file"
MAX_BYTES = 2**16

_ALLOWED = {
    "greater_than_equal": "a number from {ge}",
    "greater_than": "a number above {gt}",
    "less_than_equal": "a number up to {le}",
    "less_than": "a number below {lt}",
    "multiple_of": "a multiple of {multiple_of}",
    "int": "a whole number",
    "float": "a number",
    "finite_number": "a finite number",
    "bool": "true or false",
    "string": "a word",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "union_tag_invalid": "{expected_tags}",
    "union_tag_not_found": "a group of settings with {discriminator}",
    "model": "a group of settings",
    "dict": "a group of settings",
    "list": "a list",
    "tuple": "a list",
}
"""What a setting may be, by how the kind of a refusal of pydantic begins."""


def read_matcher(source: Source) -> StereoMatcher:
    """Read a matcher from the JSON that :func:`stereolag.export.settings_json` writes.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object. Settings that the file leaves out keep their defaults.

    Returns
    -------
    matcher
        The method that the file names, with its settings.

    Raises
    ------
    ValueError
        An empty file or one that is not such JSON, an unknown method, or a setting that is unknown or out of bounds.
    """
    data = read_bytes(source, WHAT)
    if len(data) > MAX_BYTES:
        raise ValueError(f"The {WHAT} has {len(data):,} bytes; at most {MAX_BYTES:,} are accepted.")
    document = _parsed(data)
    method = document["method"]
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(f"The {WHAT} names the method {quoted(str(method))}; known are {', '.join(METHODS)}.")
    try:
        return METHODS[method].model_validate(document["settings"])
    except ValidationError as error:
        raise ValueError(f"The {WHAT} for {method} is refused. {_first_refusal(error)}") from error


def _parsed(data: bytes) -> dict[str, Any]:
    try:
        document = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"The {WHAT} is not JSON, or it is damaged or cut short.") from error
    if not isinstance(document, dict) or not {"method", "settings"} <= document.keys():
        raise ValueError(f'The {WHAT} must be a JSON object with "method" and "settings".')
    return document


def _first_refusal(error: ValidationError) -> str:
    """Return the first of the refusals as one sentence of ours, harmless where it is shown."""
    first = error.errors(include_url=False)[0]
    kind, context = first["type"], first.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    place = _harmless(".".join(str(part) for part in first["loc"])) or "settings"
    if kind == "missing":
        return f"{place} is missing."
    if kind == "extra_forbidden":
        return f"{place} is no setting of this method."
    allowed = next((words for words in _ALLOWED if kind.startswith(words)), None)
    sentence = "something else" if allowed is None else _ALLOWED[allowed].format(**context)
    given = context["tag"] if kind == "union_tag_invalid" else _shown(first["input"])
    return f"{place} is {quoted(given)}; allowed is {_harmless(sentence)}."


def _shown(value: object) -> str:
    """Return how JSON writes a value, cut short: Python refuses to write a number of thousands of digits."""
    if isinstance(value, str):
        return value[:100]
    if isinstance(value, int) and abs(value) > 10**99:
        return "a number of more than 99 digits"
    if isinstance(value, dict | list):
        return "a list" if isinstance(value, list) else "a group of settings"
    return json.dumps(value, default=str)[:100]


def _harmless(text: str) -> str:
    return re.sub(r"[^\w .,:;'+=()-]", "?", text[:120])
