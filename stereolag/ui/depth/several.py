"""Several pairs at once, or a session that comes back: one archive, or many files matched by their names."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import streamlit as st

from stereolag.reading.archives import is_archive, read_archive
from stereolag.reading.pairing import PairFiles, matched_pairs
from stereolag.reading.sessions import Session, holds_session, read_session
from stereolag.reading.sources import MAX_BYTES, harmless
from stereolag.ui import prose
from stereolag.ui.depth.assembling import named_pair, session_pair
from stereolag.ui.depth.restoring import restore
from stereolag.ui.keys import PAIR
from stereolag.ui.pairs import StereoPair
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
"""In the session's state: the set of pairs in use, if there is one."""
STEP = f"{PAIR}.step"
"""In the session's state: which pair of the set is looked at, from 0."""
RESTORED = f"{PAIR}.restored"
"""In the session's state: the digest of the session that the page was set to last."""

NO_PAIRS = (
    "None of these files are a pair: the names of its two images must differ in what tells the side, as left.png and "
    "right.png, im0.png and im1.png, or left/5.png and right/5.png do."
)


@dataclass(frozen=True, eq=False)
class PairSet:
    """Pairs whose files stay as they were given, encoded; one is decoded when it is looked at.

    Attributes
    ----------
    pairs
        The names of their files.
    read
        Returns the bytes of a file by its name.
    digest
        Tells the set from every other.
    """

    pairs: tuple[PairFiles, ...]
    read: Callable[[str], bytes]
    digest: str

    def pair(self, number: int) -> StereoPair:
        """Decode one pair; ValueError, with a sentence, where its files do not make one."""
        try:
            pair = named_pair(self.pairs[number], self.read, f"{self.digest} {number}")
        except ValueError as error:
            raise ValueError(f"Pair {harmless(self.pairs[number].name)}: {error}") from error
        return replace(pair, collection=self.digest)


Bundle: TypeAlias = Session | PairSet


def read_bundle(files: Sequence[tuple[str, bytes]]) -> Bundle:
    """Return what an archive, or many files by name, hold; ValueError where there is neither a session nor a pair."""
    digest = hashlib.sha256(b"".join(hashlib.sha256(data).digest() for _, data in files)).hexdigest()
    if len(files) == 1 and is_archive(files[0][1]):
        archive = read_archive(files[0][1])
        if holds_session(archive):
            return read_session(archive)
        return _pair_set(archive.names, archive.read, digest)
    if sum(len(data) for _, data in files) > MAX_BYTES:
        raise ValueError(f"The files have more than {MAX_BYTES // 2**20} MB together, the most that is accepted.")
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
        note="A ZIP that was taken away from here opens the page as it was. Of other files, left and right images, "
        "ground truths and calibrations are matched by their names and folders.",
    )


def pair_of_bundle(given: Upload[Bundle] | None) -> StereoPair | None:
    """Return the pair to look at; of a session, set the page to it once, of a set, ask which. None of nothing."""
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
    """Forget what was given all at once: it is not there any more."""
    for place in (SET, RESTORED, STEP):
        st.session_state.pop(place, None)


def _stepped(pairs: PairSet) -> StereoPair | None:
    """Return the pair of a set that :func:`show_steps` chose."""
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


def show_steps(pair: StereoPair) -> None:
    """Ask which pair of a set to look at; nothing is asked of a pair alone."""
    pairs: PairSet | None = st.session_state.get(SET)
    if pairs is not None and pairs.digest == pair.collection:
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
