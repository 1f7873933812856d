"""Take it away: everything about one result as files, one by one or in one ZIP, each made when it is asked for."""

from __future__ import annotations

from functools import partial

import streamlit as st

from stereolag.export import bundle
from stereolag.reading import read_matcher
from stereolag.ui.depth.address import adopt
from stereolag.ui.depth.exports import File, files
from stereolag.ui.depth.view import DepthView
from stereolag.ui.private_files import download_button
from stereolag.ui.uploads import upload

KEY = "depth.take"


def show_downloads(view: DepthView) -> None:
    """Offer the files of one result, and take settings back in."""
    opened = st.expander("Take it away", icon=":material/download:", key=f"{KEY}.opened", on_change="rerun")
    if not opened.open or not view.results:
        return
    with opened:
        names = [*view.results]
        chosen = st.segmented_control("Result of", names, default=names[0], required=True, key=f"{KEY}.result")
        offered = files(view, chosen if chosen in view.results else names[0])
        with st.container(horizontal=True, gap="small"):
            download_button(
                "All in one ZIP",
                partial(archive, offered),
                "stereolag.zip",
                "application/zip",
                key=f"{KEY}.zip",
                meaning="All files on offer here, with the pair as it was matched.",
                icon=":material/folder_zip:",
                primary=True,
            )
            for file in offered:
                download_button(
                    file.label,
                    file.make,
                    file.name,
                    key=f"{KEY}.{file.name}",
                    meaning=file.refusal or file.meaning,
                    disabled=bool(file.refusal),
                )
        if view.pair.changes:
            done = " ".join(change.sentence for change in view.pair.changes)
            st.caption(f"The pair in the ZIP is the one that was matched. {done}")
        _load_settings()


def archive(offered: list[File]) -> bytes:
    """Return one ZIP of the files that can be had."""
    return bundle({file.name: file.make() for file in offered if not file.refusal})


def _load_settings() -> None:
    """Ask for a settings file, and set the controls to what it says, once a file."""
    loaded = upload(
        "Load settings",
        read_matcher,
        key=f"{KEY}.load",
        types=("json",),
        note="A settings JSON from here.",
        lasting=False,
    )
    digest = loaded.digest if loaded else None
    if loaded is not None and st.session_state.get(f"{KEY}.loaded") != digest:
        st.session_state[f"{KEY}.loaded"] = digest
        adopt(loaded.content)
    st.session_state[f"{KEY}.loaded"] = digest
