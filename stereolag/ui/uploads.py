"""Files of a visitor's own: bytes in, what a reader makes of them out, one sentence where it cannot."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import streamlit as st

T = TypeVar("T")

PICTURE_TYPES = ("png", "jpg", "jpeg", "webp", "bmp", "tif", "tiff", "ppm", "pgm", "gif")
RECORDING_TYPES = ("wav", "flac", "ogg", "mp3", "aif", "aiff", "txt", "csv", "tsv", "dat", "npy")
DISPARITY_TYPES = ("pfm", "png", "pgm", "npy")
CALIBRATION_TYPES = ("txt", "yaml", "yml", "json")


@dataclass(frozen=True, eq=False)
class Upload(Generic[T]):
    """What a reader made of an uploaded file; its digest is the sha256 of the bytes and what the reading depends on."""

    digest: str
    content: T


def upload(
    label: str,
    read: Callable[[bytes], T],
    *,
    key: str,
    types: Sequence[str],
    note: str = "",
    variant: str = "",
    lasting: bool = True,
) -> Upload[T] | None:
    """Ask for a file and return what `read` makes of it, or None while there is none.

    A file that cannot be read is answered with the reader's sentence; the file that was in its place stays in use.

    Parameters
    ----------
    label, note
        What the file is, and a hint beside it.
    read
        Takes the bytes; raises ValueError with one clear sentence.
    key
        Of the widget.
    types
        File extensions offered.
    variant
        Whatever else the reading depends on.
    lasting
        Whether the file is still there when the visitor comes back from another page or from an example.
    """
    file = st.file_uploader(
        label, type=types, key=key, help=note or None, on_change=_forget_if_removed, kwargs={"key": key}
    )
    contents = [] if file is None else [file.getvalue()]
    return _read_once(contents, lambda contents: read(contents[0]), key, variant, lasting)


def upload_together(
    label: str, read: Callable[[list[bytes]], T], *, key: str, types: Sequence[str], note: str = "", variant: str = ""
) -> Upload[T] | None:
    """Ask for files that belong together and return what `read` makes of them all, as :func:`upload` does of one."""
    files = st.file_uploader(
        label,
        type=types,
        key=key,
        help=note or None,
        accept_multiple_files=True,
        on_change=_forget_if_removed,
        kwargs={"key": key},
    )
    return _read_once([file.getvalue() for file in files], read, key, variant, True)


@dataclass(frozen=True, eq=False)
class _Kept(Generic[T]):
    """An upload that was read, and the files it was read from."""

    upload: Upload[T]
    contents: list[bytes]


def _read_once(
    contents: list[bytes], read: Callable[[list[bytes]], T], key: str, variant: str, lasting: bool
) -> Upload[T] | None:
    """Return what was made of these contents before; make it now if there is none."""
    kept: _Kept[T] | None = st.session_state.get(_kept_key(key))
    if not contents:
        # Streamlit forgets the files of an uploader that was not drawn for a while.
        if kept is None or not lasting:
            _forget(key)
            return None
        contents = kept.contents
        _say_still_in_use(key)
    digest = " ".join(hashlib.sha256(content).hexdigest() for content in contents) + variant
    if kept is not None and kept.upload.digest == digest:
        return kept.upload
    try:
        with st.spinner("Reading the file …"):
            read_now = Upload(digest, read(contents))
    except ValueError as error:
        st.error(f"{error} The file before it stays in use." if kept else str(error))
        return kept.upload if kept else None
    st.session_state[_kept_key(key)] = _Kept(read_now, contents)
    return read_now


def _say_still_in_use(key: str) -> None:
    with st.container(horizontal=True, vertical_alignment="center"):
        st.caption("What you uploaded here before is still in use.", width="content")
        st.button("Remove", key=f"{key}.remove", type="tertiary", on_click=_forget, args=(key,))


def _forget_if_removed(key: str) -> None:
    if not st.session_state[key]:
        _forget(key)


def _forget(key: str) -> None:
    st.session_state.pop(_kept_key(key), None)


def _kept_key(key: str) -> str:
    return f"{key}.kept"
