"""The pair of the depth page: an example, the visitor's files, one of a set, or one handed over; ready for matching."""

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
from stereolag.pair import SAME_PICTURE, SIZES, ChangeCode, Pair, PairId, Preparation, assemble_pair
from stereolag.pair_sources import (
    Bundle,
    OneView,
    PairSet,
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
    show_initial_settings,
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

SCALED_SETTINGS = f"{PAIR}.kept_settings"
"""Session-state key of the :class:`ScaledSettings`."""
OWN_PAIR_READY = f"{PAIR}.there"
"""Session-state key of whether all files of the visitor's own pair are there."""
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
    _open_or_close_fold()
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
        if chosen in (LIVE, OWN):  # own files: until an example is shown in their place
            place.markdown(f"**{LIVE_TITLE if chosen == LIVE else 'Your own pair'}**", width="content")
        if chosen == LIVE:
            with notes:
                return LiveCamera(
                    ask_calibration(PAIR, line.expander("Calibration", icon=":material/add:", width=FOLD_WIDTH))
                )
        pair = own_or_example(
            chosen,
            partial(ask_own_pair, line, notes),
            load,
            examples,
            key=PAIR,
            awaited="both images are",
            notes=notes,
        )
        st.session_state[OWN_PAIR_READY] = not pair.shared
        with choices:
            st.segmented_control(
                "Size",
                [*SIZES],
                default="Automatic",
                required=True,
                **persistent(SIZE),
                help="Half the size takes an eighth of the time. Search range, windows, focal length and ground truth "
                "are scaled with the images. Automatic is full size up to a megapixel.",
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
        show_initial_settings(pair)
        pairs = set_of(pair.id)
        if pairs is not None and len(pairs) > 1:
            _ask_step(pairs)
    recall_settings(pair)
    return pair


def _open_or_close_fold() -> None:
    """Open the fold of the inputs while files are awaited; close it once they are there, or for a live camera."""
    state = st.session_state
    awaited = state.get(PAIR) == OWN and not state.get(OWN_PAIR_READY)
    if awaited or state.pop(FOLD_NEXT, False):
        state[FOLD] = awaited
    live = state.get(PAIR) == LIVE
    if live and state.get(f"{PAIR}.live") is False:  # it needs no files, and its maps need the space
        state[FOLD] = False
    state[f"{PAIR}.live"] = live


def original(pair: Pair) -> Pair:
    """Return the pair at full size, with all changes made to the smaller one."""
    if pair.full is None:
        return pair
    return prepared(pair.full, replace(chosen_preparation(PAIR), remedies=pair.id.remedies))


@dataclass(frozen=True)
class ScaledSettings:
    """The settings in use as they were scaled with the images.

    Attributes
    ----------
    images
        The images that the settings are for: the visitor's choice, the divisor of the sides, and the key of the two
        images.
    scaled
        {method: (settings as last scaled, settings before any scaling, divisor of the latter)}.
    """

    images: tuple[str, float, str]
    scaled: dict[type[StereoMatcher], tuple[StereoMatcher, StereoMatcher, float]] = field(default_factory=dict)


def _keep_settings(pair: Pair) -> None:
    """Keep the settings in use if the images are the same at another size, or another pair of the same set.

    They are scaled to cover the same part of the images. Settings not changed since the last scaling are scaled from
    the originals, so that sizes are rounded only once, and return exactly with the size of the images.
    """
    divisor = (pair.full or pair).left.shape[1] / pair.left.shape[1]
    images = pair.id.chosen, divisor, pair.id.searched
    before: ScaledSettings | None = st.session_state.get(SCALED_SETTINGS)
    if before is not None and before.images[0] != images[0]:
        before = None  # the visitor chose another pair
    current = st.session_state[SCALED_SETTINGS] = ScaledSettings(images, before.scaled if before else {})
    if before is None or before.images == images:
        return
    for matcher in matchers_in_use():
        last, unscaled, its_divisor = current.scaled.get(type(matcher), (None, matcher, before.images[1]))
        if last != matcher:
            unscaled, its_divisor = matcher, before.images[1]
        with refusals_shown("The settings could not be scaled with the images. {}"):
            scaled = scaled_settings(unscaled, its_divisor / divisor)
            set_controls(scaled, pair)
            current.scaled[type(matcher)] = scaled, unscaled, its_divisor


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

    An archive in place of the left image holds all of these: a saved session, or several pairs. A pair handed over by
    another page replaces all files.

    Parameters
    ----------
    line
        The first line of the page, which gets a fold for the ground truth and the calibration.
    notes
        Where the calibration is described.
    """
    handed_over: Pair | None = st.session_state.get(HANDED)
    if handed_over is not None:
        show_offer(
            f"In use: {handed_over.description}",
            "Use other files",
            f"{HANDED}.forget",
            partial(st.session_state.pop, HANDED, None),
        )
        return handed_over
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
    pictures = _ask_one_picture() if arrangement == "beside" else _ask_two_pictures()
    show_limits(image_limits())
    if isinstance(pictures, Upload):
        return _pair_of_bundle(pictures)
    _pair_of_bundle(None)
    more = line.expander("Ground truth, calibration", icon=":material/add:", width=FOLD_WIDTH)
    with more:
        truth = _ask_truth(pictures)
    with notes:
        calibration = ask_calibration(PAIR, more)
    if pictures is None:
        return put_together(None, f"{PAIR}.own.{arrangement}")
    return put_together(
        partial(
            assemble_pair,
            pictures.left,
            pictures.right,
            None if truth is None else truth.content,
            calibration,
            id=PairId(pictures.digest, truth.digest if truth else ""),
            notes=pictures.notes,
        ),
        f"{PAIR}.own.{arrangement}",
    )


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
        return _both_views_in(left.content.pixels, left.digest)
    return Pictures(
        left.content.pixels,
        right.content,
        f"{left.digest} {right.digest}",
        (SAME_PICTURE,) if left.digest == right.digest else (),
    )


def _both_views_in(image: Image, digest: str) -> Pictures | None:
    """Return the views in a picture given as the left one; None if it holds only one, so that the right is awaited."""

    def split(_: object) -> Pictures:
        left, right, note = likely_views(image)
        return Pictures(left, right, digest, (note,))

    # Refused: a single view, or an anaglyph.
    views = remembered("both views", partial(attempted(split), silent), inputs=digest, settings="", shared=False)
    return None if isinstance(views, Refusal) else views


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
        note="One beside or above the other, or an MPO or HEIC, as stereo cameras and phones save them.",
        variant=layout and f" {layout}",
    )
    if both is None:
        return None
    left, right, note = both.content
    return Pictures(left, right, both.digest, (note,))


def _ask_truth(pictures: Pictures | None) -> Upload[FloatMap] | None:
    """Ask for the ground truth of the left image and its divisor, by default the one that fits the pair."""
    given = upload(
        "Ground truth (optional)",
        guarded(read_stored_disparity),
        key=f"{PAIR}.truth",
        types=DISPARITY_SUFFIXES,
        note="PFM, EXR, FLO, TIFF, NPY, NPZ, MAT, or PNG: 16 bits (px × 256, as in KITTI), Sintel’s colours, or 8 "
        "bits, whose divisor is found from the pair.",
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
        help="Stored value ÷ divisor = px. A negative divisor changes the sign.",
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
    """Return how a ground truth fits the pair; None if it is empty, or refused together with the pair."""
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
    """Ask for the divisor of 8-bit values, or of values that do not fit the pair as stored; None if they fit.

    The default is the one that agrees best with a quick map of the pair.
    """
    stored, likely = truth.content, fit.divisor
    if likely == stored.divisor:
        return None
    question = (
        "8 bits per pixel: stored value ÷ divisor = px"
        if stored.divisor is None
        else (divisor_in_words(stored, likely).split(":")[0] + f": read it as ÷ {likely:g}?")
    )
    divisors = DIVISORS if stored.divisor is None else (likely, stored.divisor)
    largest = float(np.nanmax(np.abs(stored.divided(1.0))))
    return float(
        st.segmented_control(
            question,
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
    """Return the pair of a session, whose page is restored once, or the pair chosen from a set; None without either."""
    state = st.session_state
    if given is None:
        for key in (SET, RESTORED_PAIR, STEP):
            state.pop(key, None)
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
    previous, following = (partial(st.session_state.update, {STEP: number + step}) for step in (-1, 1))
    with st.container(horizontal=True, vertical_alignment="center", gap="small", width="content"):
        st.button("Previous", key=f"{STEP}.-1", on_click=previous, disabled=number == 0)
        st.selectbox(
            f"Pair, of {count}",
            range(count),
            format_func=lambda index: f"{index + 1} of {count}: {pairs.name(index)}",
            **persistent(STEP),
            label_visibility="collapsed",
            width=320,
        )
        st.button("Next", key=f"{STEP}.1", on_click=following, disabled=number == count - 1)
        prose.caption("All pairs share the settings; “All pairs” below judges them on every pair.", width="content")


def set_of(pair_id: PairId) -> PairSet | None:
    """Return the set that a pair belongs to; None for a single pair."""
    pairs: PairSet | None = st.session_state.get(SET)
    return pairs if pairs is not None and pairs.digest == pair_id.collection else None


def preparation_of_sets() -> Preparation:
    """Return the preparation chosen for the pair shown and all others of its set, without remedies."""
    return chosen_preparation(PAIR, SIZES[st.session_state.get(SIZE, "Automatic")])
