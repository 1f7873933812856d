"""The settings of stereo matchers, from untrusted bytes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from stereolag.core.settings import SettingsError
from stereolag.io.sources import Source, harmless, quoted, read_bytes

if TYPE_CHECKING:
    from stereolag.stereo.matcher import StereoMatcher

WHAT = "settings file"
MAX_BYTES = 2**16


def read_matcher(source: Source) -> StereoMatcher:
    """Read a matcher from the JSON that :func:`stereolag.io.settings_json` writes.

    Parameters
    ----------
    source
        A path, the bytes of the file, or a binary file object. Settings that the file leaves out keep their defaults.

    Returns
    -------
    matcher
        A matcher of the method named in the file, with the settings given there.

    Raises
    ------
    ValueError
        An empty file, one that is not such JSON, an unknown method, or a setting that is unknown or out of bounds.

    Examples
    --------
    >>> import stereolag as sl
    >>> matcher = sl.read_matcher(b'{"method": "StereoBM", "settings": {"block_size": 15}}')
    >>> matcher.block_size, matcher.num_disparities  # px; the second is the default
    (15, 64)
    """
    data = read_bytes(source, WHAT)
    if len(data) > MAX_BYTES:
        raise ValueError(f"The {WHAT} has {len(data):,} bytes; at most {MAX_BYTES:,} are accepted.")
    return matcher_from(parsed_json(data, WHAT), WHAT)


def matcher_from(document: Any, what: str) -> StereoMatcher:
    """Return the matcher described by a parsed, untrusted document; ValueError as in :func:`read_matcher`.

    Parameters
    ----------
    document
        In the form made by :func:`stereolag.io.settings.settings_document`.
    what
        Name of its source in errors.
    """
    from stereolag.stereo.methods import METHODS  # reading an image or a recording must not wait for this import

    if not (isinstance(document, dict) and "method" in document and isinstance(document.get("settings"), dict)):
        raise ValueError(f'The {what} must be a JSON object with "method", a name, and "settings", an object.')
    name = document["method"]
    method = next((one for one in METHODS if one.__name__ == name), None)
    if method is None:
        known = ", ".join(one.__name__ for one in METHODS)
        raise ValueError(f"The {what} names the method {quoted(str(name))}; known are {known}.")
    try:
        return method.model_validate(document["settings"])
    except SettingsError as error:
        raise ValueError(f"The {what} for {name} is refused. {harmless(str(error))}") from error


def parsed_json(data: bytes, what: str) -> Any:
    """Return the content of untrusted JSON; ValueError if it is not JSON."""
    try:
        return json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"The {what} is not JSON, or it is damaged or cut short.") from error
