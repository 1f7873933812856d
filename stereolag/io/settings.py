"""The settings of a matcher, for this library and for OpenCV."""

from __future__ import annotations

import json
from typing import Any

import cv2

from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import BlockMatcher
from stereolag.version import VERSION


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

    With them, OpenCV matches 8-bit grey images as this library does, and returns the disparity × 16 as int16.

    In C++ ``Algorithm::load<cv::StereoBM>(path)`` reads the file. In Python, which has no ``load``::

        storage = cv2.FileStorage(path, cv2.FILE_STORAGE_READ)  # keep it: its nodes die with it
        matcher = cv2.StereoBM.create()
        matcher.read(storage.getFirstTopLevelNode())
    """
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    matcher.opencv_matcher().write(storage, type(matcher).__name__)
    return str(storage.releaseAndGetString())
