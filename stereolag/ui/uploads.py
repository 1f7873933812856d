"""Uploaded files: bytes in, the content read from them out, or one sentence if they cannot be read."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import streamlit as st

from stereolag.io.calibrations import CALIBRATION_SUFFIXES
from stereolag.io.disparities import DISPARITY_SUFFIXES
from stereolag.io.images import IMAGE_SUFFIXES
from stereolag.io.sources import quoted
from stereolag.streamlit_inside import UploadedFile
from stereolag.ui import prose
from stereolag.ui.elements import show_refused

T = TypeVar("T")

PICTURE_TYPES = IMAGE_SUFFIXES
RECORDING_TYPES = ("wav", "flac", "ogg", "mp3", "aif", "aiff", "txt", "csv", "tsv", "dat", "npy")
DISPARITY_TYPES = DISPARITY_SUFFIXES
CALIBRATION_TYPES = CALIBRATION_SUFFIXES

ARRIVAL_S = 2.0
"""How long an uploader may be empty before its file counts as removed, s; replacing a file empties it first."""

SET_ASIDE_S = 120.0
"""How long a file that seemed removed can be restored, s, if its slow replacement proves unreadable."""

REFUSED_KEY = "uploads.refused"

HERE_KEY = "uploads.here"
"""Session-state key of {label of a file this run requires: whether it is there}."""

OPTIONAL = "(optional)"


@dataclass(frozen=True, eq=False)
class Upload(Generic[T]):
    """The content read from a file; the digest is the sha256 of its bytes, followed by the variant it was read with."""

    digest: str
    content: T


@dataclass(frozen=True, eq=False)
class _Kept(Generic[T]):
    """An upload with its files and variant, and their bytes if they may have to be read again."""

    upload: Upload[T]
    files: tuple[str, ...]
    variant: str | None
    contents: list[bytes]


@dataclass(frozen=True)
class _Refusal:
    """The error sentence for unreadable files, kept so that they are not read again in every rerun."""

    files: tuple[str, ...]
    variant: str | None
    sentence: str


def upload(
    label: str,
    read: Callable[[bytes], T],
    *,
    key: str,
    types: Sequence[str],
    note: str = "",
    variant: str | None = None,
    lasting: bool = True,
) -> Upload[T] | None:
    """Ask for a file and return its content as read by `read`, or None while there is none.

    If the file cannot be read, the reader's sentence is shown and the previous file stays in use.

    Parameters
    ----------
    label, note
        Label of the uploader, and a hint beside it.
    read
        Takes the bytes; raises ValueError with one clear sentence.
    key
        Widget key.
    types
        File extensions offered.
    variant
        Anything else the reading depends on; None if nothing, so that the bytes need not be kept.
    lasting
        Whether the file is still there when the visitor returns from another page or from an example.
    """
    file = st.file_uploader(label, type=types, key=key, help=note or None, on_change=_note_emptied, args=(key,))
    files = [] if file is None else [file]

    def read_one(contents: list[bytes]) -> T:
        try:
            return read(contents[0])
        except ValueError as error:
            raise ValueError(f"{quoted(file.name)}: {error}" if file else str(error)) from error

    given = _read_once(files, read_one, key, variant, lasting)
    if OPTIONAL not in label:
        st.session_state.setdefault(HERE_KEY, {})[label] = given is not None
    return given


def upload_together(
    label: str, read: Callable[[list[bytes]], T], *, key: str, types: Sequence[str], note: str = "", variant: str = ""
) -> Upload[T] | None:
    """Ask for files that belong together and return the content of all of them, as :func:`upload` does for one.

    They are read in order of their names, whichever arrived first: left before right, camera 0 before camera 1.
    """
    files = _ask_several(label, key=key, types=types, note=note)
    return _read_once(sorted(files, key=lambda file: file.name.lower()), read, key, variant, True)


def upload_named(
    label: str,
    read: Callable[[Sequence[tuple[str, bytes]]], T],
    *,
    key: str,
    types: Sequence[str],
    note: str = "",
) -> Upload[T] | None:
    """Ask for files and return the content of all of them, read with their names, as :func:`upload` does for one."""
    files = _ask_several(label, key=key, types=types, note=note)
    names = [file.name for file in files]
    return _read_once(files, lambda contents: read([*zip(names, contents, strict=True)]), key, None, True)


def _ask_several(label: str, *, key: str, types: Sequence[str], note: str) -> list[UploadedFile]:
    return st.file_uploader(
        label,
        type=types,
        key=key,
        help=note or None,
        accept_multiple_files=True,
        on_change=_note_emptied,
        args=(key,),
    )


def put_together(make: Callable[[], T], key: str) -> T | None:
    """Return the combination of several uploads; if they do not fit together, show why and return the last one."""
    try:
        made = make()
    except ValueError as error:
        kept: T | None = st.session_state.get(key)
        show_refused(error if kept is None else f"{error} The previous files stay in use.")
        st.session_state[REFUSED_KEY] = kept is None
        return kept
    st.session_state[key] = made
    return made


def forget_together(key: str) -> None:
    """Forget the last result of :func:`put_together`, because some of its files are gone."""
    st.session_state.pop(key, None)


def expect_uploads() -> None:
    """Start a run in which nothing is refused yet."""
    st.session_state[REFUSED_KEY] = False
    st.session_state[HERE_KEY] = {}


def still_missing() -> list[str]:
    """Return the labels of the missing files; none if no file is there yet."""
    here: dict[str, bool] = st.session_state.get(HERE_KEY, {})
    return [label for label, is_here in here.items() if not is_here] if any(here.values()) else []


def refuse(sentence: str) -> None:
    """Show why an input cannot be used when nothing else takes its place."""
    show_refused(sentence)
    st.session_state[REFUSED_KEY] = True


def refused() -> bool:
    """Return whether files were refused in this run with nothing else in their place."""
    return bool(st.session_state.get(REFUSED_KEY, False))


def _read_once(
    files: Sequence[UploadedFile], read: Callable[[list[bytes]], T], key: str, variant: str | None, lasting: bool
) -> Upload[T] | None:
    """Return the content read from these files before; read it now if there is none."""
    kept: _Kept[T] | None = st.session_state.get(_kept_key(key))
    if not files:
        if kept is not None and lasting and st.session_state.get(_emptied_key(key)):
            _wait_for_another()
            st.session_state[_set_aside_key(key)] = time.monotonic(), kept
            kept = None
        if kept is None or not lasting:
            _forget(key)
            return None
        _say_still_in_use(key)
        if kept.variant == variant:
            return kept.upload
        names, contents = kept.files, kept.contents
    else:
        st.session_state.pop(_emptied_key(key), None)
        names = tuple(file.file_id for file in files)
        if kept is not None and (kept.files, kept.variant) == (names, variant):
            return kept.upload
        contents = [file.getvalue() for file in files]
    kept = kept or _taken_back(key)
    refusal: _Refusal | None = st.session_state.get(_refusal_key(key))
    if refusal is None or (refusal.files, refusal.variant) != (names, variant):
        digest = " ".join(hashlib.sha256(content).hexdigest() for content in contents) + (variant or "")
        try:
            with st.spinner("Reading the file …"):
                read_now = Upload(digest, read(contents))
        except ValueError as error:
            refusal = _Refusal(names, variant, str(error))
        else:
            _forget(key)
            again = [] if variant is None else contents
            st.session_state[_kept_key(key)] = _Kept(read_now, names, variant, again)
            return read_now
    st.session_state[_refusal_key(key)] = refusal
    show_refused(f"{refusal.sentence} The previous file stays in use." if kept else refusal.sentence)
    if kept is None:
        st.session_state[REFUSED_KEY] = True
        return None
    st.session_state[_kept_key(key)] = kept
    return kept.upload


def _wait_for_another() -> None:
    """Return when no other file has arrived for a while; if one does, its rerun of the page ends this run here."""
    end = time.monotonic() + ARRIVAL_S
    with st.spinner("Removing the file …"):
        pulse = st.empty()
        while time.monotonic() < end:
            time.sleep(0.05)
            pulse.empty()


def _taken_back(key: str) -> _Kept[T] | None:
    """Return the file that seemed removed a short while ago, or None."""
    moment, kept = st.session_state.pop(_set_aside_key(key), (-math.inf, None))
    return kept if time.monotonic() - moment <= SET_ASIDE_S else None


def _say_still_in_use(key: str) -> None:
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.caption("The file you uploaded here before is still in use.", width="content")
        st.button("Remove", key=f"{key}.remove", type="tertiary", on_click=_forget, args=(key,))


def _note_emptied(key: str) -> None:
    if not st.session_state[key]:
        st.session_state[_emptied_key(key)] = True


def _forget(key: str) -> None:
    for place in (_kept_key(key), _refusal_key(key), _emptied_key(key)):
        st.session_state.pop(place, None)


def _kept_key(key: str) -> str:
    return f"{key}.kept"


def _set_aside_key(key: str) -> str:
    return f"{key}.aside"


def _refusal_key(key: str) -> str:
    return f"{key}.refusal"


def _emptied_key(key: str) -> str:
    return f"{key}.emptied"
