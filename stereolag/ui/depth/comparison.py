"""Compare: all methods and the ground truth side by side, pixel by pixel."""

from __future__ import annotations

from functools import partial

import numpy as np
import streamlit as st

from stereolag.core.arrays import FloatMap
from stereolag.figures.differences import (
    ALL_AGREE,
    ALL_DIFFER,
    BELOW_TO_ABOVE,
    LARGEST_DIFFERENCE,
    SOME_AGREE,
    agreement_picture,
    difference_picture,
)
from stereolag.figures.legends import Legend, hexadecimal, strip_legend, word_legend
from stereolag.figures.linked_pictures import Picture, Reading
from stereolag.stereo.evaluation import consensus, evaluate
from stereolag.ui import prose
from stereolag.ui.depth.alternatives import difference_in_words
from stereolag.ui.depth.maps import TRUTH, left_picture, map_legends, map_picture, truth_picture
from stereolag.ui.depth.view import DepthView
from stereolag.ui.linked_pictures import linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.sentences import percent

KEY = "depth.comparison"


@fragment
def show_comparison(view: DepthView) -> None:
    """Show all maps in one colour range, the difference of two of them, and where the methods agree."""
    maps = {name: result.disparity for name, result in view.results.items()}
    if view.pair.truth is not None:
        maps[TRUTH] = view.pair.truth
    pictures = [left_picture(view), *(map_picture(view, name) for name in view.results), *truth_picture(view)]
    legends = list(map_legends(view))
    if len(maps) > 1:
        pictures.append(_difference(maps, legends))
    if len(view.results) > 1:
        pictures.append(_agreement(view, legends))
    linked_pictures(pictures, key=KEY, colours=view.colours, legends=legends)


def _difference(maps: dict[str, FloatMap], legends: list[Legend]) -> Picture:
    """Ask for two of the maps and return the first minus the second."""
    names = list(maps)
    with st.container(horizontal=True, vertical_alignment="center"):
        prose.markdown("Difference of", width="content")
        first = st.selectbox("Of", names, key=f"{KEY}.first", label_visibility="collapsed", width=170)
        prose.markdown("minus", width="content")
        second = st.selectbox(
            "Minus", names, index=len(names) - 1, key=f"{KEY}.second", label_visibility="collapsed", width=170
        )
    difference = maps[first] - maps[second]
    legends.append(strip_legend("difference, px", -LARGEST_DIFFERENCE, LARGEST_DIFFERENCE, BELOW_TO_ABOVE))
    return Picture(
        f"{first} − {second}",
        difference_picture(difference),
        (Reading(difference, unit="px", digits=2),),
        alternative=partial(difference_in_words, difference),
    )


def _agreement(view: DepthView, legends: list[Legend]) -> Picture:
    """Return the number of methods that agree to 1 px at each pixel, and say how far agreement can be trusted."""
    maps = [result.disparity for result in view.results.values()]
    count = len(maps)
    agreeing = consensus(maps)
    agreed = agreeing == count
    everyone = "Both methods" if count == 2 else f"All {count} methods"
    said = f"{everyone} agree to 1 px on **{percent(float(agreed.mean()))}** of the pixels."
    truth = view.pair.truth
    if truth is not None and (agreed & np.isfinite(truth)).any():
        wrong = evaluate(np.where(agreed, maps[0], np.nan), truth).bad_measured[1.0]
        alone = [evaluate(one, truth).bad_measured[1.0] for one in maps]
        said += (
            f" There, **{wrong:.1f} %** are wrong by more than 1 px; of all the pixels each method measured, "
            f"{min(alone):.1f} to {max(alone):.1f} %. Methods that work differently seldom make the same errors."
        )
    prose.markdown(said)
    some = [] if count == 2 else [(SOME_AGREE, "some agree")]
    entries = [(ALL_AGREE, "all agree to 1 px"), *some, (ALL_DIFFER, "none agree")]
    colours, meanings = zip(*entries, strict=True)
    legends.append(word_legend("agreement", [hexadecimal(colour) for colour in colours], meanings))
    words = ("no disparity", "one method alone, or all differ", *(f"{n} of {count} agree" for n in range(2, count + 1)))
    return Picture(
        "Agreement",
        agreement_picture(agreeing, count, view.pair.left),
        (Reading(agreeing, words=words),),
        alternative=lambda: f"{everyone} agree to 1 px on {percent(float(agreed.mean()))} of the pixels",
    )
