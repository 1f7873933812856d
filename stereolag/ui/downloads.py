"""Files on offer: a button for each, whose bytes are made when they are asked for, and one ZIP of all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import streamlit as st

from stereolag.estimates import spoken
from stereolag.export import bundle
from stereolag.limits import limits
from stereolag.ui import prose
from stereolag.ui.jobs import HEAVY_MEMORY, Turn, limiter
from stereolag.ui.private_files import download_button

README = "README.txt"


class File(NamedTuple):
    """A file on offer.

    Attributes
    ----------
    label
        The button; "" of a file that goes into the ZIP alone.
    name
        Of the file.
    make
        Makes its bytes, or its text.
    meaning
        The button's help, and what is said of it in the ZIP.
    refusal
        Why there is none, "" where it can be had.
    """

    label: str
    name: str
    make: Callable[[], bytes | str]
    meaning: str
    refusal: str = ""


def show_file_buttons(files: Sequence[File], memory: int, *, key: str) -> None:
    """Offer files.

    Parameters
    ----------
    files
        In the order of their buttons.
    memory
        Bytes that it takes to make one of them.
    key
        What the keys of the buttons begin with.
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
    """Offer one ZIP of all files; `more` is what else is to be said of it, `refusal` why it cannot be had."""
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
    """Offer files, and before them one ZIP of all, which `whole` makes; the others as :func:`show_file_buttons`."""
    with st.container(horizontal=True, gap="small"):
        show_zip_button(whole, memory, key=key, refusal=too_large(memory))
        show_file_buttons(files, memory, key=key)


def show_reproduction(command: str, does: str, *, own: bool, by_hand: Sequence[str] = ()) -> None:
    """Show the command that gives the same result beside the files of the ZIP, and say what the address holds.

    Parameters
    ----------
    command
        One line.
    does
        What it does: "measure this lag again".
    own
        Whether the files are the visitor's own.
    by_hand
        What the visitor made of an example by hand, and no address holds: "mask you painted".
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
    """Return why a file cannot be made that takes so many bytes of memory, "" where it can."""
    allowed = limits().job_memory
    if memory <= allowed:
        return ""
    return f"Making it would take about {spoken(memory)} of memory; one job may take {spoken(allowed)}."


def archive(files: Sequence[File], about: str) -> bytes:
    """Return one ZIP of the files that can be had, and of a text: `about`, and below it what each of them holds."""
    had = [file for file in files if not file.refusal]
    meanings = "".join(f"{file.name}: {file.meaning}\n" for file in had)
    return bundle({README: f"{about}\n\n{meanings}"} | {file.name: file.make() for file in had})


def made_in_turn(make: Callable[[], bytes | str], memory: int) -> bytes | str:
    """Return a file that is asked for; one that takes much memory is made when it is its turn."""
    if memory < HEAVY_MEMORY:
        return make()
    with limiter().admitted(Turn(memory), lambda: False):
        return make()
