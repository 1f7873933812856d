"""An app of one part of the depth page on a small pair: ``?part=comparison`` and so on."""

import streamlit as st

from stereolag.ui.depth.blanks import show_blanks
from stereolag.ui.depth.comparison import show_comparison
from stereolag.ui.depth.match import show_inspection
from stereolag.ui.depth.readout import show_readout
from tests.app.depth_view import small_view

PARTS = {
    "comparison": show_comparison,
    "readout": show_readout,
    "inspection": show_inspection,
    "blanks": show_blanks,
}

st.set_page_config(layout="wide")
st.title("A part of the depth page")
PARTS[st.query_params["part"]](st.cache_resource(small_view)())
