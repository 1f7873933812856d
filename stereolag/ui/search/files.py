"""Take it away: the matches of a template search as files."""

from __future__ import annotations

from functools import partial

import streamlit as st

from stereolag.core.inputs import Image
from stereolag.core.searches import TemplateQuery
from stereolag.figures.templates import framed
from stereolag.io.disparities import image_png, image_tiff
from stereolag.io.programs import find_command, find_script
from stereolag.io.results import matches_csv, matches_json
from stereolag.templates import TemplateSearch
from stereolag.ui.downloads import File, archive, show_reproduction, show_taken
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.search.answer import doubtful

KEY = "template.take"

BYTES_OF_A_PIXEL = 24
"""Memory while the ZIP is made: the image in colour, framed, and both as files."""


def show_match_files(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> None:
    """Offer the files of a template search."""
    opened = st.expander("Take it away", icon=":material/download:", key=f"{KEY}.opened", on_change="rerun")
    if opened.open:
        with opened:
            rows, cols = inputs.picture.shape[:2]
            command = find_command(query, *_names(inputs))
            offered = match_files(inputs, result, query)
            about = f"To search again, in the folder of these files: {command}"
            show_taken(offered, partial(archive, offered, about), BYTES_OF_A_PIXEL * rows * cols, key=KEY)
            show_reproduction(command, "search again", own=inputs.own, by_hand=inputs.by_hand)


def match_files(inputs: PictureAndTemplate, result: TemplateSearch, query: TemplateQuery) -> list[File]:
    """Return the files of a template search, in the order they are offered."""
    names = _names(inputs)
    rows, cols = inputs.picture.shape[:2]
    files = [
        File(
            "Matches CSV",
            "matches.csv",
            partial(matches_csv, result),
            "One line per match, best first; clear is 1 where it can be relied on.",
        ),
        File(
            "Matches JSON",
            "matches.json",
            partial(matches_json, result, query),
            "The matches, figures and settings, with the names of stereolag find --json.",
        ),
        File(
            "Framed PNG",
            "framed.png",
            partial(
                framed,
                inputs.picture,
                result.matches if result.found else [],
                doubtful(result),
                template=inputs.template.shape,
                width=cols,
            ),
            f"The image at full size, {cols} × {rows} pixels, with a frame around every match, dashed where it is "
            "doubtful.",
            "" if result.best else "Nothing was found to frame.",
        ),
        File("Python script", "reproduce.py", partial(find_script, query, *names), "Searches again."),
        _image_file(names[0], inputs.picture, "The image."),
        _image_file(names[1], inputs.template, "The template."),
    ]
    if names[2] is not None and inputs.mask is not None:
        files.append(_image_file(names[2], inputs.mask, "The mask: above 0 where the template counts."))
    return files


def _names(inputs: PictureAndTemplate) -> tuple[str, str, str | None]:
    """Return the file names of the image, the template and its mask, if any."""
    mask = None if inputs.mask is None else _name("mask", inputs.mask)
    return _name("image", inputs.picture), _name("template", inputs.template), mask


def _name(stem: str, image: Image) -> str:
    """Return a file name whose format stores the image without loss."""
    return f"{stem}.tif" if image.dtype.kind == "f" else f"{stem}.png"


def _image_file(name: str, image: Image, meaning: str) -> File:
    return File("", name, partial(image_tiff if image.dtype.kind == "f" else image_png, image), meaning)
