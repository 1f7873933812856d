"""A stereo pair: the facts about it, how it is assembled from its parts, and how it is prepared for matching.

The depth page, the driving page and the commands work alike: :func:`assemble_pair` makes a :class:`Pair` from images,
ground truth and calibration; :func:`prepare` resizes it, rectifies it and applies remedies, each step in a separate
function; a matcher then takes `left` and `right`.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import Any, Protocol, Self, TypeVar

import cv2
import numpy as np

from stereolag.assess.diagnosis import apply_remedy, quarters_upright
from stereolag.assess.findings import Remedy
from stereolag.assess.layout import find_views
from stereolag.assess.orientation import RowEvidence, find_correspondences, row_evidence
from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image, as_stereo_pair
from stereolag.geometry.calibration import Calibration, StereoRig
from stereolag.geometry.rectification import (
    as_same_bit_depth,
    calibration_for,
    cropped_to_common_size,
    preview_divisor,
    rectify,
    scaled_disparity,
    scaled_image,
    turned,
)

T = TypeVar("T")

SIZES = {"Automatic": None, "Full": 1, "1/2": 2, "1/4": 4}
"""The sizes at which a pair can be matched, each with the divisor of its sides; None: chosen to suit the pair."""

OWN_PAIR = "Your own pair."
SAME_PICTURE = "Left and right are the same image: every disparity is 0, and there is no depth to see."
ONE_DEPTH = (
    "One image has 8 bits per channel and the other 16: both were scaled to 16 bits, black at 0 and white at 65535, so "
    "that their mean brightness agrees best."
)
REMEDIES_DONE = {
    Remedy.MIRROR_RIGHT: "The right image was mirrored.",
    Remedy.TURN_UPRIGHT: "Both images were turned by a quarter: cameras above each other now stand side by side.",
    Remedy.SWAP_SIDES: "Left and right were swapped.",
    Remedy.ALIGN_ROWS: "The right image was moved up or down until its rows match the left one’s.",
    Remedy.LEVEL: "The right image was rotated and scaled until its rows match: depth is relative.",
    Remedy.RECTIFY: (
        "Both images were turned until their rows match, and corrected for lens distortion where that helps: depth is "
        "relative."
    ),
    Remedy.MATCH_EXPOSURE: "The right image was given the brightness and contrast of the left one.",
}
TRUTH_DROPPED = {
    Remedy.SWAP_SIDES: "The ground truth belongs to the other image and is left out.",
    Remedy.RECTIFY: "The ground truth belongs to the image before that and is left out.",
}
"""The remedies that invalidate ground truth and mask."""


class ChangeCode(StrEnum):
    """The kinds of changes made to a pair after its files were read, besides the remedies."""

    ASSEMBLED = "assembled"
    """The images, ground truth and calibration were made to fit each other."""
    RESIZED = "resized"
    TURNED = "turned"
    """Both images were turned by a quarter, since the cameras stand one above the other."""
    RECTIFIED = "rectified"
    """The pair was rectified with its calibration, or found to be rectified already."""


@dataclass(frozen=True)
class Change:
    """A change made to a pair after its files were read: its kind, or the input doctor's remedy, and a description."""

    code: ChangeCode | Remedy
    sentence: str


@dataclass(frozen=True)
class PairId:
    """The identity of a pair and of the changes made to its images, from which the keys of cached data derive.

    Attributes
    ----------
    images
        The two images as given: a digest of their files, or the name of an example.
    extras
        Digest of the other files that belong to them, their ground truth; "" if there are none.
    collection
        The set of pairs that it belongs to and shares settings with; "" for a single pair.
    size
        The change of its size; "" at full size.
    rectification
        The rectification with its calibration; "" if it was not rectified.
    remedies
        The input doctor's remedies, in the order applied.
    """

    images: str
    extras: str = ""
    collection: str = ""
    size: str = ""
    rectification: str = ""
    remedies: tuple[Remedy, ...] = ()

    @property
    def files(self) -> str:
        """The key of the pair as read."""
        return _joined_key(self.images, self.extras)

    @property
    def chosen(self) -> str:
        """The key of the visitor's choice: the images alone, or the set of pairs."""
        return self.collection or self.images

    @property
    def searched(self) -> str:
        """The key of the two images at their size, whatever else is added; the range in use is kept under it."""
        return _joined_key(self.images, self.size)

    @property
    def untreated(self) -> str:
        """The key of the pair before any remedy; its remedies are kept under it."""
        return _joined_key(self.files, self.size, self.rectification)

    @property
    def exact(self) -> str:
        """The key of exactly these images and their ground truth."""
        return _joined_key(self.untreated, *self.remedies)

    @property
    def judged(self) -> str:
        """The key of the images on which settings are judged: these or, for a set, the whole set at this size."""
        return _joined_key(self.collection, self.size) if self.collection else self.exact


def _joined_key(*parts: str) -> str:
    return " ".join(filter(None, parts))


class Rows(StrEnum):
    """Whether the images are raw, or rectified already so that their rows match."""

    DECIDE = "decide"
    """Decide from the rows of matched features."""
    RAW = "raw"
    RECTIFIED = "rectified"


@dataclass(frozen=True)
class RectificationDecision:
    """Whether a pair was rectified with its calibration, and why.

    Attributes
    ----------
    done
        Whether it was rectified; if not, it was rectified already.
    chosen
        Whether the user stated it; otherwise the rows decided.
    drops_truth
        Whether rectification drops the ground truth, which belongs to the image before it.
    alpha
        The frame, as for :func:`stereolag.rectify`.
    evidence
        The rows before and after rectification.
    """

    done: bool
    chosen: bool
    drops_truth: bool
    alpha: float | None
    evidence: RowEvidence

    def in_words(self, subject: str = "The pair") -> str:
        """Return whether the pair was rectified, and the row differences as evidence."""
        rows = self.evidence
        given, after = (
            "by an unknown amount" if math.isnan(median) else f"by {median:.2g} px"
            for median in (rows.given_px, rows.rectified_px)
        )
        because = ", as you said" if self.chosen else ""
        counts = rows.given_matches, rows.rectified_matches
        if self.done:
            outcome = (
                f"was undistorted and rectified with its calibration{because}: rows differ {after}, before {given}"
            )
            counts = counts[::-1]
        else:
            outcome = f"is rectified already{because}: rows differ {given}, and {after} if rectified again"
        dropped = " Its ground truth belongs to the image before that and is left out." if self.drops_truth else ""
        return f"{subject} {outcome} (medians of {counts[0]} and {counts[1]} matched features).{dropped}"


@dataclass(frozen=True, eq=False)
class Pair:
    """Two images of one scene, and the known facts about them.

    Attributes
    ----------
    left, right
        The images as they are matched, of one size and type.
    id
        Identifies the pair as it is now.
    truth
        (H, W) px, ground truth of the left image; None if unknown.
    visible
        (H, W), True where the right camera sees the same point as the left one: the non-occluded pixels.
    calibration
        Calibration of the left camera.
    min_disparity, num_disparities
        First disparity and number of disparities that the pair needs, px; the number is None if unknown.
    description
        Text about the pair.
    shared
        Whether it is a bundled example.
    changes
        The changes made to it, in order.
    rectification
        The decision about its rectification; None without the calibration of both cameras.
    full
        The pair at full size; None if it was not resized.
    turn
        Quarter turns, counter-clockwise, of both images; :func:`upright` undoes them.
    raw
        The pair before it was turned and rectified with its calibration; None if it was not rectified, or its
        calibration is no longer valid.
    """

    left: Image
    right: Image
    id: PairId
    truth: FloatMap | None = None
    visible: Mask | None = None
    calibration: Calibration | None = None
    min_disparity: int = 0
    num_disparities: int | None = None
    description: str = ""
    shared: bool = False
    changes: tuple[Change, ...] = ()
    rectification: RectificationDecision | None = None
    full: Pair | None = None
    turn: int = 0
    raw: Pair | None = None

    @property
    def digest(self) -> str:
        """The key that identifies exactly these images."""
        return self.id.exact

    @property
    def remedies(self) -> tuple[Change, ...]:
        """The changes made by the input doctor."""
        return tuple(change for change in self.changes if isinstance(change.code, Remedy))

    @property
    def rectified_here(self) -> bool:
        """Whether it was rectified with its calibration."""
        return self.rectification is not None and self.rectification.done

    def after(self, code: ChangeCode | Remedy, sentence: str, **fields: Any) -> Self:
        """Return the pair after a change, with the given fields replaced."""
        return replace(self, changes=(*self.changes, Change(code, sentence)), **fields)


class Memo(Protocol):
    """Caches the results of steps on pairs."""

    def __call__(self, step: str, make: Callable[[], T], pair: Pair, settings: str) -> T:
        """Return the result of `make`, cached under `step`, the id of `pair`, and `settings`."""


def no_memo(step: str, make: Callable[[], T], pair: Pair, settings: str) -> T:
    """Return the result of `make` without caching it."""
    return make()


def assemble_pair(
    left: Image,
    right: Image,
    truth: FloatMap | None = None,
    calibration: Calibration | None = None,
    *,
    id: PairId,
    notes: Sequence[str] = (),
    description: str = OWN_PAIR,
) -> Pair:
    """Return a pair whose parts fit each other: images of one size and depth, with truth and calibration for that size.

    Parameters
    ----------
    left, right
        The images as read: sizes may differ by 3 %, and one may have 8 bits and the other 16.
    truth
        (H, W) px, ground truth of the left image as read.
    calibration
        Calibration of the cameras, at any size of the same aspect ratio.
    id, description
        Those of the pair.
    notes
        Sentences about earlier changes.

    Raises
    ------
    ValueError
        The parts do not belong together.
    """
    images = as_stereo_pair(*as_same_bit_depth(*cropped_to_common_size(left, right)))
    rows, cols = images[0].shape[:2]
    sentences = [*notes]
    if left.dtype != right.dtype:
        sentences.append(ONE_DEPTH)
    if left.shape[:2] != right.shape[:2]:
        shifted = "If one lacks columns on its left, every disparity and every distance is wrong."
        in_doubt = f" {shifted}" if calibration is not None and left.shape[1] != right.shape[1] else ""
        sentences.append(f"The images differ by a few pixels and were cropped to {cols} × {rows}.{in_doubt}")
    if truth is not None and truth.shape != left.shape[:2]:
        (height, width), given = truth.shape, left.shape[:2]
        raise ValueError(
            f"The ground truth is {width} × {height} and the left image is {given[1]} × {given[0]} pixels; "
            "they must have the same size."
        )
    fitted = None if calibration is None else calibration_for(calibration, cols, rows)
    if calibration is not None and not any(fitted is given for given in (calibration, *calibration.modes)):
        sentences.append(f"The calibration was scaled to {cols} × {rows} pixels.")
    return Pair(
        *images,
        id,
        truth=None if truth is None else truth[:rows, :cols],
        calibration=fitted,
        num_disparities=None if fitted is None else fitted.num_disparities,
        description=description,
        changes=tuple(Change(ChangeCode.ASSEMBLED, sentence) for sentence in sentences),
    )


@dataclass(frozen=True)
class Preparation:
    """How to prepare a pair for matching.

    Attributes
    ----------
    divisor
        Divides the sides of the images; None: chosen to leave at most a megapixel.
    rows
        Whether the images are raw, for a pair with the calibration of both cameras.
    alpha
        The frame, as for :func:`stereolag.rectify`; unused if the calibration includes the rectification.
    remedies
        The input doctor's remedies to apply, in order.
    """

    divisor: int | None = 1
    rows: Rows = Rows.DECIDE
    alpha: float | None = None
    remedies: tuple[Remedy, ...] = ()


def prepare(
    pair: Pair,
    preparation: Preparation,
    *,
    memo: Memo = no_memo,
    refused: Callable[[ValueError], object] | None = None,
) -> Pair:
    """Return the pair ready for matching.

    Parameters
    ----------
    pair
        From :func:`assemble_pair`.
    preparation
        The steps to take.
    memo
        Caches their results.
    refused
        Called with the error of a step that is not possible, which is then skipped; None raises the error.

    Raises
    ------
    ValueError
        A step is not possible, and `refused` is None.
    """
    steps: list[Callable[[Pair], Pair]] = [
        partial(resized, divisor=preparation.divisor, memo=memo),
        turned_for_rows,
        partial(rectified, rows=preparation.rows, alpha=preparation.alpha, memo=memo),
        *(partial(remedied, remedy=remedy, memo=memo) for remedy in preparation.remedies),
    ]
    for step in steps:
        try:
            pair = step(pair)
        except ValueError as error:
            if refused is None:
                raise
            refused(error)
    if pair.calibration is not None and pair.calibration.rig is not None:  # the pair could not be rectified
        return replace(pair, calibration=None)
    return pair


def resized(pair: Pair, divisor: int | None, memo: Memo = no_memo) -> Pair:
    """Return the pair with its sides divided, and its range, truth and calibration scaled accordingly."""
    rows, cols = pair.left.shape[:2]
    divisor = divisor or preview_divisor(cols, rows)
    if divisor == 1:
        return pair
    small = memo("resized pair", lambda: _scale_arrays(pair, 1 / divisor), pair, str(divisor))
    size = f"{small.left.shape[1]} × {small.left.shape[0]}"
    first = pair.min_disparity // divisor
    end = None if pair.num_disparities is None else -(-(pair.min_disparity + pair.num_disparities) // divisor)
    return pair.after(
        ChangeCode.RESIZED,
        f"Shown at 1/{divisor} of its size: {size} of {cols} × {rows} pixels.",
        left=small.left,
        right=small.right,
        id=replace(pair.id, size=f"1/{divisor}"),
        truth=small.truth,
        visible=small.visible,
        calibration=None if pair.calibration is None else pair.calibration.scaled(1 / divisor),
        min_disparity=first,
        num_disparities=None if end is None else end - first,
        full=pair,
    )


def _scale_arrays(pair: Pair, factor: float) -> Pair:
    left, right, visible = scaled_image(pair.left, factor), scaled_image(pair.right, factor), pair.visible
    if visible is not None:
        size = (left.shape[1], left.shape[0])
        visible = cv2.resize(visible.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT) > 0
    truth = None if pair.truth is None else scaled_disparity(pair.truth, factor)
    return replace(pair, left=left, right=right, truth=truth, visible=visible)


def turned_for_rows(pair: Pair) -> Pair:
    """Return the pair with both images turned if its cameras stand one above the other, so that rows can match."""
    calibration = pair.calibration
    if calibration is None or not calibration.turn:
        return pair
    rows, cols = pair.left.shape[:2]
    way = "counter-clockwise" if calibration.turn > 0 else "clockwise"
    return pair.after(
        ChangeCode.TURNED,
        f"The cameras stand one above the other: both images were turned by 90° {way}.",
        **_all_turned(pair, calibration.turn),
        calibration=calibration.turned(cols, rows),
        id=replace(pair.id, size=_joined_key(pair.id.size, f"turned {calibration.turn}")),
        turn=calibration.turn,
        raw=None if calibration.rig is None else pair,
    )


def _all_turned(pair: Pair, quarters: int) -> dict[str, Any]:
    arrays = {"left": pair.left, "right": pair.right, "truth": pair.truth, "visible": pair.visible}
    return {name: None if array is None else turned(array, quarters) for name, array in arrays.items()}


def upright(pair: Pair) -> Pair:
    """Return a pair with its images as they were taken, turned back if they had been turned.

    Its calibration keeps the quarters by which to turn the images again.
    """
    if not pair.turn:
        return pair
    back = -pair.turn
    rows, cols = pair.left.shape[:2]
    calibration = pair.calibration
    if calibration is not None:
        calibration = replace(replace(calibration, turn=back).turned(cols, rows), turn=pair.turn)
    return replace(pair, **_all_turned(pair, back), calibration=calibration, turn=0)


def rectified(pair: Pair, rows: Rows = Rows.DECIDE, alpha: float | None = None, memo: Memo = no_memo) -> Pair:
    """Return the pair rectified with its calibration if it is raw, then without ground truth and mask."""
    calibration = pair.calibration
    if calibration is None or calibration.rig is None:
        return pair
    rig = calibration.rig
    alpha = alpha if rig.rectification is None else None
    bare = replace(pair, truth=None, visible=None, raw=None)
    corrected = memo(
        "rectified pair",
        lambda: replace(bare, **rectify(pair.left, pair.right, calibration, alpha=alpha)._asdict()),
        pair,
        _fingerprint(rig, alpha),
    )
    # The frame scales the rows a little, which does not affect the decision.
    evidence = memo(
        "row evidence",
        lambda: row_evidence((pair.left, pair.right), (corrected.left, corrected.right)),
        pair,
        _fingerprint(rig, None),
    )
    done = rows is Rows.RAW or (rows is Rows.DECIDE and not evidence.already_rectified)
    decision = RectificationDecision(done, rows is not Rows.DECIDE, done and pair.truth is not None, alpha, evidence)
    changed: dict[str, Any] = {"calibration": corrected.calibration, "rectification": decision, "raw": None}
    if done:
        changed |= {
            "left": corrected.left,
            "right": corrected.right,
            "truth": None,
            "visible": None,
            "id": replace(pair.id, rectification=f"rectified {_fingerprint(rig, alpha)}"),
            "raw": pair.raw or pair,
        }
    return pair.after(ChangeCode.RECTIFIED, decision.in_words(), **changed)


def _fingerprint(rig: StereoRig, alpha: float | None) -> str:
    """Return a digest that identifies this rectification of a pair."""
    values = [*vars(rig).values(), *(vars(rig.rectification).values() if rig.rectification is not None else ())]
    numbers = b"".join(value.tobytes() for value in values if isinstance(value, np.ndarray))
    return hashlib.sha256(numbers + repr((rig.width, rig.height, alpha)).encode()).hexdigest()[:16]


def remedied(pair: Pair, remedy: Remedy, memo: Memo = no_memo) -> Pair:
    """Return the pair after one remedy, with truth, mask and calibration if they are still valid."""
    bare = replace(pair, raw=None)
    treated = memo("remedy", lambda: _apply_remedy(bare, remedy), pair, f"{remedy} {pair.calibration}")
    return replace(treated, raw=None if treated.calibration is None else pair.raw)


def _apply_remedy(pair: Pair, remedy: Remedy) -> Pair:
    treated = replace(pair.id, remedies=(*pair.id.remedies, remedy))
    if remedy is Remedy.TURN_UPRIGHT:
        quarters = quarters_upright(find_views(find_correspondences(pair.left, pair.right)))
        turned_pair = replace(pair, **_all_turned(pair, quarters), turn=pair.turn + quarters)
        return turned_pair.after(remedy, REMEDIES_DONE[remedy], id=treated, calibration=None)
    left, right = apply_remedy(pair.left, pair.right, remedy)
    sentence, truth, visible = REMEDIES_DONE[remedy], pair.truth, pair.visible
    if remedy in TRUTH_DROPPED:
        sentence += f" {TRUTH_DROPPED[remedy]}" if truth is not None else ""
        truth = visible = None
    return pair.after(
        remedy,
        sentence,
        left=left,
        right=right,
        id=treated,
        truth=truth,
        visible=visible,
        calibration=None if remedy in (Remedy.RECTIFY, Remedy.LEVEL) else pair.calibration,
    )
