"""The settings of a page as JSON, beside the files of its pair; :mod:`stereolag.io.sessions` reads it back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from stereolag.io.settings import settings_document
from stereolag.stereo.matcher import StereoMatcher
from stereolag.version import VERSION


def session_json(
    *,
    files: Mapping[str, str],
    matchers: Sequence[StereoMatcher],
    shown: Sequence[str],
    size: str,
    colours: Mapping[str, Any],
    description: str = "",
    history: Sequence[str] = (),
    num_disparities: int | None = None,
    min_disparity: int = 0,
) -> str:
    """Return a session as JSON.

    Parameters
    ----------
    files
        The names of the pair's files beside it, by role: "left", "right", and if known "truth", "visible" and
        "calibration".
    matchers
        The settings of all methods, for the images as they are in these files.
    shown
        The short names of the methods shown.
    size
        Size at which the pair is shown: a name in :data:`stereolag.ui.pairs.SIZES`.
    colours
        "low" and "high", px of disparity in these images, or neither if the page chooses them; "palette", its name;
        "inverted"; "outlined".
    description, history
        Description of the pair and of its processing.
    num_disparities, min_disparity
        The range that the pair needs, px, if known.
    """
    document = {
        "stereolag": VERSION,
        "pair": {
            "files": dict(files),
            "description": description,
            "history": list(history),
            "num_disparities": num_disparities,
            "min_disparity": min_disparity,
        },
        "methods": [settings_document(matcher) for matcher in matchers],
        "shown": list(shown),
        "size": size,
        "colours": dict(colours),
    }
    return json.dumps(document, indent=2) + "\n"
