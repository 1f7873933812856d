"""Depth from a stereo pair: windowed correlation beside OpenCV's matchers, and tools to examine the maps."""

from dataclasses import replace

import streamlit as st

from stereolag.pair import Pair
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.methods import METHODS
from stereolag.ui import prose
from stereolag.ui.controls import persistent
from stereolag.ui.depth.comparing import show_all_pairs, show_comparison, show_scoreboard
from stereolag.ui.depth.distances import show_readout, show_space
from stereolag.ui.depth.downloads import show_downloads
from stereolag.ui.depth.explaining import show_blanks, show_inspection
from stereolag.ui.depth.inputs import choose_pair
from stereolag.ui.depth.live import LiveCamera, follow_sliders, show_live
from stereolag.ui.depth.maps import (
    choose_maps,
    compute_map,
    send_ahead,
    send_images,
    show_controls,
    show_maps,
    show_presets,
    shown_methods,
)
from stereolag.ui.depth.preparing import show_doctor
from stereolag.ui.depth.state import write_address
from stereolag.ui.depth.tuning import show_suggest, show_sweep
from stereolag.ui.depth.view import PART, coloured_view, offer_fit
from stereolag.ui.matcher_controls import control_state
from stereolag.ui.navigation import bench, fragment, page

PARTS = {
    "Compare": show_comparison,
    "Values": show_readout,
    "Why this match?": show_inspection,
    "Why blank?": show_blanks,
    "Scoreboard": show_scoreboard,
    "All pairs": show_all_pairs,
    "Sweep": show_sweep,
    "Suggest": show_suggest,
    "In 3-D": show_space,
}


@fragment
def workspace(pair: Pair) -> None:
    """Draw the controls, compute and show; moving a control reruns only this fragment, and the maps come first."""
    states = {method: control_state(method, pair) for method in METHODS}
    matchers = {method: state.matcher for method, state in states.items()}
    shown = shown_methods()
    sent = send_ahead(pair, [matchers[method] for method in shown])
    controls, maps = bench()
    results: dict[str, DisparityMap] = {}
    with maps:
        doctor = st.container()
        with st.container(horizontal=True, vertical_alignment="center"):
            choose_maps()
            line = st.container(horizontal=True, width="content")
            waiting = st.container(width="stretch")
        for method in shown:
            results |= compute_map(pair, matchers[method], waiting)
        with line:
            view = coloured_view(pair, results)
            outdated = {one.settings.title for one in results.values() if one.settings != matchers[type(one.settings)]}
            view = replace(view, outdated=outdated)
        if results:
            show_maps(view, sent)
            offer_fit(view)
        if not shown:
            prose.info("No map is chosen. Choose one above.", icon=":material/touch_app:")
    with controls:
        show_presets(pair)
        show_controls(states)
    write_address(pair, matchers.values())
    prose.header("Look closer", anchor="look-closer")
    part = st.segmented_control(
        "Look closer", [*PARTS], required=True, **persistent(PART), width="stretch", label_visibility="collapsed"
    )
    with doctor:
        show_doctor(view, line)
    if part:
        for method in METHODS:
            if method not in shown:
                results |= compute_map(pair, matchers[method])
        view = replace(view, results=results)
    if part and results:
        PARTS[part](view)
    show_downloads(view)


with page("Depth maps"):
    pair = choose_pair()
    if isinstance(pair, LiveCamera):
        show_live(pair)
    else:
        follow_sliders(pair)
        workspace(pair)
        send_images(pair)
    with st.expander("The source report"):
        prose.markdown(
            "Near things have the **large** lag, and the report’s cameras run at 10 Hz, not 10 kHz. With a window of "
            "20 px and an overlap of 0.95 its depth map took 111 s, and StereoBM 0.28 s: that is 400 times, not 1000. "
            "The report’s preset reproduces the maps in its figures; ZNCC, the default here, also removes each "
            "window’s brightness and contrast."
        )
