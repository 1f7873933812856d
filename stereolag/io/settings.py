"""The settings of stereo matchers as files, for this library and for OpenCV."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import cv2

from stereolag.core.settings import SettingsError
from stereolag.io.sources import Source, escape, quote, read_bytes, write_file
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import BlockMatcher
from stereolag.version import VERSION

MAX_SETTINGS_BYTES = 2**16


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
    OSError
        A path that cannot be opened.

    Examples
    --------
    >>> import stereolag as sl
    >>> matcher = sl.read_matcher(b'{"method": "StereoBM", "settings": {"block_size": 15}}')
    >>> matcher.block_size, matcher.num_disparities  # px; the second is the default
    (15, 64)
    """
    what = "settings file"
    return matcher_of(parsed_json(read_bytes(source, what), what, MAX_SETTINGS_BYTES), what)


def matcher_of(document: Any, what: str) -> StereoMatcher:
    """Return the matcher described by a parsed, untrusted document; `what` is its name in errors."""
    if not (isinstance(document, dict) and "method" in document and isinstance(document.get("settings"), dict)):
        raise ValueError(f'The {what} must be a JSON object with "method", a name, and "settings", an object.')
    name = document["method"]
    method = next((method for method in METHODS if method.__name__ == name), None)
    if method is None:
        known = ", ".join(method.__name__ for method in METHODS)
        raise ValueError(f"The {what} names the method {quote(str(name))}; known are {known}.")
    try:
        return method.model_validate(document["settings"])
    except SettingsError as error:
        raise ValueError(f"The {what} for {name} is refused. {escape(str(error))}") from error


def parsed_json(data: bytes, what: str, max_bytes: int) -> Any:
    """Return the content of untrusted JSON of at most `max_bytes`; `what` is its name in errors."""
    if len(data) > max_bytes:
        raise ValueError(f"The {what} has {len(data):,} bytes; at most {max_bytes:,} are accepted.")
    try:
        return json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"The {what} is not JSON, or it is damaged or cut short.") from error


def write_matcher(path: str | os.PathLike[str], matcher: StereoMatcher) -> None:
    """Write the settings of a matcher as JSON, whatever the suffix; :func:`stereolag.read_matcher` reads them back.

    Raises
    ------
    OSError
        The folder does not exist, the disk is full, and so on; an existing file is left unchanged.

    Examples
    --------
    >>> import stereolag as sl
    >>> matcher = sl.StereoBM(num_disparities=96, block_size=15)  # px
    >>> sl.write_matcher("settings.json", matcher)
    >>> sl.read_matcher("settings.json") == matcher
    True
    """
    write_file(Path(path), settings_json(matcher).encode())


def settings_json(matcher: StereoMatcher) -> str:
    """Return a matcher as JSON: its method, all its settings, and the version of this library.

    :func:`stereolag.read_matcher` reads it back.
    """
    return json.dumps(settings_document(matcher) | {"stereolag": VERSION}, indent=2) + "\n"


def settings_document(matcher: StereoMatcher) -> dict[str, Any]:
    """Return the document that :func:`settings_json` writes for a matcher: its method and all its settings."""
    return {"method": type(matcher).__name__, "settings": matcher.model_dump(mode="json")}


def opencv_yaml(matcher: BlockMatcher) -> str:
    """Return the settings of StereoBM or StereoSGBM in the layout of OpenCV's own ``Algorithm::save``.

    With these settings OpenCV matches 8-bit grey images as this library does, and returns disparity × 16 as int16.

    In C++ ``Algorithm::load<cv::StereoBM>(path)`` reads the file. In Python, which has no ``load``::

        storage = cv2.FileStorage(path, cv2.FILE_STORAGE_READ)  # keep it: it owns its nodes
        matcher = cv2.StereoBM.create()
        matcher.read(storage.getFirstTopLevelNode())
    """
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    matcher.opencv_matcher().write(storage, type(matcher).__name__)
    return str(storage.releaseAndGetString())
