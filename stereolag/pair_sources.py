"""The sources of stereo pairs: a picture with both views, a bundled example, a saved session, a set of files."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

from stereolag.assess.layout import Layout, in_words, likely_layout, views, without_margins
from stereolag.core.inputs import Image
from stereolag.io.disparities import read_disparity, read_stored_disparity
from stereolag.io.ground_truth import truth_in_px
from stereolag.io.guard import Guard, guarded, unguarded
from stereolag.io.images import read_frame, read_image
from stereolag.io.sources import MAX_BYTES, Source, escape, is_archive, quote, read_archive, read_bytes
from stereolag.pair import OWN_PAIR, Change, ChangeCode, Pair, PairId, assemble_pair

if TYPE_CHECKING:  # a command loads only what it reads
    from stereolag.io.pairing import PairFiles
    from stereolag.io.sessions import Session
    from stereolag.samples import StereoExample

NO_PAIRS = (
    "None of these files are a pair: the names of its two images must differ in the side, as in left.png and "
    "right.png, im0.png and im1.png, or left/5.png and right/5.png."
)


class OneView(ValueError):  # noqa: N818
    """A picture that shows only one view."""


def read_views(source: Source, layout: Layout | None = None, *, guard: Guard = unguarded) -> tuple[Image, Image, str]:
    """Return the left and the right view of one picture, and a sentence about how it was divided.

    Parameters
    ----------
    source
        An MPO, a spatial photo of a phone (HEIC), or another file of two frames; or one picture with both views, such
        as JPS and PNS.
    layout
        How the views are arranged in it, the left one first; None: two frames, or found from the picture itself.
    guard
        :func:`~stereolag.io.guard.guarded` to decode untrusted files in the guard process.

    Raises
    ------
    OneView
        A picture that shows only one view.
    ValueError
        A file that is refused, or an anaglyph.
    """
    data = read_bytes(source, "image")
    first = guard(read_frame)(data, 1)
    if first.count == 2 and layout is None:
        return (
            first.pixels,
            guard(read_frame)(data, 2).pixels,
            "The image holds two frames: the left view, and the right.",
        )
    return likely_views(first.pixels, layout)


def likely_views(image: Image, layout: Layout | None = None) -> tuple[Image, Image, str]:
    """Return the left and the right view in an image, and a sentence about it; raise as :func:`read_views`."""
    found = likely_layout(image) if layout is None else (layout, False)
    if found is None:
        raise OneView("The image holds one view, as far as is to be seen: give the other one too, or their layout.")
    left, right = views(without_margins(image, found[0]), found[0], crossed=found[1])
    return left, right, in_words(image, found[0], crossed=found[1])


@cache
def example_pair(example: StereoExample) -> Pair:
    """Return a bundled pair."""
    from stereolag.io.calibrations import read_calibration

    return Pair(
        read_image(example.left),
        read_image(example.right),
        PairId(f"pair {example.name}"),
        truth=read_disparity(example.disparity),
        visible=read_image(example.occlusion) == 0,
        calibration=read_calibration(example.calibration),
        num_disparities=example.num_disparities,
        description=example.description,
        shared=True,
    )


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
        description=saved.description or OWN_PAIR,
        changes=tuple(Change(ChangeCode.ASSEMBLED, sentence) for sentence in saved.history),
    )


@dataclass(frozen=True, eq=False)
class PairSet:
    """Pairs in encoded files; a pair is decoded when it is needed.

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

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.pairs)

    def name(self, number: int) -> str:
        """Return the name of a pair, escaped for display."""
        return escape(self.pairs[number].name)

    def pair(self, number: int) -> Pair:
        """Decode one pair; its changes describe the decisions made.

        Raises
        ------
        ValueError
            The images cannot be read or do not fit together, or the ground truth does not fit them.
        """
        try:
            return self._pair(self.pairs[number], PairId(f"{self.digest} {number}", collection=self.digest))
        except ValueError as error:
            raise ValueError(f"Pair {self.name(number)}: {error}") from error

    def _pair(self, files: PairFiles, pair_id: PairId) -> Pair:
        left, right = (guarded(read_image)(self.read(name)) for name in (files.left, files.right))
        notes: list[str] = []
        truth = calibration = None
        if files.truth is not None:
            stored = guarded(read_stored_disparity)(self.read(files.truth))
            try:
                truth, about_truth = truth_in_px(stored, left, right)
                notes += filter(None, (about_truth,))
            except ValueError as error:
                notes.append(f"The pair’s ground truth is not used. {error}")
        if files.calibrations:
            from stereolag.io.calibrations import read_calibration

            try:
                calibration = guarded(read_calibration)(*map(self.read, files.calibrations))
            except ValueError as error:
                notes.append(f"The pair’s calibration is not used. {error}")
        description = f"Pair “{escape(files.name)}”."
        notes.append(f"{quote(files.left)} is the left image, {quote(files.right)} the right one.")
        return assemble_pair(left, right, truth, calibration, id=pair_id, notes=notes, description=description)


Bundle: TypeAlias = "Session | PairSet"
"""The possible contents of an archive or of several files."""


def read_bundle(files: Sequence[tuple[str, bytes]]) -> Bundle:
    """Return the session or the pairs in an archive or in named files.

    Raises
    ------
    ValueError
        There is neither, or the files are too large.
    """
    from stereolag.io.pairing import matched_pairs
    from stereolag.io.sessions import SESSION, read_session

    digest = hashlib.sha256(b"".join(hashlib.sha256(data).digest() for _, data in files)).hexdigest()
    if len(files) == 1 and is_archive(files[0][1]):
        archive = read_archive(files[0][1])
        if SESSION in archive.names:
            return read_session(archive, guarded)
        names, read = archive.names, archive.read
    elif sum(len(data) for _, data in files) > MAX_BYTES:
        raise ValueError(f"The files exceed {MAX_BYTES // 2**20} MB in total, the most that is accepted.")
    else:
        by_name = dict(files)
        names, read = tuple(by_name), lambda name: by_name[name]
    pairs = matched_pairs(names)
    if not pairs:
        raise ValueError(NO_PAIRS)
    return PairSet(tuple(pairs), read, digest)
