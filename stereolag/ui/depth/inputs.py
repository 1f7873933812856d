"""The pair that the depth page works on: an example or files of the visitor's own, resized, rectified and mended."""

from __future__ import annotations

import streamlit as st

from stereolag import samples
from stereolag.ui.choices import choose, own_or_example
from stereolag.ui.depth.address import recall_choices, recall_settings
from stereolag.ui.depth.adoption import take_over
from stereolag.ui.depth.doctor import treated
from stereolag.ui.depth.own_pair import ask_own_pair
from stereolag.ui.depth.resizing import ask_size
from stereolag.ui.depth.straightening import rectified
from stereolag.ui.pairs import StereoPair, example_pair

KEY = "pairs"


def choose_pair() -> StereoPair:
    """Ask which pair to measure and in which size; return it ready to be matched, and say what was done to it.

    Settings that the address names, or that a part of the page handed over, are set in the controls, which must
    therefore be drawn after this.
    """
    named = recall_choices(KEY)
    examples = samples.stereo_pairs()
    choices = st.container(horizontal=True, vertical_alignment="bottom", gap="medium")
    with choices:
        chosen = choose(examples, key=KEY)
    pair = own_or_example(chosen, lambda: ask_own_pair(KEY), example_pair, examples, key=KEY, awaited="both images are")
    with choices:
        pair = ask_size(pair, KEY)
    pair = treated(rectified(pair))
    untold = pair.notes[: len(pair.notes) - len(pair.remedies)]
    st.caption(" ".join((pair.description, *untold)))
    recall_settings(named, pair)
    take_over(pair)
    return pair
