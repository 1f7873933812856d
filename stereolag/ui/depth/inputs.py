"""The pair on the depth page: an example or the visitor's own files, resized, rectified and with remedies applied."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import streamlit as st

from stereolag import samples
from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image
from stereolag.core.settings import scaled_settings
from stereolag.geometry.rectification import halves
from stereolag.io.guard import guarded
from stereolag.io.images import StoredDisparity, read_image, read_stored_disparity
from stereolag.io.sources import is_archive
from stereolag.pair import (
    DIVISORS,
    SAME_PICTURE,
    SIZES,
    Bundle,
    ChangeCode,
    Pair,
    PairId,
    assemble_pair,
    example_pair,
    likely_divisor,
    read_bundle,
)
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.streamlit_inside import BENCH_STYLE, Container, show_style
from stereolag.ui import prose
from stereolag.ui.controls import DISPARITIES_AT_FIRST, default_settings, matchers_in_use, persistent, set_controls
from stereolag.ui.depth.address import recall_choices, recall_settings, take_over
from stereolag.ui.depth.calibrating import (
    ask_calibration,
    ask_rectification,
    chosen_preparation,
    prepared,
    show_decision,
)
from stereolag.ui.depth.doctor import diagnosis_at_once, with_chosen_remedies
from stereolag.ui.depth.pair_sets import ask_bundle, forget_bundle, pair_of_bundle, show_steps
from stereolag.ui.depth.restoring import restore_settings, transferred_pair
from stereolag.ui.elements import show_refused
from stereolag.ui.keys import FOLD, FOLD_NEXT, PAIR
from stereolag.ui.results import computed
from stereolag.ui.sentences import started_in_words
from stereolag.ui.uploads import (
    DISPARITY_TYPES,
    OWN,
    PICTURE_TYPES,
    Upload,
    choose,
    forget_together,
    image_limits,
    own_or_example,
    put_together,
    refused,
    show_limits,
    upload,
)

KEY = PAIR
TITLE = "Depth maps"
STYLE = Path(__file__).with_name("bench.css")
KEPT = f"{KEY}.kept_settings"
"""Session-state key of the images that the settings in use are for."""
SCALED_FROM = f"{KEY}.scaled_from"
"""Session-state key of {kind of settings: how they were last :class:`Scaled`}."""
OWN_PAIR_THERE = f"{KEY}.there"


INTRODUCTION = (
    "Near things shift more between the two cameras than far ones. Cut the left image into small windows and slide each"
    " along the right image: the lag of the best match is its disparity, large for near things and small for far ones."
)


@contextmanager
def head(title: str, *, awaited: bool) -> Iterator[Container]:
    """Draw the heading beside an expander; the choice of the pair is drawn inside the ``with`` block.

    The expander stays open while files are `awaited`, and closes when they are there. The container yielded,
    between the two, is for :func:`show_name` once the pair is known.
    """
    show_style(STYLE, BENCH_STYLE)
    if awaited or st.session_state.pop(FOLD_NEXT, False):
        st.session_state[FOLD] = awaited
    with st.container(horizontal=True, vertical_alignment="top", gap="medium", key="depth-head"):
        st.title(title, anchor=False, width="content")
        name = st.container(width="content", key="depth-head-pair")
        # Changing the label would redraw the expander and take the keyboard focus from the controls inside.
        with st.expander(
            "Choose a pair or bring your own",
            key=FOLD,
            icon=":material/photo_library:",
            on_change="rerun",
        ):
            prose.markdown(INTRODUCTION, width=760)
            yield name


def show_name(place: Container, pair: str) -> None:
    """Show the name of the pair whose maps are shown."""
    with place:
        prose.markdown(f"**{pair}**", width="content")


@dataclass(frozen=True)
class Scaled:
    """Settings scaled with the images, the original settings, and the divisor of the image sides for the latter."""

    settings: StereoMatcher
    first: StereoMatcher
    divisor: float


def choose_pair() -> Pair:
    """Ask for the pair and its size; return it ready for matching, and show the changes made to it.

    Settings from the address, or handed over by a part of the page, are set in the controls, which must therefore be
    drawn after this.
    """
    recall_choices()
    examples = samples.stereo_pairs()
    awaited = st.session_state.get(KEY) == OWN and not st.session_state.get(OWN_PAIR_THERE)
    with head(TITLE, awaited=awaited) as name_place:
        choices = st.container(horizontal=True, vertical_alignment="bottom", gap="medium")
        with choices:
            chosen = choose(examples, key=KEY)

        def ask() -> Pair | None:
            own = ask_own_pair()
            if own is not None or refused():
                show_name(name_place, "Your own pair")
            return own

        def load(name: str) -> Pair:
            show_name(name_place, examples[name].title)
            return example_pair(examples[name])

        pair = own_or_example(chosen, ask, load, examples, key=KEY, awaited="both images are")
        st.session_state[OWN_PAIR_THERE] = not pair.shared
        with choices:
            divisor = _ask_divisor_of_sides()
        ask_rectification(pair.calibration, KEY)
        pair = with_initial_range(with_chosen_remedies(prepared(pair, chosen_preparation(KEY, divisor))))
        _keep_settings(pair)
        prose.caption(pair.description)
    if st.session_state.get(FOLD_NEXT):
        st.rerun()
    told = [change.sentence for change in pair.changes if change.code in (ChangeCode.ASSEMBLED, ChangeCode.RESIZED)]
    if told:
        prose.caption(" ".join(told))
    show_decision(pair, KEY)
    show_start(pair)
    show_steps(pair)
    recall_settings(pair)
    take_over(pair)
    restore_settings(pair)
    return pair


def _ask_divisor_of_sides() -> int | None:
    """Ask for the size to match at; return the divisor of the sides of the images, None to suit the pair."""
    chosen = st.segmented_control(
        "Size",
        [*SIZES],
        default="Automatic",
        required=True,
        **persistent(f"{KEY}.size"),
        help="Half the size takes an eighth of the time. Search range, windows, focal length and ground truth change "
        "with the images. Automatic is full size up to a megapixel.",
    )
    return SIZES[chosen]


def original(pair: Pair) -> Pair:
    """Return the pair at its own size, with all changes made to the smaller one."""
    if pair.full is None:
        return pair
    return prepared(pair.full, replace(chosen_preparation(KEY), remedies=pair.id.remedies))


def _keep_settings(pair: Pair) -> None:
    """Keep the settings in use if the images are the same at another size, or another pair of the same set.

    They are scaled to cover the same part of the images. Settings not changed since the last scaling are scaled from
    the originals: sizes are rounded only once, and are the same again at the same size.
    """
    full = pair.full or pair
    now = pair.id.chosen, full.left.shape[1] / pair.left.shape[1], pair.id.searched
    before = st.session_state.get(KEPT)
    st.session_state[KEPT] = now
    if before is None or before[0] != now[0]:
        st.session_state[SCALED_FROM] = {}
        return
    if before == now:
        return
    origins: dict[type[StereoMatcher], Scaled] = st.session_state[SCALED_FROM]
    for matcher in matchers_in_use():
        origin = origins.get(type(matcher))
        if origin is None or origin.settings != matcher:
            origin = Scaled(matcher, matcher, before[1])
        try:
            scaled = scaled_settings(origin.first, origin.divisor / now[1])
        except ValueError as error:
            show_refused(f"The settings could not be scaled with the images. {error}")
        else:
            set_controls(scaled, pair)
            origins[type(matcher)] = replace(origin, settings=scaled)


# The visitor’s own pair

ARRANGEMENTS = {"files": "Left and right files", "beside": "One side-by-side image", "several": "ZIP or several pairs"}


@dataclass(frozen=True, eq=False)
class Pictures:
    """Two images as given, a digest of their files, and sentences about the changes made to them."""

    left: Image
    right: Image
    digest: str
    notes: tuple[str, ...] = ()


def ask_own_pair() -> Pair | None:
    """Ask for images, truth and calibration; return the last pair that fitted together, or None until there is one.

    An archive in place of the left image contains all of these: a saved session, or several pairs.
    """
    transferred = transferred_pair()
    if transferred is not None:
        return transferred
    arrangement = st.segmented_control(
        "Images",
        [*ARRANGEMENTS],
        default="files",
        format_func=lambda name: ARRANGEMENTS[name],
        required=True,
        **persistent(f"{KEY}.arrangement"),
        label_visibility="collapsed",
    )
    if arrangement == "several":
        bundle = ask_bundle()
        show_limits(image_limits())
        return pair_of_bundle(bundle)
    columns = st.columns([2, 1], gap="medium")
    with columns[0]:
        found = _ask_one_picture() if arrangement == "beside" else _ask_two_pictures()
    if isinstance(found, Upload):
        return pair_of_bundle(found)
    forget_bundle()
    pictures = found
    with columns[1]:
        truth = _ask_truth(pictures)
    show_limits(image_limits())
    calibration = ask_calibration(KEY)
    if pictures is None:
        forget_together(f"{KEY}.own.{arrangement}")
        return None

    def assemble() -> Pair:
        return assemble_pair(
            pictures.left,
            pictures.right,
            None if truth is None else truth.content,
            None if calibration is None else calibration.content,
            id=PairId(pictures.digest, truth.digest if truth else ""),
            notes=pictures.notes,
        )

    return put_together(assemble, f"{KEY}.own.{arrangement}")


def _ask_two_pictures() -> Pictures | Upload[Bundle] | None:
    columns = st.columns(2, gap="medium")
    with columns[0]:
        left = upload(
            "Left image",
            _picture_or_bundle,
            key=f"{KEY}.left",
            types=(*PICTURE_TYPES, "zip"),
            note="Or a ZIP: one saved from this page, or several pairs.",
        )
    if left is not None and not isinstance(left.content, np.ndarray):
        return Upload(left.digest, left.content)
    with columns[1]:
        right = upload("Right image", guarded(read_image), key=f"{KEY}.right", types=PICTURE_TYPES)
    if left is None or right is None:
        return None
    assert isinstance(left.content, np.ndarray)
    notes = (SAME_PICTURE,) if left.digest == right.digest else ()
    return Pictures(left.content, right.content, f"{left.digest} {right.digest}", notes)


def _picture_or_bundle(data: bytes) -> Image | Bundle:
    return read_bundle([("", data)]) if is_archive(data) else guarded(read_image)(data)


def _ask_one_picture() -> Pictures | None:
    both = upload(
        "Both images side by side",
        _split_picture,
        key=f"{KEY}.beside",
        types=PICTURE_TYPES,
        note="The left image in the left half, as stereo cameras deliver them.",
    )
    return None if both is None else replace(both.content, digest=both.digest)


def _split_picture(data: bytes) -> Pictures:
    """Return both halves of a side-by-side image, without a digest; raise ValueError if it cannot be read or halved."""
    both = guarded(read_image)(data)
    left, right = halves(both)
    width = both.shape[1]
    odd = f" Its width of {width} px is odd: the middle column is left out." if width % 2 else ""
    return Pictures(left, right, "", (f"The image was split down the middle.{odd}",))


def _ask_truth(pictures: Pictures | None) -> Upload[FloatMap] | None:
    """Ask for the ground truth of the left image; the default divisor of 8-bit values is the one that fits the pair."""
    given = upload(
        "Ground truth (optional)",
        guarded(read_stored_disparity),
        key=f"{KEY}.truth",
        types=DISPARITY_TYPES,
        note="PFM, NPY, or PNG of 16 bits (px × 256, as KITTI’s) or of 8 bits, whose divisor is found from the pair.",
    )
    divisor = st.session_state.get(f"{KEY}.divisor")
    unsure = given is not None and given.content.divisor is None and pictures is not None and divisor is None
    if unsure:
        assert given is not None
        assert pictures is not None
        divisor = _ask_divisor_of_truth(given, pictures)
    st.number_input(
        "Another divisor" if unsure else "Divisor of the ground truth",
        min_value=0.001,
        value=None,
        **persistent(f"{KEY}.divisor"),
        placeholder="as chosen" if unsure else "as the file says",
        help="Stored value ÷ divisor = px.",
    )
    if given is None or pictures is None:
        return None
    divisor = divisor or given.content.divisor or 1.0
    try:
        return Upload(f"{given.digest} {divisor:g}", given.content.divided(divisor))
    except ValueError as error:
        show_refused(error)
        return None


def _ask_divisor_of_truth(truth: Upload[StoredDisparity], pictures: Pictures) -> float:
    """Ask for the divisor of 8-bit values; the default is the one that agrees best with a quick map of the pair."""
    stored = truth.content
    likely = computed(
        "divisor",
        lambda progress: np.array(likely_divisor(stored.divided(1.0), pictures.left, pictures.right)),
        inputs=f"{pictures.digest} {truth.digest}",
        settings="",
        shared=False,
        label="Comparing the ground truth with the pair …",
    )
    largest = int(stored.stored.max())
    return float(
        st.segmented_control(
            "8 bits per pixel: stored value ÷ divisor = px",
            DIVISORS,
            default=int(likely),
            format_func=lambda divisor: f"÷ {divisor}: up to {largest / divisor:.4g} px",
            required=True,
            **persistent(f"{KEY}.divisor.{truth.digest[:16]}.{pictures.digest[:16]}"),
            help="The preselected one agrees best with a quick map of the pair.",
        )
    )


# The initial settings


@dataclass(frozen=True)
class Start:
    """The initial range of a pair, px, and the initial settings of all methods, for images of this width, px.

    Attributes
    ----------
    found
        Whether the range was determined, not assumed.
    """

    min_disparity: int
    num_disparities: int
    found: bool
    settings: tuple[StereoMatcher, ...]
    width: int

    def range_at(self, width: int) -> tuple[int, int]:
        """Return the first disparity and the number of disparities at another width."""
        share = width / self.width
        return math.floor(self.min_disparity * share), math.ceil(self.num_disparities * share)


def with_initial_range(pair: Pair) -> Pair:
    """Return the visitor's own pair with its initial range; for a new pair, set the controls to the initial settings.

    The range is that of its calibration, or the one the doctor found. Files added to the images later do not change
    it. The controls must not have been drawn yet.
    """
    if pair.shared:
        return pair
    start: Start | None = st.session_state.get(_key(pair))
    width = int(pair.left.shape[1])
    if start is None:
        if pair.num_disparities is None and diagnosis_at_once(pair) is None:
            return pair  # still being examined
        found = _range_of(pair)
        first, count = found or (0, DISPARITIES_AT_FIRST)
        begun = replace(pair, min_disparity=first, num_disparities=count)
        settings = tuple(default_settings(kind, begun) for kind in METHODS)
        _set_all(settings, begun)
        st.session_state[_key(pair)] = start = Start(first, count, found is not None, settings, width)
        st.session_state[FOLD_NEXT] = True
    first, count = start.range_at(width)
    return replace(pair, min_disparity=first, num_disparities=count)


def show_start(pair: Pair) -> None:
    """Show the initial settings of the pair while they are in use, and offer to undo them."""
    start: Start | None = st.session_state.get(_key(pair))
    if pair.shared or start is None or not start.found or not set(matchers_in_use()) <= set(start.settings):
        return
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.caption(
            f":material/auto_fix_high: {started_in_words(start.min_disparity, start.num_disparities)}", width="content"
        )
        st.button("Undo these settings", key="depth.start.undo", type="tertiary", on_click=partial(_undo, pair))


def _undo(pair: Pair) -> None:
    """Set the controls as for a pair about which nothing is known."""
    _set_all(tuple(kind().with_search_range(0, DISPARITIES_AT_FIRST) for kind in METHODS), pair)


def _set_all(settings: tuple[StereoMatcher, ...], pair: Pair) -> None:
    for matcher in settings:
        set_controls(matcher, pair)


def _range_of(pair: Pair) -> tuple[int, int] | None:
    """Return the first disparity and the number of disparities; None if unknown."""
    if pair.num_disparities is not None:
        return pair.min_disparity, pair.num_disparities
    diagnosis = diagnosis_at_once(pair)
    return None if diagnosis is None else diagnosis.suggested_range


def _key(pair: Pair) -> str:
    return f"{KEY}.start.{pair.id.chosen}"
