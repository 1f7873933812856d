"""Why correlation finds a lag: interactive panels, and a short summary."""

from __future__ import annotations

import streamlit as st

from stereolag.core.searches import LagSearch
from stereolag.signals import SignalLag
from stereolag.ui import prose
from stereolag.ui.lag.panels import fool_it, show_phasors, show_plan, slide_it_yourself
from stereolag.ui.recordings import RecordingPair

IN_A_SENTENCE = """
- **Why the peak stands where it does.** There, every sample meets itself and the products add up, while anywhere
  else ups meet downs and cancel.
- **Why a tone has many peaks.** It meets itself again after every period, so all those lags fit equally well.
- **Why noise has none.** Two unrelated recordings agree in sign half the time at every lag: the sum stays within
  the grey band, and its highest point is chance.
"""


def see_why(pair: RecordingPair, result: SignalLag | None, search: LagSearch | None) -> None:
    """Show the panels in which recordings are slid, disturbed and turned by hand, all in the browser.

    Parameters
    ----------
    pair
        The recordings on the page.
    result, search
        Their result and its settings; None before the first measurement.
    """
    prose.header("See why", anchor="see-why")
    slide, disturb, arrows, metres = st.tabs(
        ("Slide it yourself", "Fool it", "Arrows that line up", "From lag to metres")
    )
    with slide:
        slide_it_yourself(key="lag.sliding")
    with disturb:
        fool_it(key="lag.fooling")
    with arrows:
        show_phasors(pair, result, key="lag.phasors")
    with metres:
        show_plan(result, (search or LagSearch()).speed, key="lag.plan")
    prose.markdown(IN_A_SENTENCE)
