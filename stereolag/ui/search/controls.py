"""Controls of a template search for other sizes and angles."""

from __future__ import annotations

import streamlit as st

from stereolag.core.searches import TemplateMethod, TemplateQuery
from stereolag.ui.controls import control

POSES = ("min_scale", "max_scale", "max_rotation")
OPENED = "template.poses"
AT_FIRST = {name: TemplateQuery.model_fields[name].default for name in POSES}


def ask_poses(method: TemplateMethod) -> dict[str, float]:
    """Return the sizes and angles to search; empty if the method handles only the template's own."""
    possible = method == "fft"
    values: dict[str, float] = {}
    if any(st.session_state.get(f"template.{name}", at_first) != at_first for name, at_first in AT_FIRST.items()):
        st.session_state.setdefault(OPENED, True)  # shown open when the address sets any of them
    with st.expander("Other sizes and angles", icon=":material/rotate_right:", key=OPENED, on_change="rerun"):
        for name, column in zip(POSES, st.columns(len(POSES), gap="medium"), strict=True):
            with column:
                values[name] = control(TemplateQuery, name, key=f"template.{name}", disabled=not possible)
    return values if possible else {}
