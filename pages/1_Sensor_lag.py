"""The lag between two recordings: how much later the sound reaches one sensor, and how much longer its path is."""

import streamlit as st

from stereolag.core.searches import LagSearch
from stereolag.figures import recordings as figures
from stereolag.signals import SignalLag, estimate_lag, signal_lag
from stereolag.signals.correlation import overlap_slices
from stereolag.ui import prose
from stereolag.ui.controls import control, last_valid
from stereolag.ui.inputs import LAG_ADDRESS, RecordingPair, choose_recordings, player
from stereolag.ui.lag.comparison import compare_methods
from stereolag.ui.lag.panels import see_why
from stereolag.ui.lag.result import lined_up, show_curve, show_lag_files, show_over_time, show_verdict
from stereolag.ui.lag.sentences import aligned_in_words, close_up_in_words, waveforms_in_words
from stereolag.ui.navigation import fragment, page
from stereolag.ui.results import computed_or_refused
from stereolag.ui.sentences import LAG_METHODS, LAG_METHODS_EXPLAINED


def listen(pair: RecordingPair, search: LagSearch) -> None:
    """Show both recordings, each with a player."""
    prose.header("The recordings", anchor=False)
    signals = pair.signal_1, pair.signal_2, search.sampling_rate
    st.plotly_chart(figures.waveforms(*signals), key="waveforms", alt=waveforms_in_words(*signals))
    for column, signal, name in zip(st.columns(2, gap="medium"), (pair.signal_1, pair.signal_2), "12", strict=True):
        with column:
            player(signal, search.sampling_rate, f"sensor {name}")


def ask(pair: RecordingPair) -> LagSearch | None:
    """Return the search settings, or None if they are refused."""
    method = control(LagSearch, "method", key="lag.method", names=LAG_METHODS)
    prose.caption(LAG_METHODS_EXPLAINED[method])
    columns = st.columns(3, gap="medium")
    with columns[0]:
        rate = control(LagSearch, "sampling_rate", key=f"lag.rate.{pair.digest}", value=pair.sampling_rate)
    with columns[1]:
        speed = control(LagSearch, "speed", key=f"lag.speed.{pair.digest}", value=pair.speed)
    with columns[2]:
        max_lag = control(
            LagSearch, "max_lag", key=f"lag.max.{pair.digest}", high=pair.longest_lag, when_empty="every lag"
        )
    return last_valid(
        lambda: LagSearch(method=method, sampling_rate=rate, speed=speed, max_lag=max_lag), "lag.settings"
    )


def show(pair: RecordingPair, result: SignalLag, search: LagSearch) -> None:
    """Show the correlation, the lag over time, and both recordings with the lag removed."""
    second, lag = lined_up(pair, result)
    if result.over_time is None:
        show_curve(pair, result, search)
    else:
        left, right = st.columns(2, gap="large")
        with left:
            show_curve(pair, result, search)
        with right:
            show_over_time(result.over_time, search)
    left, right = st.columns(2, gap="large")
    with left:
        prose.markdown("### Shifted to line up")
        both = figures.aligned(pair.signal_1, second, lag, search.sampling_rate)
        st.plotly_chart(both, key="aligned", alt=aligned_in_words(result))
    with right:
        shared, _ = overlap_slices(pair.signal_1.size, second.size, lag)
        prose.markdown(f"### Up close: {min(figures.CLOSE_UP_SAMPLES, shared.stop - shared.start)} samples of both")
        start, highest = shared.start, shared.stop - figures.CLOSE_UP_SAMPLES
        if start < highest:
            liveliest = figures.liveliest_start(pair.signal_1, shared)
            start = st.slider("From sample", start, highest, liveliest, key=f"lag.from.{pair.digest}.{result.lag}")
        close_up = figures.close_up(pair.signal_1, second, lag, start)
        st.plotly_chart(close_up, key="close_up", alt=close_up_in_words(lag, start))


def search_lag(pair: RecordingPair, search: LagSearch) -> SignalLag | None:
    """Return the lag, or None while it is being computed or if the search is refused."""
    return computed_or_refused(
        "lag",
        lambda progress: signal_lag(pair.signal_1, pair.signal_2, **search.model_dump(), seed=0, progress=progress),
        estimate_lag(pair.signal_1.size, pair.signal_2.size, method=search.method, max_lag=search.max_lag),
        inputs=pair.digest,
        settings=search.model_dump_json(),
        shared=pair.shared,
        label="Sliding one recording along the other …",
    )


@fragment
def measure(pair: RecordingPair) -> None:
    """Draw the controls, compute, show and explain; moving a control reruns only this fragment."""
    search = ask(pair)
    result = search_lag(pair, search) if search else None
    if search:
        LAG_ADDRESS.write(search, pair)
    if search and result:
        show_verdict(pair, result, search)
        show(pair, result, search)
        listen(pair, search)
        show_lag_files(pair, result, search)
        compare_methods(pair, search)
    see_why(pair, result, search)


with page(
    "Sensor lag",
    "Two sensors record the same sound. Slide one recording along the other, multiply, add up: where the sum peaks, "
    "the two agree. That lag is how much later one hears it, and with the speed of sound, how much longer its path is.",
    "take the harbour instead of the coast; then [slide two recordings by hand](#see-why).",
):
    recordings = LAG_ADDRESS.recalled(choose_recordings)
    prose.caption(recordings.description)
    measure(recordings)
    with st.expander("The source report"):
        prose.markdown(
            "Its two recordings have 176,401 samples each, at 44.1 kHz, and a lag of 50,082 samples. "
            "At 333 m/s that is 50,082 ÷ 44,100 × 333 = **378.17 m**; the report’s 378.19 m is a slip. "
            "Its sliding correlation took 1.5 to 3.5 s, its FFT 1.71 s."
        )
