"""Files that the browser fetches by an address of their own: recordings to hear, results to download.

Streamlit keeps them in one store for all sessions, under an address made from the type, the name and the content, and
of contents above 1 MiB from the length and three samples only: the files of two visitors could share one address. The
type given to it here holds a secret as well, which makes every address one that nothing else leads to.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag.export import wav

SECRET_KEY = "private_files.secret"


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
    st.download_button(
        label,
        content,
        file_name,
        _private_type(media_type, content),
        key=key,
        help=meaning,
        icon=icon,
        type="primary" if primary else "secondary",
        on_click="ignore",
        disabled=disabled,
    )


def _private_type(media_type: str, content: bytes | str | Callable[[], bytes | str]) -> str:
    """Return the type with a parameter that no other session, and no other content, has."""
    if callable(content):
        return f"{media_type}; address={secrets.token_hex(16)}"
    secret = st.session_state.setdefault(SECRET_KEY, secrets.token_hex(16))
    data = content.encode() if isinstance(content, str) else content
    return f"{media_type}; address={secret}{hashlib.sha256(data).hexdigest()}"
