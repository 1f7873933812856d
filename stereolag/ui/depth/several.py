"""Several pairs at once, or a saved session: one archive, or many files matched by name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import streamlit as st

from stereolag.io.archives import is_archive, read_archive
from stereolag.io.guard import guarded
from stereolag.io.pairing import PairFiles, matched_pairs
from stereolag.io.sessions import Session, holds_session, read_session
from stereolag.io.sources import MAX_BYTES, harmless
from stereolag.pair import Pair
from stereolag.ui import prose
from stereolag.ui.depth.assembling import named_pair, session_pair
from stereolag.ui.depth.restoring import restore
from stereolag.ui.keys import PAIR
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed
from stereolag.ui.uploads import (
    CALIBRATION_TYPES,
    DISPARITY_TYPES,
    PICTURE_TYPES,
    Upload,
    refuse,
    upload_named,
)

SET = f"{PAIR}.set"
"""Session-state key of the set of pairs in use, if there is one."""
STEP = f"{PAIR}.step"
"""Session-state key of the index of the pair shown, from 0, in its set."""
RESTORED = f"{PAIR}.restored"
"""Session-state key of the digest of the session restored last."""

NO_PAIRS = (
    "None of these files are a pair: the names of its two images must differ in the side, as in left.png and "
    "right.png, im0.png and im1.png, or left/5.png and right/5.png."
)


@dataclass(frozen=True, eq=False)
class PairSet:
    """Pairs kept as encoded files; a pair is decoded when it is shown.

    Attributes
    ----------
    pairs
        File names of each pair.
    read
        Returns the bytes of a named file.
    digest
        Identifies the set.
    """

    pairs: tuple[PairFiles, ...]
    read: Callable[[str], bytes]
    digest: str

    def pair(self, number: int) -> Pair:
        """Decode one pair; raise ValueError, with a sentence, if its files do not form one."""
        try:
            pair = named_pair(self.pairs[number], self.read, f"{self.digest} {number}")
        except ValueError as error:
            raise ValueError(f"Pair {harmless(self.pairs[number].name)}: {error}") from error
        return replace(pair, id=replace(pair.id, collection=self.digest))


Bundle: TypeAlias = Session | PairSet


def read_bundle(files: Sequence[tuple[str, bytes]]) -> Bundle:
    """Return the session or the pairs in an archive or in named files; raise ValueError if there are neither."""
    digest = hashlib.sha256(b"".join(hashlib.sha256(data).digest() for _, data in files)).hexdigest()
    if len(files) == 1 and is_archive(files[0][1]):
        archive = read_archive(files[0][1])
        if holds_session(archive):
            return read_session(archive, guarded)
        return _pair_set(archive.names, archive.read, digest)
    if sum(len(data) for _, data in files) > MAX_BYTES:
        raise ValueError(f"The files exceed {MAX_BYTES // 2**20} MB in total, the most that is accepted.")
    by_name = dict(files)
    return _pair_set([*by_name], by_name.__getitem__, digest)


def _pair_set(names: Sequence[str], read: Callable[[str], bytes], digest: str) -> PairSet:
    pairs = matched_pairs(names)
    if not pairs:
        raise ValueError(NO_PAIRS)
    return PairSet(tuple(pairs), read, digest)


def ask_bundle(key: str) -> Upload[Bundle] | None:
    """Ask for an archive or many files."""
    return upload_named(
        "A ZIP, or the files of several pairs",
        read_bundle,
        key=f"{key}.several",
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
    number = st.session_state[STEP] = min(st.session_state.get(STEP) or 0, len(pairs.pairs) - 1)
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
    pairs: PairSet | None = st.session_state.get(SET)
    if pairs is not None and pairs.digest == pair.id.collection:
        _ask_step(pairs)


def _ask_step(pairs: PairSet) -> None:
    number, count = st.session_state[STEP], len(pairs.pairs)
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        _step_button("Previous", -1, disabled=number == 0)
        st.selectbox(
            f"Pair, of {count}",
            range(count),
            format_func=lambda one: f"{one + 1} of {count}: {harmless(pairs.pairs[one].name)}",
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
