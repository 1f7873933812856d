"""Download buttons: one per file, whose bytes are made on demand, and one ZIP of all files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import streamlit as st

from stereolag.core.jobs import format_bytes, limits
from stereolag.io.archives import bundle
from stereolag.ui import prose
from stereolag.ui.jobs import HEAVY_MEMORY, Turn, limiter
from stereolag.ui.private_files import download_button

README = "README.txt"


class File(NamedTuple):
    """A downloadable file.

    Attributes
    ----------
    label
        Label of the button; "" for a file that is only in the ZIP.
    name
        File name.
    make
        Makes its bytes or text.
    meaning
        Help of the button, and description of the file in the ZIP.
    refusal
        Why the file is not available; "" if it is.
    """

    label: str
    name: str
    make: Callable[[], bytes | str]
    meaning: str
    refusal: str = ""


def show_file_buttons(files: Sequence[File], memory: int, *, key: str) -> None:
    """Draw a download button for each file.

    Parameters
    ----------
    files
        Files in button order.
    memory
        Memory needed to make one of them, bytes.
    key
        Prefix of the button keys.
    """
    for file in files:
        if file.label:
            download_button(
                file.label,
                partial(made_in_turn, file.make, memory),
                file.name,
                key=f"{key}.{file.name}",
                meaning=file.refusal or file.meaning,
                disabled=bool(file.refusal),
            )


def show_zip_button(make: Callable[[], bytes], memory: int, *, key: str, more: str = "", refusal: str = "") -> None:
    """Draw the button of the ZIP of all files; `more` extends its help, `refusal` says why it is not available."""
    download_button(
        "All in one ZIP",
        partial(made_in_turn, make, memory),
        "stereolag.zip",
        "application/zip",
        key=f"{key}.zip",
        meaning=refusal or " ".join(filter(None, ("All files on offer here.", more))),
        icon=":material/folder_zip:",
        primary=True,
        disabled=bool(refusal),
    )


def show_taken(files: Sequence[File], whole: Callable[[], bytes], memory: int, *, key: str) -> None:
    """Draw the button of the ZIP made by `whole`, then the file buttons as :func:`show_file_buttons` does."""
    with st.container(horizontal=True, gap="small"):
        show_zip_button(whole, memory, key=key, refusal=too_large(memory))
        show_file_buttons(files, memory, key=key)


def show_reproduction(command: str, does: str, *, own: bool, by_hand: Sequence[str] = ()) -> None:
    """Show the command that reproduces the result from the unpacked ZIP, and say what the page address includes.

    Parameters
    ----------
    command
        One line.
    does
        Its purpose: "measure this lag again".
    own
        Whether the files are the visitor's own.
    by_hand
        Parts of an example the visitor changed by hand, which the address cannot include: "mask you painted".
    """
    prose.caption(f"To {does}, in the folder of the unpacked ZIP:")
    st.code(command, language=None, wrap_lines=True)
    if own:
        prose.caption("The address of this page holds its settings, but not your own files.")
        return
    said = "The address of this page holds its settings and the example: send it, or keep it as a bookmark."
    if by_hand:
        lacking = f"The {' and the '.join(by_hand)} {'is' if len(by_hand) == 1 else 'are'}"
        said += f" {lacking} not in it: it opens the example’s template as it is."
    prose.caption(said)


def too_large(memory: int) -> str:
    """Return why a file that needs `memory` bytes cannot be made; "" if it can."""
    allowed = limits().job_memory
    if memory <= allowed:
        return ""
    return f"Making it would take about {format_bytes(memory)} of memory; one job may take {format_bytes(allowed)}."


def archive(files: Sequence[File], about: str) -> bytes:
    """Return a ZIP of the available files and a README: `about`, then a description of each file."""
    had = [file for file in files if not file.refusal]
    meanings = "".join(f"{file.name}: {file.meaning}\n" for file in had)
    return bundle({README: f"{about}\n\n{meanings}"} | {file.name: file.make() for file in had})


def made_in_turn(make: Callable[[], bytes | str], memory: int) -> bytes | str:
    """Return a requested file; one that needs much memory waits for its turn."""
    if memory < HEAVY_MEMORY:
        return make()
    with limiter().admitted(Turn(memory), lambda: False):
        return make()
