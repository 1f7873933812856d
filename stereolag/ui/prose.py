"""Streamlit's text elements, with numbers typeset by :func:`stereolag.core.typography.typeset`.

Pages call ``prose.caption`` instead of ``st.caption``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Concatenate, ParamSpec, TypeVar

import streamlit as st

from stereolag.core.typography import typeset

P = ParamSpec("P")
R = TypeVar("R")


def _typesetting(element: Callable[Concatenate[str, P], R]) -> Callable[Concatenate[str, P], R]:
    @functools.wraps(element)
    def shown(text: str, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return element(typeset(text), *args, **kwargs)

    return shown


markdown = _typesetting(st.markdown)
caption = _typesetting(st.caption)
header = _typesetting(st.header)
info = _typesetting(st.info)
success = _typesetting(st.success)
warning = _typesetting(st.warning)
error = _typesetting(st.error)
