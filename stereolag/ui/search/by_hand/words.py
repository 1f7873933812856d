"""Texts of the panel for searching by hand."""

from __future__ import annotations

from typing import Any

from stereolag.figures.pictures import FRAME, VIRIDIS
from stereolag.templates.by_hand import ReducedSearch


def words_of(search: ReducedSearch) -> dict[str, Any]:
    """Return all texts and colours of the panel; `texts` maps CSS selectors to their text."""
    return {
        "frame": f"rgb{FRAME}",
        "palette": VIRIDIS[::3].tolist(),
        "stage": "The image with the template over it. Arrow keys move the template, with Shift by ten.",
        "texts": {
            ".try": "Drag the template over the image. Warm pixels agree with the window under it, cool ones "
            "disagree; the score is their mean. Where does it peak?",
            ".template figcaption": "Template",
            ".window figcaption": "Window",
            ".products figcaption": "Products",
            ".sum .label": "Score",
            ".map .empty": "The score map fills in as you drag.",
            ".reveal": "Reveal",
            ".clear": "Clear",
            ".hint": "Drag, use the arrow keys (with Shift by ten), or click on the score map. The mean of each colour "
            f"channel is subtracted before multiplying; transparent pixels do not count. {scale_of(search)}",
        },
        "where": "Row {row}, column {col}: {score}",
        "peak": "The peak is at row {row}, column {col}: {score}.",
        "lead": " The best rival reaches {rival}."
        if search.factor == 1
        else " At this scale the best rival reaches {rival}.",
        "nothing": "The image is flat: there is nothing to correlate.",
        "top": "Peak",
        "rival": "Rival",
        "go": "Compare this place",
    }


def scale_of(search: ReducedSearch) -> str:
    """Return how the picture was reduced, in a sentence."""
    part = "Only a part of the image. " if search.part else ""
    if search.factor == 1:
        return f"{part}Every pixel counts."
    return f"{part}Reduced for the browser: each pixel is the mean of {search.factor} × {search.factor}."
