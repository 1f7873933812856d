"""Sessions of the depth page, saved in its section "Take it away": the files of a pair, and settings as JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)

from stereolag.core.arrays import FloatMap, Mask
from stereolag.core.inputs import Image, as_stereo_pair
from stereolag.geometry.calibration import Calibration
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.guard import Guard, unguarded
from stereolag.io.images import read_image
from stereolag.io.settings import matcher_of, parsed_json, settings_document
from stereolag.io.sources import Archive
from stereolag.stereo.matcher import FARTHEST_FIRST, LARGEST_COUNT, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.version import VERSION

MAX_SESSION_BYTES = 2**18

SESSION = "session.json"
"""Name of the session file in an archive saved on the depth page."""
MOST_SENTENCES = 20
LONGEST_TEXT = 500
LARGEST_COLOUR = 1e6

_ACTIVE = re.compile(r"[^\w\s.,:;'’“”%°×÷–/+=?()-]|_")
_ADDRESS = re.compile(r":/+|www\.|(?<=\w)[:@](?=\w)")


def _line(value: object) -> str:
    """Return a text as one harmless line, without addresses and without characters active in Markdown or HTML."""
    plain = _ACTIVE.sub("", value[:LONGEST_TEXT] if isinstance(value, str) else "")
    return " ".join(_ADDRESS.sub(" ", plain).split())


Line = Annotated[str, BeforeValidator(_line)]
Colour = Annotated[float | None, Field(ge=-LARGEST_COLOUR, le=LARGEST_COLOUR, allow_inf_nan=False)]


class _Saved(BaseModel):
    """A part of a session file; values that are missing or not allowed become the page's defaults."""

    model_config = ConfigDict(strict=True)

    @field_validator("*", mode="wrap")
    @classmethod
    def _allowed_or_default(cls, value: object, check: ValidatorFunctionWrapHandler, field: ValidationInfo) -> Any:
        try:
            return check(value)
        except ValidationError:
            return cls.model_fields[field.field_name or ""].get_default()


class Colours(_Saved):
    """The colours of the maps: the palette's name, "" if none is named; the range, px, None if the page chooses it.

    `outlined`: whether the outlines of the left image are drawn over the maps.
    """

    palette: Line = ""
    inverted: bool = False
    outlined: bool = False
    low: Colour = None
    high: Colour = None

    @model_validator(mode="after")
    def _has_both_ends_or_none(self) -> Self:
        if self.low is None or self.high is None or not self.low < self.high:
            self.low = self.high = None
        return self


class SavedPair(_Saved):
    """The pair of a session: the names of its files by role, its description, and the range that it needs, px."""

    files: dict[str, str] = {}
    description: Line = ""
    history: Annotated[list[Line], AfterValidator(lambda lines: [*filter(None, lines[:MOST_SENTENCES])])] = []
    num_disparities: Annotated[int | None, Field(ge=1, le=LARGEST_COUNT)] = None
    min_disparity: Annotated[int, Field(ge=-FARTHEST_FIRST, le=FARTHEST_FIRST)] = 0


class SessionDocument(_Saved):
    """The content of a session file.

    Attributes
    ----------
    stereolag
        Version that wrote it.
    pair
        The pair.
    methods
        The settings of all methods, for images of the pair's own size; not checked yet.
    shown
        The short names of the methods shown, in the page's order.
    size
        Name of the size at which the pair was shown on the page; untrusted.
    colours
        The colours of the maps.
    """

    stereolag: Line = ""
    pair: SavedPair = SavedPair()
    methods: Annotated[list[Any], AfterValidator(lambda methods: methods[: len(METHODS)])] = []
    shown: Annotated[
        list[Any], AfterValidator(lambda names: [it.short_name for it in METHODS if it.short_name in names])
    ] = []
    size: Line = ""
    colours: Colours = Colours()


@dataclass(frozen=True, eq=False)
class Session:
    """A pair at its own size and the settings of the page, all checked.

    Attributes
    ----------
    left, right
        The images.
    truth, visible
        (H, W) px and bool; None if missing in the archive.
    calibration
        Calibration of the pair; None if missing in the archive.
    matchers
        The settings of all methods, for images of that size.
    document
        Everything else that the session file says, without any active Markdown.
    """

    left: Image
    right: Image
    truth: FloatMap | None
    visible: Mask | None
    calibration: Calibration | None
    matchers: tuple[StereoMatcher, ...]
    document: SessionDocument


def session_json(
    *,
    files: Mapping[str, str],
    matchers: Sequence[StereoMatcher],
    shown: Sequence[str],
    size: str,
    colours: Mapping[str, Any],
    description: str = "",
    history: Sequence[str] = (),
    num_disparities: int | None = None,
    min_disparity: int = 0,
) -> str:
    """Return a session as JSON.

    Its arguments are the fields of :class:`SessionDocument`, :class:`SavedPair` and :class:`Colours`, for the images as
    they are in the files: their names by role are "left", "right", and if known "truth", "visible" and "calibration".
    The range of the colours, "low" and "high", is given only if the visitor chose it.
    """
    document = SessionDocument.model_construct(
        stereolag=VERSION,
        pair=SavedPair.model_construct(
            files=dict(files),
            description=description,
            history=list(history),
            num_disparities=num_disparities,
            min_disparity=min_disparity,
        ),
        methods=[settings_document(matcher) for matcher in matchers],
        shown=list(shown),
        size=size,
        colours=Colours.model_construct(**colours),
    )
    return json.dumps(document.model_dump(exclude_unset=True), indent=2) + "\n"


def read_session(archive: Archive, guard: Guard = unguarded) -> Session:
    """Read an archive saved on the depth page; `guard` decides where its files are read.

    Raises
    ------
    ValueError
        No session in the archive, a damaged one, images that are missing or do not fit together, or settings that are
        refused.
    """
    what = "session file"
    parsed = parsed_json(archive.read(SESSION), what, MAX_SESSION_BYTES)
    document = SessionDocument.model_validate(parsed if isinstance(parsed, dict) else {})
    files = document.pair.files
    if not {"left", "right"} <= set(files):
        raise ValueError(f"The {what} does not name the left and the right image.")
    left, right = as_stereo_pair(*(guard(read_image)(archive.read(files[side])) for side in ("left", "right")))
    truth = visible = None
    if "truth" in files:
        truth = guard(read_disparity)(archive.read(files["truth"]))
    if "visible" in files:
        visible = guard(read_image)(archive.read(files["visible"])) > 0
        visible = visible if visible.ndim == 2 else visible[:, :, 0]
    for name, found in (("ground truth", truth), ("mask", visible)):
        if found is not None and found.shape != left.shape[:2]:
            raise ValueError(f"The {name} in the archive has another size than the left image.")
    calibration = guard(read_calibration)(archive.read(files["calibration"])) if "calibration" in files else None
    matchers = tuple(matcher_of(one, what) for one in document.methods)
    return Session(left, right, truth, visible, calibration, matchers, document)
