"""Files that the browser fetches by an address of their own: recordings to hear, results to download.

Streamlit keeps them in one store for all sessions, under an address made from the type, the name and the content, and
of contents above 1 MiB from the length and three samples only: the files of two visitors could share one address. The
type given to it here holds a secret as well, which makes every address one that nothing else leads to.
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
from streamlit import runtime

from stereolag.export import wav

SECRET_KEY = "private_files.secret"

KEPT_S = 60
"""How long a file that was made on demand can be fetched."""
MOST_BYTES = 256 * 2**20
"""Of all such files together; the newest is kept whatever its size."""


def show_player(signal: npt.NDArray[np.float64], sampling_rate: float, name: str) -> None:
    """Show a player for a recording of that name, (samples,), as loud as it can be without clipping."""
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
    """Offer a file; where `content` is a function, it is made when the visitor asks for it."""
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
    """Files made on demand, each at coordinates of its own in Streamlit's store, which keeps what stands at some."""

    def __init__(self) -> None:
        self._kept: deque[_KeptFile] = deque()
        self._free: list[str] = []
        self._lock = threading.Lock()

    def keep(self, content: bytes, file_name: str, media_type: str) -> None:
        """Keep a file for `KEPT_S` seconds; those made before it go sooner where all are larger than `MOST_BYTES`."""
        with self._lock:
            while self._kept and sum(one.size for one in self._kept) + len(content) > MOST_BYTES:
                self._forget(self._kept[0])
            coordinates = self._free.pop() if self._free else f"private_files.{len(self._kept)}"
            files = runtime.get_instance().media_file_mgr
            files.add(content, media_type, coordinates, file_name, is_for_static_download=True)
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
        if runtime.exists():
            # Another file at its coordinates is how the store is told that one is not needed any more.
            runtime.get_instance().media_file_mgr.add(b"", "text/plain", kept.coordinates, is_for_static_download=True)


_recent_files = _RecentFiles()


def _kept_meanwhile(content: Callable[[], bytes | str], file_name: str, media_type: str) -> Callable[[], bytes]:
    """Return a function that makes the same file and keeps it for `KEPT_S` seconds.

    Streamlit takes a file made on demand for nobody's and deletes it when the second script run from then ends, of any
    visitor: where others compute, before the browser has fetched it.
    """

    def made() -> bytes:
        told = content()
        data = told.encode() if isinstance(told, str) else told
        _recent_files.keep(data, file_name, media_type)
        return data

    return made


def _private_type(media_type: str, content: bytes | str | Callable[[], bytes | str]) -> str:
    """Return the type with a parameter that no other session, and no other content, has."""
    if callable(content):
        return f"{media_type}; address={secrets.token_hex(16)}"
    secret = st.session_state.setdefault(SECRET_KEY, secrets.token_hex(16))
    data = content.encode() if isinstance(content, str) else content
    return f"{media_type}; address={secret}{hashlib.sha256(data).hexdigest()}"
