"""What a page was set to, as JSON beside the files of its pair: :mod:`stereolag.reading.sessions` reads it back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from stereolag.export.settings import settings_document
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
        The names of the pair's files beside it, by what they are: "left", "right", and where they are known "truth",
        "visible" and "calibration".
    matchers
        The settings of all methods, for the images as they are in these files.
    shown
        The short names of the methods that are shown.
    size
        In which the pair is shown: a name of :data:`stereolag.ui.pairs.SIZES`.
    colours
        "low" and "high", px of disparity in these images, or neither where the page chooses them; "palette", its name;
        "inverted"; "outlined".
    description, history
        What is said of the pair, and what was done to it.
    num_disparities, min_disparity
        The range that the pair needs, px, where known.
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
