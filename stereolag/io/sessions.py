"""Sessions of the depth page, saved in its section "Take it away": the files of a pair, and its settings as JSON."""

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
from stereolag.stereo.matcher import MAX_ABS_MIN_DISPARITY, MAX_NUM_DISPARITIES, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.version import VERSION

MAX_SESSION_BYTES = 2**18

SESSION = "session.json"
"""Name of the session file in an archive saved on the depth page."""

MAX_HISTORY_LINES = 20
MAX_LINE_LENGTH = 500

MAX_COLOUR_PX = 1e6
"""Maximum magnitude of the ends of the colours' range, px."""

_UNSAFE_CHARACTERS = re.compile(r"[^\w\s.,:;'’“”%°×÷–/+=?()-]|_")
_ADDRESS = re.compile(r":/+|www\.|(?<=\w)[:@](?=\w)")


def _safe_line(value: object) -> str:
    """Return a text as one harmless line, without addresses and characters with a meaning in Markdown or HTML."""
    plain = _UNSAFE_CHARACTERS.sub("", value[:MAX_LINE_LENGTH] if isinstance(value, str) else "")
    return " ".join(_ADDRESS.sub(" ", plain).split())


Line = Annotated[str, BeforeValidator(_safe_line)]
Colour = Annotated[float | None, Field(ge=-MAX_COLOUR_PX, le=MAX_COLOUR_PX, allow_inf_nan=False)]


class _Saved(BaseModel):
    """A part of a session file; missing or invalid values are replaced by the page's defaults."""

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

    `outlined` tells whether the outlines of the left image are drawn over the maps.
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
    """The pair of a session: the names of its files by role, its description and history, and its search range, px."""

    files: dict[str, str] = {}
    description: Line = ""
    history: Annotated[list[Line], AfterValidator(lambda lines: [*filter(None, lines[:MAX_HISTORY_LINES])])] = []
    num_disparities: Annotated[int | None, Field(ge=1, le=MAX_NUM_DISPARITIES)] = None
    min_disparity: Annotated[int, Field(ge=-MAX_ABS_MIN_DISPARITY, le=MAX_ABS_MIN_DISPARITY)] = 0


class SessionDocument(_Saved):
    """The content of a session file.

    Attributes
    ----------
    stereolag
        Version that wrote it.
    pair
        The pair.
    methods
        The settings of all methods, for images at the pair's full size; not validated yet.
    shown
        The short names of the methods shown, in the page's order.
    size
        Name of the size at which the pair was shown on the page; not validated.
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
    """A pair at its full size and the settings of the page, all validated.

    Attributes
    ----------
    left, right
        The images.
    truth, visible
        Ground truth, px, and mask of the pixels visible in both images, both (H, W); None if not in the archive.
    calibration
        Calibration of the pair; None if not in the archive.
    matchers
        The settings of all methods, for images of that size.
    document
        Everything else in the session file, without active Markdown.
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

    The arguments are the fields of :class:`SessionDocument`, :class:`SavedPair` and :class:`Colours`, for the images at
    the size of the files. The roles of files are "left", "right", and if known "truth", "visible" and "calibration".
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
        No session in the archive, a damaged one, images that are missing or do not fit together, or invalid settings.
    """
    what = "session file"
    parsed = parsed_json(archive.read(SESSION), what, MAX_SESSION_BYTES)
    document = SessionDocument.model_validate(parsed if isinstance(parsed, dict) else {})
    files = document.pair.files
    if not {"left", "right"} <= set(files):
        raise ValueError(f"The {what} does not name the left and the right image.")
    left, right = as_stereo_pair(*(guard(read_image)(archive.read(files[side])) for side in ("left", "right")))
    truth = guard(read_disparity)(archive.read(files["truth"])) if "truth" in files else None
    visible = None
    if "visible" in files:
        visible = guard(read_image)(archive.read(files["visible"])) > 0
        visible = visible if visible.ndim == 2 else visible[:, :, 0]
    for name, array in (("ground truth", truth), ("mask", visible)):
        if array is not None and array.shape != left.shape[:2]:
            raise ValueError(f"The {name} in the archive has another size than the left image.")
    calibration = guard(read_calibration)(archive.read(files["calibration"])) if "calibration" in files else None
    matchers = tuple(matcher_of(one, what) for one in document.methods)
    return Session(left, right, truth, visible, calibration, matchers, document)
