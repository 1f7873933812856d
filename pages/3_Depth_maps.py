"""Depth from two eyes: windowed correlation beside OpenCV's matchers, and everything to ask about the maps."""

from dataclasses import replace

import streamlit as st

from stereolag.ui.depth.address import write_address
from stereolag.ui.depth.blanks import show_blanks
from stereolag.ui.depth.colouring import coloured_alike
from stereolag.ui.depth.comparison import show_comparison
from stereolag.ui.depth.doctor import show_doctor
from stereolag.ui.depth.downloads import show_downloads
from stereolag.ui.depth.inputs import choose_pair
from stereolag.ui.depth.match import show_inspection
from stereolag.ui.depth.presets import show_presets
from stereolag.ui.depth.readout import show_readout
from stereolag.ui.depth.scoreboard import show_scoreboard
from stereolag.ui.depth.space import show_space
from stereolag.ui.depth.suggesting import show_suggest
from stereolag.ui.depth.sweeping import show_sweep
from stereolag.ui.depth.view import measured, show_images, show_map
from stereolag.ui.matchers import ask_block_matcher, ask_correlation, ask_semi_global
from stereolag.ui.navigation import fragment, page
from stereolag.ui.pairs import StereoPair

PARTS = {
    "Compare": show_comparison,
    "Values": show_readout,
    "Why this match?": show_inspection,
    "Why blank?": show_blanks,
    "Scoreboard": show_scoreboard,
    "Sweep": show_sweep,
    "Suggest": show_suggest,
    "In 3-D": show_space,
}
SEMI_GLOBAL = "StereoSGBM"
WHAT_FOLLOWS = (
    "**[Look closer ↓](#look-closer)** Compare all methods pixel by pixel, read values and distances, see why a match "
    "was made or is missing, judge by the truth, sweep or suggest settings, walk through it in 3-D, take it all away."
)


@fragment
def workspace(pair: StereoPair) -> None:
    """Ask, compute and show; moving a control reruns this part alone, and the maps come before all the rest."""
    doctor = st.container()
    titles = ("Images", "Convolution", "OpenCV StereoBM")
    columns = st.columns(3, gap="medium")
    places = []
    for column, title in zip(columns, titles, strict=True):
        column.markdown(f"#### {title}")
        places.append(column.container())
    colours = columns[0].container()
    with columns[1], st.container(border=True):
        matcher = ask_correlation(pair)
    with columns[2], st.container(border=True):
        block_matcher = ask_block_matcher(pair)
    methods = {"Convolution": (matcher, places[1]), "StereoBM": (block_matcher, places[2])}
    results = {}
    for name, (settings, place) in methods.items():
        with place:
            result = measured(pair, settings, f"{name} …")
        if result is not None:
            results[name] = result
    with colours:
        view = coloured_alike(pair, results)
    for name, (_, place) in methods.items():
        with place:
            show_map(view, name)
    with places[0]:
        show_images(view)
    with columns[0], st.expander("OpenCV StereoSGBM", key="depth.sgbm", on_change="rerun") as semi_global:
        if semi_global.open:
            st.caption("A third method to compare with: it joins the maps below.")
        semi_global_matcher = ask_semi_global(pair, drawn=bool(semi_global.open))
    columns[0].markdown(WHAT_FOLLOWS)
    write_address(pair, (matcher, block_matcher, semi_global_matcher))
    st.subheader("Look closer", anchor="look-closer")
    part = st.segmented_control(
        "Look closer",
        [*PARTS],
        key="depth.part",
        persist_state="session",
        width="stretch",
        label_visibility="collapsed",
    )
    if part or semi_global.open:
        with columns[0]:
            third = measured(pair, semi_global_matcher, f"{SEMI_GLOBAL} …")
        if third is not None:
            view = replace(view, results=results | {SEMI_GLOBAL: third})
    with doctor:
        show_doctor(view)
    if part and view.results:
        PARTS[part](view)
    show_downloads(view)


with page(
    "Depth maps",
    "Near things shift more between two eyes than far ones. Cut the left image into small windows and slide each along "
    "the right image: the lag of the best match is its disparity, large for near things and small for far ones.",
):
    chosen_pair = choose_pair()
    show_presets(chosen_pair)
    workspace(chosen_pair)
    with st.expander("What the source report says"):
        st.markdown(
            "Near things have the **large** lag, and the report’s cameras run at 10 Hz, not 10 kHz. With a window of "
            "20 px and an overlap of 0.95 its depth map took 111 s, and StereoBM 0.28 s: that is 400 times, not 1000. "
            "The report’s preset shows its depth map; ZNCC, the default here, also takes out how bright and how "
            "contrasty each window is."
        )
