"""A pair assembled from its files: images, ground truth and calibration that fit each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from stereolag.assess.disparities import likely_divisor
from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image, as_stereo_pair
from stereolag.geometry.rectification import as_deep, calibration_for, cropped_alike, halves
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_stored_disparity
from stereolag.io.guard import guarded
from stereolag.io.images import read_image
from stereolag.io.pairing import PairFiles
from stereolag.io.sessions import Session
from stereolag.io.sources import harmless
from stereolag.pair import Change, ChangeCode, Pair, PairId
from stereolag.ui.depth.calibrating import Calibrated
from stereolag.ui.uploads import Upload

ONE_DEPTH = (
    "One image has 8 bits per channel and the other 16: both were scaled to 16 bits, black at 0 and white at 65535, so "
    "that their mean brightness agrees best."
)
SAME_PICTURE = "Left and right are the same image: every disparity is 0, and there is no depth to see."


@dataclass(frozen=True, eq=False)
class Pictures:
    """Two images as given, a digest of their files, and the changes made to them."""

    left: Image
    right: Image
    digest: str
    changes: tuple[str, ...] = ()


def split_picture(data: bytes) -> Pictures:
    """Return both halves of a side-by-side image, without a digest; raise ValueError if it cannot be read or halved."""
    both = guarded(read_image)(data)
    left, right = halves(both)
    width = both.shape[1]
    odd = f" Its width of {width} px is odd: the middle column is left out." if width % 2 else ""
    return Pictures(left, right, "", (f"The image was split down the middle.{odd}",))


@dataclass(frozen=True, eq=False)
class Truth:
    """A ground truth, px, and a digest of its file and divisor."""

    disparity: FloatMap
    digest: str


def together(pictures: Pictures, truth: Truth | None, calibration: Calibrated | None) -> Pair:
    """Return the pair; raise ValueError if the files do not belong together."""
    left, right = as_stereo_pair(*as_deep(*cropped_alike(pictures.left, pictures.right)))
    rows, cols = left.shape[:2]
    changes = list(pictures.changes)
    if pictures.left.dtype != pictures.right.dtype:
        changes.append(ONE_DEPTH)
    if pictures.left.shape[:2] != pictures.right.shape[:2]:
        changes.append(f"The images differ by a few pixels and were cropped to {cols} × {rows}.")
    disparity = None if truth is None else _fitting_truth(truth.disparity, pictures.left)[:rows, :cols]
    fitted = None if calibration is None else calibration_for(calibration.content, cols, rows)
    if calibration is not None and fitted is not calibration.content:
        changes.append(f"The calibration was scaled to {cols} × {rows} pixels.")
    return Pair(
        left,
        right,
        PairId(pictures.digest, truth.digest if truth else ""),
        truth=disparity,
        calibration=fitted,
        num_disparities=None if fitted is None else fitted.num_disparities,
        description="Your own pair.",
        changes=tuple(Change(ChangeCode.ASSEMBLED, sentence) for sentence in changes),
    )


def _fitting_truth(truth: FloatMap, left: Image) -> FloatMap:
    if truth.shape != left.shape[:2]:
        (height, width), (rows, cols) = truth.shape, left.shape[:2]
        raise ValueError(
            f"The ground truth is {width} × {height} and the left image is {cols} × {rows} pixels; "
            "they must have the same size."
        )
    return truth


def named_pair(files: PairFiles, read: Callable[[str], bytes], digest: str) -> Pair:
    """Return the pair in files matched by name, without asking; its changes say what was decided.

    Parameters
    ----------
    files
        File names.
    read
        Returns the bytes of a named file.
    digest
        Identifies the pair.

    Raises
    ------
    ValueError
        If the images cannot be read or do not fit together, or the ground truth does not fit them.
    """
    left, right = (guarded(read_image)(read(name)) for name in (files.left, files.right))
    changes: list[str] = []
    truth = None
    if files.truth is not None:
        stored = guarded(read_stored_disparity)(read(files.truth))
        divisor = stored.divisor or float(likely_divisor(stored.divided(1.0), left, right))
        truth = Truth(stored.divided(divisor), "")
        if stored.divisor is None:
            changes.append(f"The ground truth has 8 bits: ÷ {divisor:g} agrees best with a quick map.")
    calibration = None
    if files.calibrations:
        try:
            calibration = Upload("", guarded(read_calibration)(*map(read, files.calibrations)))
        except ValueError as error:
            changes.append(f"The pair’s calibration is not used. {error}")
    pair = together(Pictures(left, right, digest, tuple(changes)), truth, calibration)
    return replace(pair, description=f"Pair “{harmless(files.name)}”.")


def session_pair(session: Session, digest: str) -> Pair:
    """Return the pair of a saved session; its range is known and need not be found again."""
    ranges = [found for matcher in session.matchers if (found := matcher.search_range()) is not None]
    saved = session.document.pair
    first, count = saved.min_disparity, saved.num_disparities
    if count is None and ranges:
        first, count = ranges[0]
    return Pair(
        session.left,
        session.right,
        PairId(digest),
        truth=session.truth,
        visible=session.visible,
        calibration=session.calibration,
        min_disparity=first,
        num_disparities=count,
        description=saved.description or "Your own pair.",
        changes=tuple(Change(ChangeCode.ASSEMBLED, sentence) for sentence in saved.history),
    )
