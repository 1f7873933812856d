"""All pairs of a set, one after another, prepared as the page prepares the one it shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import streamlit as st

from stereolag.assess.orientation import row_evidence
from stereolag.geometry.rectification import preview_divisor, rectify
from stereolag.pair import Pair
from stereolag.ui.depth.inputs import at_size
from stereolag.ui.depth.rectifying import DECIDE, RECTIFIED, alpha_key, choice_key
from stereolag.ui.depth.several import SET, STEP, PairSet
from stereolag.ui.keys import PAIR, SIZE
from stereolag.ui.pairs import SIZES

HELD_BYTES = 256 * 2**20
"""Maximum memory of pairs that are judged together and kept in memory at the same time."""
HELD_BYTES_OF_A_PIXEL = 24
"""Memory per pixel: both images in colour, their reference, and one map."""


def set_of(pair: Pair) -> PairSet | None:
    """Return the set that a pair belongs to; None for a single pair."""
    pairs: PairSet | None = st.session_state.get(SET)
    return pairs if pairs is not None and pairs.digest == pair.id.collection else None


def place_in_set(pair: Pair) -> str:
    """Return the position of the pair shown in its set, in words; "" for a single pair."""
    pairs = set_of(pair)
    return "" if pairs is None else f"pair {st.session_state.get(STEP, 0) + 1} of {len(pairs.pairs)}"


@dataclass(frozen=True)
class Preparation:
    """How every pair of a set is prepared: the size, and the visitor's choices for rectification."""

    size: str
    choice: str
    alpha: float

    @classmethod
    def chosen(cls) -> Preparation:
        """Return the preparation chosen on the page."""
        state = st.session_state
        choice, alpha = state.get(choice_key(PAIR), DECIDE), state.get(alpha_key(PAIR), 0.0)
        return cls(state.get(SIZE, "Automatic"), choice, alpha)

    def prepared(self, pair: Pair) -> Pair:
        """Return a pair as the page would match it, without remedies and without calling Streamlit."""
        rows, cols = pair.left.shape[:2]
        divisor = SIZES.get(self.size) or preview_divisor(cols, rows)
        if divisor > 1:
            scaled = None if pair.calibration is None else pair.calibration.scaled(1 / divisor)
            pair = replace(at_size(pair, divisor), calibration=scaled)
        if pair.calibration is None or pair.calibration.rig is None or self.choice == RECTIFIED:
            return pair
        alpha = self.alpha if pair.calibration.rig.rectification is None else None
        left, right, calibration = rectify(pair.left, pair.right, pair.calibration, alpha=alpha)
        if self.choice == DECIDE and row_evidence((pair.left, pair.right), (left, right)).already_rectified:
            return pair
        return replace(pair, left=left, right=right, calibration=calibration, truth=None, visible=None)


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
            return cls(pair, None, (), Preparation.chosen())
        number, count = st.session_state.get(STEP, 0), len(pairs.pairs)
        pixels = pair.left.shape[0] * pair.left.shape[1]
        held = min(count, max(1, HELD_BYTES // (HELD_BYTES_OF_A_PIXEL * pixels)))
        spread = (round((step + 0.5) * count / held - 0.5) for step in range(held))
        others = [one for one in dict.fromkeys(spread) if one != number][: held - 1]
        return cls(pair, pairs, tuple(others), Preparation.chosen())

    def __len__(self) -> int:
        """Return the number of pairs."""
        return 1 + len(self.others)

    def __iter__(self) -> Iterator[Pair]:
        """Yield the pairs, each decoded in its turn; skip those whose files do not form a pair."""
        yield self.current
        for number in self.others:
            assert self.pairs is not None
            try:
                yield self.preparation.prepared(self.pairs.pair(number))
            except ValueError:  # the table of all pairs says why
                continue

    @property
    def sentence(self) -> str:
        """Return a sentence about the pairs on which settings are judged; "" for a single pair."""
        if self.pairs is None:
            return ""
        count = len(self.pairs.pairs)
        which = f"all {count} pairs" if len(self) == count else f"{len(self)} of the {count} pairs, spread evenly,"
        return f"They are judged on **{which} together**, by the mean. "
