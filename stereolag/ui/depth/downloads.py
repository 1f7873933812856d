"""Take it away: buttons for all files about one result, and for loading settings."""

from __future__ import annotations

from functools import partial

import streamlit as st

from stereolag.core.jobs import format_bytes, limits
from stereolag.core.settings import scaled_settings
from stereolag.io.settings import read_matcher
from stereolag.stereo.matcher import DisparityMap
from stereolag.ui import prose
from stereolag.ui.depth.address import adopt
from stereolag.ui.depth.exports import archive, files, size_in_words
from stereolag.ui.depth.maps import DepthView, settings_key
from stereolag.ui.depth.pair_exports import PAIR_EXPORTS
from stereolag.ui.depth.subjects import Subject
from stereolag.ui.downloads import made_in_turn, show_file_buttons, show_zip_button
from stereolag.ui.private_files import download_button
from stereolag.ui.results import computed_in_turn
from stereolag.ui.sentences import duration
from stereolag.ui.states import show_refused
from stereolag.ui.uploads import upload

KEY = "depth.take"
BYTES_OF_A_PIXEL = 100
"""Memory per pixel while files are made: the map at the pair's own size, its points and colours, and the file."""
WANTED = f"{KEY}.wanted"
"""Session-state key of the maps that the visitor wants computed at their pair's own size."""


def show_downloads(view: DepthView) -> None:
    """Offer the files of one result, and ask for settings to load."""
    opened = st.expander("Take it away", icon=":material/download:", key=f"{KEY}.opened", on_change="rerun")
    if not opened.open or not view.results:
        return
    with opened:
        names = [*view.results]
        chosen = st.segmented_control("Result of", names, default=names[0], required=True, key=f"{KEY}.result")
        subject = Subject.of(view, chosen if chosen in view.results else names[0])
        if subject.reduced:
            _compute_in_own_size(subject)
        rows, cols = subject.pair.left.shape[:2]
        memory = BYTES_OF_A_PIXEL * rows * cols
        with st.container(horizontal=True, gap="small"):
            show_zip_button(
                partial(archive, subject),
                memory,
                key=KEY,
                more="Upload it as the left image to reopen the page as it is now.",
            )
            download_button(
                "Session ZIP",
                partial(made_in_turn, partial(archive, subject, PAIR_EXPORTS), memory),
                "stereolag-session.zip",
                "application/zip",
                key=f"{KEY}.session",
                meaning="The pair and the page’s settings, without the results: enough to continue from here.",
                icon=":material/bookmark:",
            )
            show_file_buttons(files(subject), memory, key=KEY)
        prose.caption(" ".join([size_in_words(subject), *(change.sentence for change in subject.pair.changes)]))
        _load_settings(subject)


def _compute_in_own_size(subject: Subject) -> None:
    """Offer to compute the map at the pair's own size if that takes long; store the result in the subject."""
    matcher, pair = subject.settings, subject.pair
    if matcher is None:
        prose.warning(subject.settings_refusal)
        return
    if subject.light:
        return
    wanted = f"{pair.digest} {settings_key(subject.shown)}"
    size = f"{pair.left.shape[1]} × {pair.left.shape[0]}"
    if subject.estimate.memory > limits().job_memory:
        prose.caption(
            f"Computed at {size}, this map would need about {format_bytes(subject.estimate.memory)} of memory, and "
            f"one job may take {format_bytes(limits().job_memory)}: the map in the files is the one shown, enlarged."
        )
        return
    if wanted not in st.session_state.get(WANTED, ()):
        st.button(
            f"Compute the map at {size}",
            key=f"{KEY}.compute",
            icon=":material/open_in_full:",
            help=f"About {duration(subject.estimate.seconds)}. Until then, the map in the files is the one shown, "
            "enlarged.",
            on_click=_want,
            args=(wanted,),
        )
        return
    found: DisparityMap | None = computed_in_turn(
        f"original map {matcher.short_name}",
        lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
        subject.estimate,
        inputs=pair.digest,
        settings=matcher.model_dump_json(),
        shared=pair.shared,
        label=f"{matcher.title} at {size} …",
    )
    subject.computed = found


def _want(wanted: str) -> None:
    st.session_state[WANTED] = {*st.session_state.get(WANTED, ()), wanted}


def _load_settings(subject: Subject) -> None:
    """Ask for a settings file, and set the controls to it once per file, scaled to the size shown."""
    loaded = upload(
        "Load settings",
        read_matcher,
        key=f"{KEY}.load",
        types=("json",),
        note="A settings JSON saved here, for the pair at its full size.",
        lasting=False,
    )
    digest = loaded.digest if loaded else None
    if loaded is not None and st.session_state.get(f"{KEY}.loaded") != digest:
        st.session_state[f"{KEY}.loaded"] = digest
        try:
            adopt(scaled_settings(loaded.content, 1 / subject.factor) if subject.reduced else loaded.content)
        except ValueError as error:
            show_refused(f"The settings could not be scaled with the images. {error}")
    st.session_state[f"{KEY}.loaded"] = digest
