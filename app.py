"""Home page: the three measurements, each with a result computed on the spot; the first can be moved by hand."""

from collections.abc import Callable

import streamlit as st

from stereolag import CorrelationMatcher, match_template, samples, signal_lag
from stereolag.figures.maps import image_into_map
from stereolag.figures.pictures import disparity_range
from stereolag.figures.templates import match_close_up
from stereolag.figures.verdicts import place
from stereolag.pair_sources import example_pair
from stereolag.ui import prose, streams
from stereolag.ui.depth.maps import map_task
from stereolag.ui.depth.sentences import map_in_words
from stereolag.ui.elements import in_columns, show_picture
from stereolag.ui.lag.inputs import example_recordings
from stereolag.ui.lag.panels import slide_by_hand
from stereolag.ui.matcher_controls import default_settings
from stereolag.ui.navigation import head, page
from stereolag.ui.results import computed
from stereolag.ui.search.inputs import example_pictures


def show_lag() -> None:
    """Let the first example recordings be slid by hand."""
    pair = example_recordings("coast")
    result = computed(
        "lag",
        lambda progress: signal_lag(pair.signal_1, pair.signal_2, sampling_rate=44_100, speed=333, progress=progress),
        inputs=pair.digest,
        settings="home",
        shared=True,
        label="Comparing two recordings …",
    )
    slide_by_hand(pair, result, small=True)
    prose.markdown(
        f"Two recordings of one beach. Drag the snippet: it fits at a lag of **{result.lag:,} samples**, so the path "
        f"to sensor 2 is **{result.distance_m:,.2f} m** longer."
    )


def show_search() -> None:
    """Show the match found in the first maze."""
    pictures = example_pictures("maze")
    result = computed(
        "template search",
        lambda progress: match_template(pictures.picture, pictures.template, method="sampled", seed=0),
        inputs=pictures.digest,
        settings="home",
        shared=True,
        label="Looking for Rocketman …",
    )
    best = result.matches[0]
    rows, cols = pictures.picture.shape[:2]
    show_picture(match_close_up(pictures.picture, best), f"Rocketman in the crowd, framed: {place(best)}")
    prose.markdown(
        f"An image of {cols:,} × {rows:,} pixels full of people in his colours. Rocketman is at row **{best.row}**, "
        f"column **{best.col}**."
    )


def show_depth() -> None:
    """Show the depth map of one example pair."""
    pair = example_pair(samples.stereo_pairs()["cube"])
    matcher = default_settings(CorrelationMatcher, pair)
    result = computed(
        map_task(matcher),
        lambda progress: matcher.compute(pair.left, pair.right, progress=progress),
        inputs=pair.digest,
        settings=matcher.model_dump_json(),
        shared=True,
        label="Matching windows …",
    )
    low, high = disparity_range([result.disparity if pair.truth is None else pair.truth])
    alt = map_in_words(result.disparity, "A photograph of a puzzle cube that turns into its disparity map")
    show_picture(image_into_map(pair.left, result.disparity, low, high), alt)
    prose.markdown(
        f"Two cameras look at a puzzle cube. **{result.valid.sum():,} windows** of one image were found in the "
        "other: those that shifted most, the bright ones, are the nearest."
    )


MEASUREMENTS: dict[str, tuple[Callable[[], None], str, str]] = {
    "How far apart are two sensors?": (show_lag, "pages/1_Sensor_lag.py", "Sensor lag"),
    "Where is Rocketman?": (show_search, "pages/2_Rocketman_search.py", "Rocketman search"),
    "How far away is everything?": (show_depth, "pages/3_Depth_maps.py", "Depth maps"),
}

# The other pages: file, name, and a sentence about each.
MORE_PAGES = (
    (
        "pages/5_Driving.py",
        "Driving",
        "**A whole drive**: its depth maps side by side as they are computed. How far away is the car in front?",
    ),
    (
        "pages/4_Calibrate.py",
        "Calibrate",
        "**Your own stereo camera**, from pictures of a chessboard to depth in metres.",
    ),
)


def show_home() -> None:
    """Show the three measurements and the way to the other pages."""
    with page("Slide, multiply, find the peak"):
        with head("Slide, multiply, find the peak"):
            prose.markdown(
                "Lay one thing over another, multiply, add up; slide by one step and do it again. Where the sum is "
                "largest the two agree, and the distance you slid is the **lag**. **stereolag** measures three things "
                "this way."
            )
        for question, (show, path, name) in in_columns(MEASUREMENTS.items()):
            with st.container(border=True, height="stretch"):
                prose.markdown(f"## {question}")
                show()
                st.page_link(path, label=f"Open {name}", icon=":material/arrow_forward:")
        for path, name, sentence in in_columns(MORE_PAGES):
            with st.container(border=True, height="stretch"):
                prose.markdown(sentence)
                st.page_link(path, label=f"Open {name}", icon=":material/arrow_forward:")
        st.space("small")
        prose.markdown(
            "Everything here was computed by this app. Each page comes with examples, takes your own files, and lets "
            "you change every setting. Your files stay in this session: nothing is written to disk or shown to anyone "
            "else.",
            width=760,
        )


if __name__ == "__main__":
    show_home()
else:  # imported by the server, which runs this file and the pages as scripts
    app = st.App(__file__, routes=streams.routes())
