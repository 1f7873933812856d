"""Depth from two eyes: windowed correlation beside OpenCV's matchers, and everything to ask about the maps."""

from dataclasses import replace

import streamlit as st

from stereolag.stereo.methods import METHODS
from stereolag.ui.depth.address import write_address
from stereolag.ui.depth.blanks import show_blanks
from stereolag.ui.depth.colouring import coloured_alike
from stereolag.ui.depth.comparison import show_comparison
from stereolag.ui.depth.doctor import show_doctor
from stereolag.ui.depth.exports import show_downloads
from stereolag.ui.depth.inputs import choose_pair
from stereolag.ui.depth.maps import choose_methods, measured, show_images, show_map
from stereolag.ui.depth.match import show_inspection
from stereolag.ui.depth.presets import show_presets
from stereolag.ui.depth.readout import show_readout
from stereolag.ui.depth.scoreboard import show_scoreboard
from stereolag.ui.depth.space import show_space
from stereolag.ui.depth.suggesting import show_suggest
from stereolag.ui.depth.sweeping import show_sweep
from stereolag.ui.keys import PART, opened_key
from stereolag.ui.matcher_controls import ask_matcher
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
WHAT_FOLLOWS = (
    "**[Look closer ↓](#look-closer)** Compare all methods pixel by pixel, read values and distances, see why a match "
    "was made or is missing, judge by the ground truth, sweep or suggest settings, walk through it in 3-D, take it all "
    "away."
)


@fragment
def workspace(pair: StereoPair) -> None:
    """Ask, compute and show; moving a control reruns this part alone, and the maps come before all the rest."""
    doctor = st.container()
    columns = st.columns(3, gap="medium")
    columns[0].markdown("#### Images")
    images, colours = columns[0].container(), columns[0].container()
    shown = choose_methods(columns[1:])
    matchers, maps, results = {}, {}, {}
    for column, method in zip(columns[1:], shown, strict=True):
        with column:
            maps[method] = st.container()
            with st.container(border=True):
                matchers[method] = ask_matcher(method, pair)
    for method in shown:
        with maps[method]:
            results |= measured(pair, matchers[method])
    with colours:
        view = coloured_alike(pair, results)
    for method in shown:
        with maps[method]:
            show_map(view, method.title)
    with images:
        show_images(view)
    others = [method for method in METHODS if method not in shown]
    opened = []
    with columns[0]:
        for method in others:
            with st.expander(method.title, key=opened_key(method.short_name), on_change="rerun") as expander:
                if expander.open:
                    opened.append(method)
                    st.caption("One more method to compare with: it joins the maps below.")
                matchers[method] = ask_matcher(method, pair, drawn=bool(expander.open))
    columns[0].markdown(WHAT_FOLLOWS)
    write_address(pair, matchers.values())
    st.subheader("Look closer", anchor="look-closer")
    part = st.segmented_control(
        "Look closer", [*PARTS], key=PART, persist_state="session", width="stretch", label_visibility="collapsed"
    )
    with columns[0]:
        for method in others if part else opened:
            results |= measured(pair, matchers[method])
    view = replace(view, results=results)
    with doctor:
        show_doctor(view)
    if part and results:
        PARTS[part](view)
    show_downloads(view)


with page(
    "Depth maps",
    "Near things shift more between the two cameras than far ones. Cut the left image into small windows and slide each"
    " along the right image: the lag of the best match is its disparity, large for near things and small for far ones.",
):
    chosen_pair = choose_pair()
    show_presets(chosen_pair)
    workspace(chosen_pair)
    with st.expander("The source report"):
        st.markdown(
            "Near things have the **large** lag, and the report’s cameras run at 10 Hz, not 10 kHz. With a window of "
            "20 px and an overlap of 0.95 its depth map took 111 s, and StereoBM 0.28 s: that is 400 times, not 1000. "
            "The report’s preset shows its depth map; ZNCC, the default here, also takes out how bright and how "
            "contrasty each window is."
        )
