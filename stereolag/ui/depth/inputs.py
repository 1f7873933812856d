"""The pair on the depth page: an example, own files, one of a set, or handed over; resized, rectified and mended."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import streamlit as st

from stereolag import samples
from stereolag.assess.layout import Layout
from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image
from stereolag.core.jobs import silent
from stereolag.core.settings import scaled_settings
from stereolag.io.calibrations import CALIBRATION_SUFFIXES
from stereolag.io.disparities import DISPARITY_SUFFIXES, StoredDisparity, read_stored_disparity
from stereolag.io.ground_truth import DIVISORS, TruthFit, divisor_in_words, halved_truth, stored_truth_fit
from stereolag.io.guard import guarded
from stereolag.io.images import IMAGE_SUFFIXES, Frame, read_frame
from stereolag.io.sessions import Session
from stereolag.io.sources import is_archive
from stereolag.pair import (
    SAME_PICTURE,
    SIZES,
    Bundle,
    ChangeCode,
    OneView,
    Pair,
    PairId,
    PairSet,
    Preparation,
    assemble_pair,
    example_pair,
    likely_views,
    read_bundle,
    read_views,
    session_pair,
)
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import prose
from stereolag.ui.controls import persistent
from stereolag.ui.depth.live import LiveCamera, ask_layout
from stereolag.ui.depth.preparing import (
    ask_calibration,
    ask_rectification,
    chosen_preparation,
    chosen_remedies,
    prepared,
    show_decision,
    show_start,
    with_initial_range,
)
from stereolag.ui.depth.state import recall_pair_and_maps, recall_settings, restore
from stereolag.ui.depth.view import FOLD, FOLD_NEXT, HANDED, PAIR, SIZE
from stereolag.ui.elements import refusals_shown, show_note, show_offer
from stereolag.ui.matcher_controls import matchers_in_use, set_controls
from stereolag.ui.navigation import FOLD_WIDTH, head, show_try_first
from stereolag.ui.results import Refusal, attempted, computed, remembered
from stereolag.ui.streamlit_inside import Container
from stereolag.ui.uploads import (
    LIVE,
    OWN,
    Upload,
    choose,
    frame_names,
    image_limits,
    own_or_example,
    put_together,
    refuse,
    show_limits,
    upload,
    upload_named,
    upload_part,
    upload_picture,
)

KEPT = f"{PAIR}.kept_settings"
"""Session-state key of the :class:`Kept` settings."""
OWN_PAIR_THERE = f"{PAIR}.there"
SET = f"{PAIR}.set"
"""Session-state key of the set of pairs in use, if there is one."""
STEP = f"{PAIR}.step"
"""Session-state key of the index of the pair shown, from 0, in its set."""
RESTORED_PAIR = f"{PAIR}.restored"
"""Session-state key of the digest of the session restored last."""

LIVE_TITLE = "Live camera"


def choose_pair() -> Pair | LiveCamera:
    """Ask for the pair and its size; return it ready for matching, and show the changes made to it.

    A live camera has no pair until a frame is frozen.

    Settings from the address, or handed over by a part of the page, are set in the controls, which must therefore be
    drawn after this.
    """
    recall_pair_and_maps()
    examples = samples.stereo_pairs()
    awaited = st.session_state.get(PAIR) == OWN and not st.session_state.get(OWN_PAIR_THERE)
    if awaited or st.session_state.pop(FOLD_NEXT, False):  # open while files are awaited, closed when they are there
        st.session_state[FOLD] = awaited
    live = st.session_state.get(PAIR) == LIVE
    if live and st.session_state.get(f"{PAIR}.live") is False:  # it needs no files: its maps have the room
        st.session_state[FOLD] = False
    st.session_state[f"{PAIR}.live"] = live
    with head("Depth maps") as line:
        place = st.empty()
        # Changing the label would redraw the expander and take the keyboard focus from the controls inside.
        fold = st.expander(
            "Choose a pair or bring your own",
            key=FOLD,
            icon=":material/photo_library:",
            on_change="rerun",
            width=FOLD_WIDTH,
        )

    notes = st.container(horizontal=True, vertical_alignment="center", gap="small", key="depth-notes")

    def load(name: str) -> Pair:
        place.markdown(f"**{examples[name].title}**", width="content")
        return example_pair(examples[name])

    with fold:
        prose.markdown(
            "Near things shift more between the two cameras than far ones. Cut the left image into small windows and "
            "slide each along the right image: the lag of the best match is its disparity, large for near things and "
            "small for far ones.",
            width=760,
        )
        choices = st.container(horizontal=True, vertical_alignment="bottom", gap="medium")
        with choices:
            chosen = choose(examples, key=PAIR, live=LIVE_TITLE)
        if chosen == LIVE:
            place.markdown(f"**{LIVE_TITLE}**", width="content")
            more = line.expander("Calibration", icon=":material/add:", width=FOLD_WIDTH)
            with notes:
                return LiveCamera(ask_calibration(PAIR, more))
        if chosen == OWN:  # until an example is shown in its place
            place.markdown("**Your own pair**", width="content")
        pair = own_or_example(
            chosen,
            partial(ask_own_pair, line, notes),
            load,
            examples,
            key=PAIR,
            awaited="both images are",
            notes=notes,
        )
        st.session_state[OWN_PAIR_THERE] = not pair.shared
        with choices:
            st.segmented_control(
                "Size",
                [*SIZES],
                default="Automatic",
                required=True,
                **persistent(SIZE),
                help="Half the size takes an eighth of the time. Search range, windows, focal length and ground truth "
                "change with the images. Automatic is full size up to a megapixel.",
            )
        ask_rectification(pair.calibration, PAIR)
        pair = prepared(pair, preparation_of_sets())
        pair = with_initial_range(prepared(pair, Preparation(remedies=chosen_remedies(pair.id.untreated))))
        _keep_settings(pair)
        prose.caption(pair.description)
    if st.session_state.get(FOLD_NEXT):
        st.rerun()
    if pair.shared:
        with line:
            show_try_first("make the windows smaller or larger; then [ask why](#look-closer) a pixel got its match.")
    with notes:
        for change in pair.changes:
            if change.code in (ChangeCode.ASSEMBLED, ChangeCode.RESIZED, ChangeCode.TURNED):
                show_note(change.sentence)
        show_decision(pair, PAIR)
        show_start(pair)
        pairs = set_of(pair.id)
        if pairs is not None and len(pairs) > 1:
            _ask_step(pairs)
    recall_settings(pair)
    return pair


def original(pair: Pair) -> Pair:
    """Return the pair at its own size, with all changes made to the smaller one."""
    if pair.full is None:
        return pair
    return prepared(pair.full, replace(chosen_preparation(PAIR), remedies=pair.id.remedies))


@dataclass(frozen=True)
class Kept:
    """The images that the settings in use are for, and {kind of settings: (settings, before scaling, at divisor)}.

    Attributes
    ----------
    images
        The visitor's choice, the divisor of the sides of its images, and the key of the two images.
    scaled
        The settings as last scaled with the images, the original ones, and the divisor for the latter.
    """

    images: tuple[str, float, str]
    scaled: dict[type[StereoMatcher], tuple[StereoMatcher, StereoMatcher, float]] = field(default_factory=dict)


def _keep_settings(pair: Pair) -> None:
    """Keep the settings in use if the images are the same at another size, or another pair of the same set.

    They are scaled to cover the same part of the images. Settings not changed since the last scaling are scaled from
    the originals: sizes are rounded only once, and are the same again at the same size.
    """
    divisor = (pair.full or pair).left.shape[1] / pair.left.shape[1]
    now = pair.id.chosen, divisor, pair.id.searched
    before: Kept | None = st.session_state.get(KEPT)
    kept = st.session_state[KEPT] = Kept(now, before.scaled if before and before.images[0] == now[0] else {})
    if before is None or before.images[0] != now[0] or before.images == now:
        return
    for matcher in matchers_in_use():
        last, first, at = kept.scaled.get(type(matcher), (None, matcher, before.images[1]))
        if last != matcher:
            first, at = matcher, before.images[1]
        with refusals_shown("The settings could not be scaled with the images. {}"):
            scaled = scaled_settings(first, at / divisor)
            set_controls(scaled, pair)
            kept.scaled[type(matcher)] = scaled, first, at


# The visitor’s own pair

ARRANGEMENTS = {"files": "Left and right files", "beside": "One image with both", "several": "Files at once, or a ZIP"}


@dataclass(frozen=True, eq=False)
class Pictures:
    """Two images as given, a digest of their files, and sentences about the changes made to them."""

    left: Image
    right: Image
    digest: str
    notes: tuple[str, ...] = ()


def ask_own_pair(line: Container, notes: Container) -> Pair | None:
    """Ask for images, truth and calibration; return the last pair that fitted together, or None until there is one.

    The images are asked for here; what else belongs to them in a fold of the page's first `line`, which stays when the
    images are there. `notes` say what is known. An archive in place of the left image contains all of these: a saved
    session, or several pairs. A pair that another page transferred stands in for all files.
    """
    transferred: Pair | None = st.session_state.get(HANDED)
    if transferred is not None:
        show_offer(
            f"In use: {transferred.description}",
            "Use other files",
            f"{HANDED}.forget",
            partial(st.session_state.pop, HANDED, None),
        )
        return transferred
    arrangement = st.segmented_control(
        "Images",
        [*ARRANGEMENTS],
        default="files",
        format_func=ARRANGEMENTS.__getitem__,
        required=True,
        **persistent(f"{PAIR}.arrangement"),
        label_visibility="collapsed",
    )
    if arrangement == "several":
        bundle = upload_named(
            "Left and right images at once, those of several pairs, or a ZIP of them",
            read_bundle,
            key=f"{PAIR}.several",
            types=tuple(dict.fromkeys((*IMAGE_SUFFIXES, "zip", *DISPARITY_SUFFIXES, *CALIBRATION_SUFFIXES))),
            note="A ZIP saved from this page reopens it as it was. Otherwise, left and right images, ground truths "
            "and calibrations are matched by name and folder.",
        )
        show_limits(image_limits())
        return _pair_of_bundle(bundle)
    found = _ask_one_picture() if arrangement == "beside" else _ask_two_pictures()
    show_limits(image_limits())
    if isinstance(found, Upload):
        return _pair_of_bundle(found)
    _pair_of_bundle(None)
    more = line.expander("Ground truth, calibration", icon=":material/add:", width=FOLD_WIDTH)
    with more:
        truth = _ask_truth(found)
    with notes:
        calibration = ask_calibration(PAIR, more)
    if found is None:
        return put_together(None, f"{PAIR}.own.{arrangement}")
    make = partial(
        assemble_pair,
        found.left,
        found.right,
        None if truth is None else truth.content,
        calibration,
        id=PairId(found.digest, truth.digest if truth else ""),
        notes=found.notes,
    )
    return put_together(make, f"{PAIR}.own.{arrangement}")


def _ask_two_pictures() -> Pictures | Upload[Bundle] | None:
    def picture_or_bundle(data: bytes, frame: int) -> Frame | Bundle:
        return read_bundle([("", data)]) if is_archive(data) else guarded(read_frame)(data, frame)

    columns = st.columns(2, gap="medium")
    with columns[0]:
        left = upload_part(
            "Left image",
            picture_or_bundle,
            frame_names,
            "Frame",
            key=f"{PAIR}.left",
            types=(*IMAGE_SUFFIXES, "zip"),
            note="Or a ZIP: one saved from this page, or several pairs.",
        )
    if left is not None and not isinstance(left.content, Frame):
        return Upload(left.digest, left.content)
    with columns[1]:
        right = upload_picture("Right image", key=f"{PAIR}.right")
    if left is None:
        return None
    assert isinstance(left.content, Frame)
    if right is None:
        return _both_in(left.content.pixels, left.digest)
    return Pictures(
        left.content.pixels,
        right.content,
        f"{left.digest} {right.digest}",
        (SAME_PICTURE,) if left.digest == right.digest else (),
    )


def _both_in(image: Image, digest: str) -> Pictures | None:
    """Return both views of a picture given as the left one, if it holds them; otherwise the right one is awaited."""

    def views_of(_: object) -> Pictures:
        left, right, said = likely_views(image)
        return Pictures(left, right, digest, (said,))

    views_or_why_not = partial(attempted(views_of), silent)  # one view, or an anaglyph
    found = remembered("both views", views_or_why_not, inputs=digest, settings="", shared=False)
    return None if isinstance(found, Refusal) else found


def _ask_one_picture() -> Pictures | None:
    layout = ask_layout(PAIR)

    def split(data: bytes) -> tuple[Image, Image, str]:
        try:
            return read_views(data, layout, guard=guarded)
        except OneView:
            return read_views(data, Layout.BESIDE, guard=guarded)

    both = upload(
        "Both images in one",
        split,
        key=f"{PAIR}.beside",
        types=IMAGE_SUFFIXES,
        note="One beside or above the other, or an MPO or HEIC, as stereo cameras and phones deliver them.",
        variant=layout and f" {layout}",
    )
    if both is None:
        return None
    left, right, note = both.content
    return Pictures(left, right, both.digest, (note,))


def _ask_truth(pictures: Pictures | None) -> Upload[FloatMap] | None:
    """Ask for the ground truth of the left image; the default divisor is the one that fits the pair."""
    given = upload(
        "Ground truth (optional)",
        guarded(read_stored_disparity),
        key=f"{PAIR}.truth",
        types=DISPARITY_SUFFIXES,
        note="PFM, TIFF, NPY, NPZ, MAT, or PNG of 16 bits (px × 256, as KITTI’s), of Sintel’s colours, or of 8 bits, "
        "whose divisor is found from the pair.",
    )
    divisor: float | None = st.session_state.get(f"{PAIR}.divisor")
    fit = likely = None
    if given is not None and pictures is not None and divisor is None:
        fit = _fit_of_truth(given, pictures)
        likely = None if fit is None or fit.is_depth else _ask_divisor_of_truth(fit, given, pictures)
    st.number_input(
        "Divisor of the ground truth" if likely is None else "Another divisor",
        value=None,
        **persistent(f"{PAIR}.divisor"),
        placeholder="as the file says" if likely is None else "as chosen",
        help="Stored value ÷ divisor = px; below 0 for the other sign.",
    )
    if given is None or pictures is None:
        return None
    divisor = divisor or likely or given.content.divisor or 1.0
    with refusals_shown():
        if fit is not None and fit.is_depth:
            raise ValueError(fit.doubt)
        truth = halved_truth(given.content.divided(divisor), pictures.left.shape[:2])
        if fit is not None and fit.doubt:
            prose.warning(fit.doubt)
        return Upload(f"{given.digest} {divisor:g}", truth)
    return None


def _fit_of_truth(truth: Upload[StoredDisparity], pictures: Pictures) -> TruthFit | None:
    """Return how a ground truth fits the pair, None if it is refused with the pair, or empty."""
    with suppress(ValueError):
        return computed(
            "divisor",
            lambda progress: stored_truth_fit(truth.content, pictures.left, pictures.right),
            inputs=f"{pictures.digest} {truth.digest}",
            settings="",
            shared=False,
            label="Comparing the ground truth with the pair …",
        )
    return None


def _ask_divisor_of_truth(fit: TruthFit, truth: Upload[StoredDisparity], pictures: Pictures) -> float | None:
    """Ask for the divisor of 8-bit values, or of values that do not fit the pair as the file has them; None if they do.

    The default is the one that agrees best with a quick map of the pair.
    """
    stored, likely = truth.content, fit.divisor
    if likely == stored.divisor:
        return None
    asked = (
        "8 bits per pixel: stored value ÷ divisor = px"
        if stored.divisor is None
        else (divisor_in_words(stored, likely).split(":")[0] + f": read it as ÷ {likely:g}?")
    )
    divisors = DIVISORS if stored.divisor is None else (likely, stored.divisor)
    largest = float(np.nanmax(np.abs(stored.divided(1.0))))
    return float(
        st.segmented_control(
            asked,
            divisors,
            default=type(divisors[0])(likely),
            format_func=lambda divisor: f"÷ {divisor:g}: up to {largest / abs(divisor):.4g} px",
            required=True,
            **persistent(f"{PAIR}.divisor.{truth.digest[:16]}.{pictures.digest[:16]}"),
            help="The preselected one agrees best with a quick map of the pair.",
        )
    )


# Sessions, and sets of pairs


def _pair_of_bundle(given: Upload[Bundle] | None) -> Pair | None:
    """Return the pair of a session, setting the page to it once, or the one chosen from a set; None without either."""
    state = st.session_state
    if given is None:
        for place in (SET, RESTORED_PAIR, STEP):
            state.pop(place, None)
        return None
    if isinstance(given.content, Session):
        state.pop(SET, None)
        if state.get(RESTORED_PAIR) != given.digest:
            state[RESTORED_PAIR] = given.digest
            restore(given.content)
        return session_pair(given.content, given.digest)
    state.pop(RESTORED_PAIR, None)
    pairs = state[SET] = given.content
    number = state[STEP] = min(state.get(STEP) or 0, len(pairs) - 1)
    try:
        return computed(
            "pair of a set",
            lambda progress: pairs.pair(number),
            inputs=pairs.digest,
            settings=str(number),
            shared=False,
            label="Reading the pair …",
        )
    except ValueError as error:
        _ask_step(pairs)
        refuse(str(error))
        return None


def _ask_step(pairs: PairSet) -> None:
    """Ask which pair of the set to show."""
    number, count = st.session_state[STEP], len(pairs)
    before, after = (partial(st.session_state.update, {STEP: number + by}) for by in (-1, 1))
    with st.container(horizontal=True, vertical_alignment="center", gap="small", width="content"):
        st.button("Previous", key=f"{STEP}.-1", on_click=before, disabled=number == 0)
        st.selectbox(
            f"Pair, of {count}",
            range(count),
            format_func=lambda one: f"{one + 1} of {count}: {pairs.name(one)}",
            **persistent(STEP),
            label_visibility="collapsed",
            width=320,
        )
        st.button("Next", key=f"{STEP}.1", on_click=after, disabled=number == count - 1)
        prose.caption("The settings stay from pair to pair; “All pairs” below judges them on all.", width="content")


def set_of(pair_id: PairId) -> PairSet | None:
    """Return the set that a pair belongs to; None for a single pair."""
    pairs: PairSet | None = st.session_state.get(SET)
    return pairs if pairs is not None and pairs.digest == pair_id.collection else None


def preparation_of_sets() -> Preparation:
    """Return how the pair shown, and every other of its set, is prepared as chosen; without remedies."""
    return chosen_preparation(PAIR, SIZES[st.session_state.get(SIZE, "Automatic")])
