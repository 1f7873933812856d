"""Texts for the steps of the "sampled" search."""

from __future__ import annotations

from typing import Any, Final

WORDS: Final[dict[str, Any]] = {
    "texts": {
        ".try": "“Sampled” does not score every place. It takes one pixel of the template, the anchor, and looks for "
        "its exact colour. Go through the steps, then pick another pixel: the rarer its colour, the fewer places are "
        "left.",
        ".anchor figcaption": "Anchor and the ends of its run",
        ".colours .name": "How often the image holds colours of the template (logarithmic)",
    },
    "steps": ["All pixels", "This colour", "Both ends agree", "Scored"],
    "steps_label": "Steps",
    "said": [
        "Every pixel of the image could be the anchor.",
        "Pixels of exactly this colour, where the template has room around them.",
        "There, both ends of the anchor’s opaque run have the right colours too.",
        "Every place within one pixel of these is scored.",
    ],
    "best": " Best: row {row}, column {col}, score {score}.",
    "none": " None is left: no place has exactly these colours.",
    "many": " Too many: only their count is shown; a rarer colour leaves fewer.",
    "some": " {shown} of them are drawn.",
    "picture": "The image with the pixels that are left at this step.",
    "colours": "Pixel of the template, the rarest colour first. Arrow keys pick another.",
    "colour": "Row {row}, column {col} of the template: {count} pixels of its colour",
    "hint": "Click on a bar or on the template to pick another pixel; arrow keys work too.",
    "nothing": "Every colour of this template is too common in the image.",
}
