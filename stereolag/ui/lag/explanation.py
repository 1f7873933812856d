"""Why correlation finds a lag: things to move, and one sentence for each."""

from __future__ import annotations

import streamlit as st

from stereolag.searches import LagSearch
from stereolag.signals import SignalLag
from stereolag.ui.disturbances import fool_it
from stereolag.ui.lag.plan import show_plan
from stereolag.ui.sliding import slide_it_yourself

IN_A_SENTENCE = """
- **Why the peak stands where it does.** There, every sample meets itself: all products are positive and add up,
  while anywhere else ups meet downs and cancel.
- **Why a tone has many peaks.** It meets itself again after every period, so all those lags fit equally well.
- **Why noise has none.** Two unrelated recordings agree in sign half of the time at every lag: the sum stays within
  the grey ribbon, and its highest point is chance.
"""


def see_why(result: SignalLag | None, search: LagSearch | None) -> None:
    """Show what can be slid, dragged and disturbed by hand, all in the browser.

    Parameters
    ----------
    result, search
        Of the recordings on the page; None where there is none yet.
    """
    st.subheader("See why", anchor="see-why")
    slide, disturb, metres = st.tabs(("Slide it yourself", "Fool it", "From lag to metres"))
    with slide:
        slide_it_yourself(key="lag.sliding")
    with disturb:
        fool_it(key="lag.fooling")
    with metres:
        show_plan(result, (search or LagSearch()).speed, key="lag.plan")
    st.markdown(IN_A_SENTENCE)
