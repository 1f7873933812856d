"""Sets of pairs: asking for them, stepping through them, judging on all of them, and the table of all pairs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
import streamlit as st

from stereolag.assess.judging import Criterion, Judgement, TuningPair, estimate_reference, widest_range
from stereolag.core.jobs import Estimate, Progress
from stereolag.io.settings import Session
from stereolag.pair import SIZES, Bundle, Pair, PairSet, Preparation, prepare, read_bundle, session_pair
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import prose
from stereolag.ui.controls import persistent
from stereolag.ui.depth.calibrating import chosen_preparation
from stereolag.ui.depth.maps import DepthView, known_truth
from stereolag.ui.depth.restoring import restore
from stereolag.ui.elements import PERCENT, SECONDS
from stereolag.ui.keys import PAIR, SIZE
from stereolag.ui.navigation import fragment
from stereolag.ui.results import Job, computed, computed_in_turn, this_visit
from stereolag.ui.sentences import duration
from stereolag.ui.uploads import CALIBRATION_TYPES, DISPARITY_TYPES, PICTURE_TYPES, Upload, refuse, upload_named

SET = f"{PAIR}.set"
"""Session-state key of the set of pairs in use, if there is one."""
STEP = f"{PAIR}.step"
"""Session-state key of the index of the pair shown, from 0, in its set."""
RESTORED = f"{PAIR}.restored"
"""Session-state key of the digest of the session restored last."""

HELD_BYTES = 256 * 2**20
"""Maximum memory of pairs that are judged together and kept in memory at the same time."""
HELD_BYTES_OF_A_PIXEL = 24
"""Memory per pixel: both images in colour, their reference, and one map."""

BETWEEN_LOOKS_S = 0.3

TABLE = "depth.all_pairs"
WANTED = f"{TABLE}.wanted"
"""Session-state key of the set and settings that the table was last requested for."""
BYTES_OF_A_PAIR = 40
"""Memory per pixel while a pair is decoded, rectified and scaled down."""

NONE_YET = (
    "This is for several pairs at once: choose “ZIP or several pairs” under your own files, and upload a ZIP, or "
    "many files whose names tell left from right."
)


def ask_bundle() -> Upload[Bundle] | None:
    """Ask for an archive or many files."""
    return upload_named(
        "A ZIP, or the files of several pairs",
        read_bundle,
        key=f"{PAIR}.several",
        types=tuple(dict.fromkeys((*PICTURE_TYPES, "zip", *DISPARITY_TYPES, *CALIBRATION_TYPES))),
        note="A ZIP saved from this page reopens it as it was. Otherwise, left and right images, ground truths "
        "and calibrations are matched by name and folder.",
    )


def pair_of_bundle(given: Upload[Bundle] | None) -> Pair | None:
    """Return the pair of a session, setting the page to it once, or the one chosen from a set; None without either."""
    if given is None:
        forget_bundle()
        return None
    if isinstance(given.content, Session):
        st.session_state.pop(SET, None)
        if st.session_state.get(RESTORED) != given.digest:
            st.session_state[RESTORED] = given.digest
            restore(given.content)
        return session_pair(given.content, given.digest)
    st.session_state.pop(RESTORED, None)
    st.session_state[SET] = given.content
    return _stepped(given.content)


def forget_bundle() -> None:
    """Forget the set or session: it is no longer in use."""
    for place in (SET, RESTORED, STEP):
        st.session_state.pop(place, None)


def _stepped(pairs: PairSet) -> Pair | None:
    """Return the pair chosen in :func:`show_steps`; show an error and return None if it cannot be read."""
    number = st.session_state[STEP] = min(st.session_state.get(STEP) or 0, len(pairs) - 1)
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


def show_steps(pair: Pair) -> None:
    """Ask which pair of the set to show; do nothing for a single pair."""
    pairs = set_of(pair)
    if pairs is not None:
        _ask_step(pairs)


def _ask_step(pairs: PairSet) -> None:
    number, count = st.session_state[STEP], len(pairs)
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        _step_button("Previous", -1, disabled=number == 0)
        st.selectbox(
            f"Pair, of {count}",
            range(count),
            format_func=lambda one: f"{one + 1} of {count}: {pairs.name(one)}",
            **persistent(STEP),
            label_visibility="collapsed",
            width=320,
        )
        _step_button("Next", 1, disabled=number == count - 1)
        prose.caption("The settings stay from pair to pair; “All pairs” below judges them on all.", width="content")


def _step_button(label: str, by: int, *, disabled: bool) -> None:
    st.button(label, key=f"{STEP}.{by}", on_click=_move, args=(by,), disabled=disabled, width="content")


def _move(by: int) -> None:
    st.session_state[STEP] += by


def set_of(pair: Pair) -> PairSet | None:
    """Return the set that a pair belongs to; None for a single pair."""
    pairs: PairSet | None = st.session_state.get(SET)
    return pairs if pairs is not None and pairs.digest == pair.id.collection else None


def place_in_set(pair: Pair) -> str:
    """Return the position of the pair shown in its set, in words; "" for a single pair."""
    pairs = set_of(pair)
    return "" if pairs is None else f"pair {st.session_state.get(STEP, 0) + 1} of {len(pairs)}"


def preparation_of_sets() -> Preparation:
    """Return how every pair of a set is prepared: as chosen for the one shown, without remedies."""
    return chosen_preparation(PAIR, SIZES[st.session_state.get(SIZE, "Automatic")])


# Judging on all pairs


@dataclass(frozen=True)
class JudgedPairs:
    """The pairs on which settings are judged together: first the one shown, then others of its set.

    Attributes
    ----------
    current
        The pair shown.
    pairs
        Its set; None for a single pair.
    others
        Indices of the others, as many as may be in memory at once, spread evenly over the set.
    preparation
        How the others are prepared.
    """

    current: Pair
    pairs: PairSet | None
    others: tuple[int, ...]
    preparation: Preparation

    @classmethod
    def of(cls, pair: Pair) -> JudgedPairs:
        """Return the pairs to judge on while this one is shown."""
        pairs = set_of(pair)
        if pairs is None:
            return cls(pair, None, (), preparation_of_sets())
        number, count = st.session_state.get(STEP, 0), len(pairs)
        pixels = pair.left.shape[0] * pair.left.shape[1]
        held = min(count, max(1, HELD_BYTES // (HELD_BYTES_OF_A_PIXEL * pixels)))
        spread = (round((step + 0.5) * count / held - 0.5) for step in range(held))
        others = [one for one in dict.fromkeys(spread) if one != number][: held - 1]
        return cls(pair, pairs, tuple(others), preparation_of_sets())

    def __len__(self) -> int:
        """Return the number of pairs."""
        return 1 + len(self.others)

    def __iter__(self) -> Iterator[Pair]:
        """Yield the pairs, each decoded in its turn; skip those whose files do not form a pair."""
        yield self.current
        for number in self.others:
            assert self.pairs is not None
            try:
                yield prepare(self.pairs.pair(number), self.preparation)
            except ValueError:  # the table of all pairs says why
                continue

    @property
    def sentence(self) -> str:
        """Return a sentence about the pairs on which settings are judged; "" for a single pair."""
        if self.pairs is None:
            return ""
        count = len(self.pairs)
        which = f"all {count} pairs" if len(self) == count else f"{len(self)} of the {count} pairs, spread evenly,"
        return f"They are judged on **{which} together**, by the mean. "


@dataclass(frozen=True, eq=False)
class PairJob:
    """A job on a pair or on the set it belongs to.

    Attributes
    ----------
    digest
        Identifies the pair, or the set and the preparation of its pairs.
    asked
        The request that started the job.
    job
        The job itself.
    files, images
        Identify the pair shown when the job began, and its images.
    place
        Position of that pair in the set, in words; "" for a single pair.
    """

    digest: str
    asked: Any
    job: Job[Any]
    files: str = ""
    images: str = ""
    place: str = ""

    def is_on(self, pair: Pair) -> bool:
        """Return whether the page, showing this pair, would still give the job the same images."""
        return self.digest == _digest(pair) and (self.files != pair.id.files or self.images == pair.digest)


def job_on(pair: Pair, key: str) -> PairJob | None:
    """Return the job of a part of the page on this pair; cancel and forget a job on other images."""
    begun: PairJob | None = st.session_state.get(key)
    if begun is None or begun.is_on(pair):
        return begun
    forget_job(key)
    return None


def forget_job(key: str) -> None:
    """Cancel and forget the job of a part of the page."""
    st.session_state.pop(key).job.cancel()


def begin_job(pair: Pair, key: str, asked: object, work: Callable[[Job[Any]], Any], estimate: Estimate) -> None:
    """Start the job of a part of the page in its own thread."""
    job = Job(work, estimate)
    this_visit().jobs[key] = pair.id.judged, job
    st.session_state[key] = PairJob(_digest(pair), asked, job, pair.id.files, pair.digest, place_in_set(pair))


def _digest(pair: Pair) -> str:
    """Return the key of the images judged together; for a set, it includes the preparation of the other pairs."""
    return f"{pair.id.judged} {preparation_of_sets()}" if pair.id.collection else pair.id.judged


# The table of all pairs


@dataclass(frozen=True)
class Figures:
    """Figures of one map: the share of pixels with a disparity, seconds, and % off by more than 2 px or missing.

    Bad-2 is relative to the ground truth, or estimated without one; NaN if there is nothing to judge by.
    """

    coverage: float
    elapsed_s: float
    bad_2: float = math.nan
    estimated_bad_2: float = math.nan


@dataclass(frozen=True)
class PairRow:
    """Figures of every method, by title, on one pair; or why they could not be computed."""

    name: str
    figures: Mapping[str, Figures] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True)
class Table:
    """The rows of all pairs."""

    rows: tuple[PairRow, ...]


@fragment
def show_all_pairs(view: DepthView) -> None:
    """Offer to compute every pair of the set with the settings in use, and show the table."""
    pairs = set_of(view.pair)
    if pairs is None:
        prose.info(NONE_YET, icon=":material/stacks:")
        return
    matchers = [result.settings for result in view.results.values()]
    preparation = preparation_of_sets()
    settings = " ".join([str(preparation), *(f"{type(one).__name__} {one.model_dump_json()}" for one in matchers)])
    once = [matcher.estimate(view.pair.left.shape, view.pair.left.dtype) for matcher in matchers]
    count = len(pairs)
    once.append(estimate_reference(widest_range(matchers), view.pair.left.shape, view.pair.left.dtype))
    seconds = count * sum(estimate.seconds for estimate in once)
    st.button(
        f"Compute all {count} pairs",
        key=f"{TABLE}.start",
        type="primary",
        icon=":material/stacks:",
        help=f"{' and '.join(view.results)} with the settings in use: about {duration(seconds)}.",
        on_click=_want,
        args=(f"{pairs.digest} {settings}",),
    )
    if st.session_state.get(WANTED) != f"{pairs.digest} {settings}":
        return
    pixels = view.pair.left.shape[0] * view.pair.left.shape[1]
    memory = max(estimate.memory for estimate in once) + BYTES_OF_A_PAIR * pixels
    table = computed_in_turn(
        "all pairs",
        lambda progress: table_of(pairs, matchers, preparation, progress),
        Estimate(memory, seconds),
        inputs=pairs.digest,
        settings=settings,
        shared=False,
        label=f"{count} pairs …",
    )
    if table is not None:
        _show(table)


def table_of(pairs: PairSet, matchers: Sequence[StereoMatcher], preparation: Preparation, progress: Progress) -> Table:
    """Compute every pair of a set with all matchers, one pair in memory at a time; a pair that fails says why."""

    def rows() -> Iterator[PairRow]:
        count = len(pairs)
        for number in range(count):
            name = f"{number + 1}: {pairs.name(number)}"
            try:
                pair = prepare(pairs.pair(number), preparation)
                yield PairRow(name, dict(_figures(pair, matchers, progress, number / count, 1 / count)))
            except ValueError as error:
                yield PairRow(name, problem=str(error))
            progress((number + 1) / count)

    return Table(tuple(rows()))


def _figures(
    pair: Pair, matchers: Sequence[StereoMatcher], progress: Progress, done: float, share: float
) -> Iterator[tuple[str, Figures]]:
    part = share / (len(matchers) + 1)
    searched = widest_range(matchers)
    judge = TuningPair.of(
        pair.left, pair.right, known_truth(pair), search_range=searched, progress=_part(progress, done, part)
    )
    for number, matcher in enumerate(matchers, 1):
        result = matcher.compute(pair.left, pair.right, progress=_part(progress, done + number * part, part))
        bad = math.nan if judge.unjudged(matcher) else Judgement.of(result.disparity, judge.reference).bad
        known = judge.criterion is Criterion.TRUE_BAD_2
        yield (
            matcher.title,
            Figures(result.coverage, result.elapsed_s, *((bad, math.nan) if known else (math.nan, bad))),
        )


def _part(progress: Progress, done: float, share: float) -> Progress:
    """Return a progress callback for a share of the work."""
    return lambda fraction: progress(done + share * fraction)


def _want(wanted: str) -> None:
    st.session_state[WANTED] = wanted


def _show(table: Table) -> None:
    """Show the table, with the mean of every column below."""
    good = [row for row in table.rows if row.figures]
    frame = pd.DataFrame.from_dict({row.name: _cells(row) for row in good}, orient="index")
    if len(good) > 1:
        frame.loc["Mean"] = frame.mean()
    if good:
        frame = frame.dropna(axis="columns", how="all")
        formats = {name: PERCENT if name.endswith("%") else SECONDS for name in frame.columns}
        columns = {
            name: st.column_config.NumberColumn(name.removesuffix(", %"), format=formats[name]) for name in formats
        }
        alt = f"Figures of every method on {len(good)} pairs."
        st.dataframe(frame, column_config={"_index": "Pair", **columns}, key=f"{TABLE}.table", alt=alt)
        prose.caption(
            "Bad-2: the share of the pixels with ground truth that are off by more than 2 px or missing. Estimated "
            "bad-2: against the accurate preset, for pairs without ground truth. Every pair is computed with the "
            "settings in use, without the input doctor’s remedies."
        )
    for row in table.rows:
        if row.problem:
            prose.warning(row.problem)


def _cells(row: PairRow) -> dict[str, float]:
    """Return the cells of a row: bad-2 of every method first, then coverage, then time."""
    found = row.figures.items()
    return (
        {f"{name}: bad-2, %": figures.bad_2 for name, figures in found}
        | {f"{name}: estimated bad-2, %": figures.estimated_bad_2 for name, figures in found}
        | {f"{name}: coverage, %": 100 * figures.coverage for name, figures in found}
        | {f"{name}: took": figures.elapsed_s for name, figures in found}
    )
