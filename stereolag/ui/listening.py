"""Recordings to listen to."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import streamlit as st

from stereolag.ui.private_files import show_player

AUDIBLE_RATES = (3_000, 384_000)
"""Samples a second that browsers play."""

LONGEST_S = 120


def player(signal: npt.NDArray[np.float64], sampling_rate: float, name: str) -> None:
    """Show a player for a recording, for no more than its first two minutes."""
    lowest, highest = AUDIBLE_RATES
    if not lowest <= sampling_rate <= highest:
        st.caption(f"{name} cannot be played: browsers play {lowest:,} to {highest:,} samples a second.")
        return
    heard = signal[: round(LONGEST_S * sampling_rate)]
    st.caption(f"Listen to {name}" + ("" if heard.size == signal.size else f" (the first {LONGEST_S} s)"))
    show_player(heard, sampling_rate)
