"""Files to download or to play: one button per file, made on demand, and one ZIP of all files.

Streamlit keeps files in one store for all sessions. It derives their address from type, name and content, but above
1 MiB only from the length and three samples of the content, so files of two visitors could share an address. The type
passed here therefore includes a secret, so that no other file can get the same address.
"""

from __future__ import annotations

import hashlib
import itertools
import secrets
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import streamlit as st

from stereolag.core.arrays import Vector
from stereolag.core.inputs import Image
from stereolag.core.jobs import format_bytes, limits
from stereolag.io.images import image_file
from stereolag.io.recordings import wav
from stereolag.io.sources import bundle
from stereolag.ui import prose
from stereolag.ui import streamlit_inside as inside
from stereolag.ui.background_jobs import HEAVY_BYTES, limiter

KEPT_S = 60
"""Time for which a file made on demand can be fetched, s."""

MAX_KEPT_BYTES = 256 * 2**20
"""Limit for all such files together, bytes; the newest is kept whatever its size."""


def show_player(signal: Vector, sampling_rate: float, name: str) -> None:
    """Show a player for a recording, (samples,), at the highest volume that does not clip."""
    sound = wav(signal, sampling_rate)
    st.audio(sound, format=_private_type("audio/wav", sound), alt=f"Recording of {name}")


def download_button(
    label: str,
    content: bytes | str | Callable[[], bytes | str],
    file_name: str,
    media_type: str = "application/octet-stream",
    *,
    key: str,
    meaning: str | None = None,
    icon: str | None = None,
    primary: bool = False,
    disabled: bool = False,
) -> None:
    """Draw a download button; if `content` is a function, it is called when the visitor requests the file."""
    private_type = _private_type(media_type, content)
    st.download_button(
        label,
        partial(_made, content, file_name, private_type) if callable(content) else content,
        file_name,
        private_type,
        key=key,
        help=meaning,
        icon=icon,
        type="primary" if primary else "secondary",
        on_click="ignore",
        disabled=disabled,
    )


class _RecentFiles:
    """Files made on demand, each at its own coordinates, since Streamlit's store keeps files with coordinates."""

    def __init__(self) -> None:
        self._kept: dict[str, tuple[int, threading.Timer]] = {}
        """Size and timer of each file by its coordinates, oldest first."""
        self._lock = threading.Lock()

    def keep(self, content: bytes, file_name: str, media_type: str) -> None:
        """Keep a file for `KEPT_S` seconds; drop older ones sooner if together they exceed `MAX_KEPT_BYTES`."""
        with self._lock:
            while self._kept and sum(size for size, _ in self._kept.values()) + len(content) > MAX_KEPT_BYTES:
                self._forget(next(iter(self._kept)))
            candidates = (f"private_files.{number}" for number in itertools.count())
            coordinates = next(name for name in candidates if name not in self._kept)
            inside.keep_file(content, file_name, media_type, coordinates)
            timer = threading.Timer(KEPT_S, lambda: self._expire(coordinates, timer))
            timer.daemon = True
            self._kept[coordinates] = len(content), timer
            timer.start()

    def _expire(self, coordinates: str, timer: threading.Timer) -> None:
        with self._lock:
            _, current = self._kept.get(coordinates, (0, None))
            if current is timer:
                self._forget(coordinates)

    def _forget(self, coordinates: str) -> None:
        _, timer = self._kept.pop(coordinates)
        timer.cancel()
        inside.forget_file(coordinates)


_recent_files = _RecentFiles()


def _made(make: Callable[[], bytes | str], file_name: str, media_type: str) -> bytes:
    """Return a file made on demand, and keep it for `KEPT_S` seconds.

    Streamlit treats such a file as orphaned and deletes it at the end of the second script run after that, of any
    visitor: with others at work, that can be before the browser has fetched it.
    """
    made = make()
    content = made.encode() if isinstance(made, str) else made
    _recent_files.keep(content, file_name, media_type)
    return content


def _private_type(media_type: str, content: bytes | str | Callable[[], bytes | str]) -> str:
    """Return the media type with a parameter unique to this session and this content."""
    if callable(content):
        return f"{media_type}; address={secrets.token_hex(16)}"
    secret = st.session_state.setdefault("private_files.secret", secrets.token_hex(16))
    data = content.encode() if isinstance(content, str) else content
    return f"{media_type}; address={secret}{hashlib.sha256(data).hexdigest()}"


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
        Returns its bytes or text.
    meaning
        Help of the button, and description of the file in the ZIP.
    refusal
        Why the file is not available; "" if it is.
    first
        Whether its button comes before the others while it is available.
    """

    label: str
    name: str
    make: Callable[[], bytes | str]
    meaning: str
    refusal: str = ""
    first: bool = False


def file_of_image(stem: str, image: Image, meaning: str) -> File:
    """Return the file of an image; its name begins with `stem`, and its format suits the image."""
    name, write = image_file(stem, image)
    label = f"{stem.replace('_', ' ').capitalize()} {name.rpartition('.')[2].upper()}"
    return File(label, name, partial(write, image), meaning)


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
                partial(run_queued, file.make, memory),
                file.name,
                key=f"{key}.{file.name}",
                meaning=file.refusal or file.meaning,
                disabled=bool(file.refusal),
            )


def show_zip_button(make: Callable[[], bytes], memory: int, *, key: str, more: str = "", refusal: str = "") -> None:
    """Draw the button for the ZIP of all files; `more` extends its help, `refusal` says why it is not available."""
    download_button(
        "All in one ZIP",
        partial(run_queued, make, memory),
        "stereolag.zip",
        "application/zip",
        key=f"{key}.zip",
        meaning=refusal or " ".join(filter(None, ("All files offered here.", more))),
        icon=":material/folder_zip:",
        primary=True,
        disabled=bool(refusal),
    )


def take_away(
    files: Sequence[File],
    memory: int,
    command: str,
    purpose: str,
    *,
    own: bool,
    by_hand: Sequence[str] = (),
    key: str,
) -> None:
    """Offer files and the command that reproduces the result, and say what the address of the page includes.

    Parameters
    ----------
    files
        The files, in button order.
    memory
        Memory needed to make all of them, bytes.
    command
        One line, to be run in the folder of the unpacked ZIP.
    purpose
        The purpose of the command, such as "measure this lag again".
    own
        Whether the inputs are the visitor's own files.
    by_hand
        Parts of an example that the visitor made, which the address cannot include, such as "mask you painted".
    key
        Prefix of the keys.
    """
    about, refusal = f"To {purpose}, in the folder of these files: {command}", too_large(memory)
    with st.container(horizontal=True, gap="small"):
        show_zip_button(partial(archive, files, about), memory, key=key, refusal=refusal)
        show_file_buttons(files, memory, key=key)
    prose.caption(f"No ZIP of all files: {refusal}" if refusal else f"To {purpose}, in the folder of the unpacked ZIP:")
    if not refusal:
        st.code(command, language=None, wrap_lines=True)
    said = (
        "The address of this page holds its settings, but not your own files."
        if own
        else "The address of this page holds its settings and the example: share or bookmark it."
    )
    if by_hand:
        said += (
            f" The {' and the '.join(by_hand)} {'is' if len(by_hand) == 1 else 'are'} not in it: it opens the "
            "example’s own template."
        )
    prose.caption(said)


def too_large(memory: int) -> str:
    """Return why a file that needs `memory` bytes cannot be made; "" if it can."""
    allowed = limits().job_memory
    if memory <= allowed:
        return ""
    return f"Making it would take about {format_bytes(memory)} of memory; one job may take {format_bytes(allowed)}."


def refusal_of(check: Callable[[], object]) -> str:
    """Return why `check` refuses a file; "" if it does not."""
    try:
        check()
    except ValueError as error:
        return str(error)
    return ""


def archive(files: Sequence[File], about: str) -> bytes:
    """Return a ZIP of the available files and a README: `about`, then a description of each file."""
    available = [file for file in files if not file.refusal]
    meanings = "".join(f"{file.name}: {file.meaning}\n" for file in available)
    return bundle({README: f"{about}\n\n{meanings}"} | {file.name: file.make() for file in available})


def run_queued(make: Callable[[], bytes | str], memory: int) -> bytes | str:
    """Return the file that `make` makes; if that needs much memory, wait for its turn."""
    if memory < HEAVY_BYTES:
        return make()
    with limiter().admitted(object(), memory):
        return make()
