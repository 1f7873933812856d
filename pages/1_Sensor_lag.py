"""The lag between two recordings: how much later the sound reaches one sensor, and how much longer its path is."""

import streamlit as st

from stereolag.core.searches import LagSearch
from stereolag.signals import SignalLag, estimate_lag, signal_lag
from stereolag.ui import prose
from stereolag.ui.controls import control, last_valid
from stereolag.ui.lag.inputs import LAG_ADDRESS, RecordingPair, choose_recordings, lag_key
from stereolag.ui.lag.panels import fool_it, show_phasors, show_plan, slide_it
from stereolag.ui.lag.parts import compare_methods, listen, show_lag_files, show_lined_up, show_over_time, show_verdict
from stereolag.ui.navigation import bench, fragment, page, show_parts
from stereolag.ui.results import computed_or_refused, kept_for
from stereolag.ui.sentences import LAG_METHODS, LAG_METHODS_EXPLAINED

PARTS = {
    "Slide it": slide_it,
    "Over time": show_over_time,
    "Lined up": show_lined_up,
    "Listen": listen,
    "Fool it": fool_it,
    "Arrows": show_phasors,
    "To metres": show_plan,
    "Methods": compare_methods,
    "Take away": show_lag_files,
}


def ask(pair: RecordingPair) -> LagSearch | None:
    """Return the search settings, or None if they are refused."""
    method = control(LagSearch, "method", key="lag.method", names=LAG_METHODS)
    prose.caption(LAG_METHODS_EXPLAINED[method])
    rate = control(LagSearch, "sampling_rate", key=lag_key("sampling_rate", pair), value=pair.sampling_rate)
    speed = control(LagSearch, "speed", key=lag_key("speed", pair), value=pair.speed)
    max_lag = control(LagSearch, "max_lag", key=lag_key("max_lag", pair), high=pair.longest_lag, when_empty="every lag")
    return last_valid(
        lambda: LagSearch(method=method, sampling_rate=rate, speed=speed, max_lag=max_lag), "lag.settings"
    )


def search_lag(pair: RecordingPair, search: LagSearch) -> SignalLag | None:
    """Return the lag, or None while it is being computed or if the search is refused."""
    return computed_or_refused(
        "lag",
        lambda progress: signal_lag(pair.signal_1, pair.signal_2, **search.model_dump(), seed=0, progress=progress),
        estimate_lag(pair.signal_1.size, pair.signal_2.size, method=search.method, max_lag=search.max_lag),
        **kept_for(pair, search.model_dump_json()),
        label="Sliding one recording along the other …",
    )


@fragment
def measure(pair: RecordingPair) -> None:
    """Draw the controls, compute, show and explain; moving a control reruns only this fragment."""
    controls, result_place = bench()
    with controls:
        search = ask(pair)
        prose.caption(pair.description)
    with result_place:
        result = search_lag(pair, search) if search else None
        if search is None or result is None:
            return
        LAG_ADDRESS.write(pair, {"": search})
        show_verdict(pair, result, search)
        show_parts("lag.part", PARTS, pair, result, search)


with page("Sensor lag"):
    measure(LAG_ADDRESS.recalled(choose_recordings))
    with st.expander("The source report"):
        prose.markdown(
            "Its two recordings have 176,401 samples each, at 44.1 kHz, and a lag of 50,082 samples. "
            "At 333 m/s that is 50,082 ÷ 44,100 × 333 = **378.17 m**; the report’s 378.19 m is a slip. "
            "Its sliding correlation took 1.5 to 3.5 s, its FFT 1.71 s."
        )
