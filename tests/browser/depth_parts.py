"""An app of one part of the depth page on a small pair: ``?part=comparison`` and so on."""

import streamlit as st

from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.ui.depth.blanks import show_blanks
from stereolag.ui.depth.comparison import show_comparison
from stereolag.ui.depth.match import show_inspection
from stereolag.ui.depth.readout import show_readout
from stereolag.ui.depth.view import DepthView
from stereolag.ui.pairs import example_pair
from tests.app.depth_view import small_view


def fence_view() -> DepthView:
    pair, matcher = example_pair("fence"), CorrelationMatcher(window_size=15)
    return DepthView(pair, {"Convolution": matcher.compute(pair.left, pair.right)}, 0, 64)


PARTS = {
    "comparison": (show_comparison, small_view),
    "readout": (show_readout, small_view),
    "inspection": (show_inspection, small_view),
    "blanks": (show_blanks, small_view),
    "fence": (show_inspection, fence_view),
}

st.set_page_config(layout="wide")
st.title("A part of the depth page")
show, view = PARTS[st.query_params["part"]]
show(st.cache_resource(view)())
