"""Files that the browser fetches from their own addresses: recordings to play, results to download.

Streamlit keeps them in one store for all sessions. It derives the address from the type, the name and the content, but
above 1 MiB only from the length and three samples of the content: files of two visitors could share an address. The
type passed here therefore includes a secret, so that no other file can lead to the same address.
"""

from __future__ import annotations

import hashlib
import secrets
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag import streamlit_inside as inside
from stereolag.io.results import wav

SECRET_KEY = "private_files.secret"

KEPT_S = 60
"""How long a file made on demand can be fetched, s."""
MOST_BYTES = 256 * 2**20
"""Limit for all such files together, bytes; the newest is kept whatever its size."""


def show_player(signal: npt.NDArray[np.float64], sampling_rate: float, name: str) -> None:
    """Show a player for a recording, (samples,), at the largest volume that does not clip."""
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
        _kept_meanwhile(content, file_name, private_type) if callable(content) else content,
        file_name,
        private_type,
        key=key,
        help=meaning,
        icon=icon,
        type="primary" if primary else "secondary",
        on_click="ignore",
        disabled=disabled,
    )


@dataclass(frozen=True, eq=False)
class _KeptFile:
    coordinates: str
    size: int
    timer: threading.Timer


class _RecentFiles:
    """Files made on demand, each at its own coordinates in Streamlit's store, which keeps files with coordinates."""

    def __init__(self) -> None:
        self._kept: deque[_KeptFile] = deque()
        self._free: list[str] = []
        self._lock = threading.Lock()

    def keep(self, content: bytes, file_name: str, media_type: str) -> None:
        """Keep a file for `KEPT_S` seconds; drop older ones sooner if all together exceed `MOST_BYTES`."""
        with self._lock:
            while self._kept and sum(one.size for one in self._kept) + len(content) > MOST_BYTES:
                self._forget(self._kept[0])
            coordinates = self._free.pop() if self._free else f"private_files.{len(self._kept)}"
            inside.keep_file(content, file_name, media_type, coordinates)
            timer = threading.Timer(KEPT_S, lambda: self._expire(kept))
            timer.daemon = True
            kept = _KeptFile(coordinates, len(content), timer)
            self._kept.append(kept)
            timer.start()

    def _expire(self, kept: _KeptFile) -> None:
        with self._lock:
            if kept in self._kept:
                self._forget(kept)

    def _forget(self, kept: _KeptFile) -> None:
        kept.timer.cancel()
        self._kept.remove(kept)
        self._free.append(kept.coordinates)
        inside.forget_file(kept.coordinates)


_recent_files = _RecentFiles()


def _kept_meanwhile(content: Callable[[], bytes | str], file_name: str, media_type: str) -> Callable[[], bytes]:
    """Return a function that makes the same file and keeps it for `KEPT_S` seconds.

    Streamlit treats a file made on demand as orphaned, and deletes it at the end of the second script run after that,
    of any visitor: if others are computing, before the browser has fetched it.
    """

    def made() -> bytes:
        told = content()
        data = told.encode() if isinstance(told, str) else told
        _recent_files.keep(data, file_name, media_type)
        return data

    return made


def _private_type(media_type: str, content: bytes | str | Callable[[], bytes | str]) -> str:
    """Return the media type with a parameter unique to this session and this content."""
    if callable(content):
        return f"{media_type}; address={secrets.token_hex(16)}"
    secret = st.session_state.setdefault(SECRET_KEY, secrets.token_hex(16))
    data = content.encode() if isinstance(content, str) else content
    return f"{media_type}; address={secret}{hashlib.sha256(data).hexdigest()}"
