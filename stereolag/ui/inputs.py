"""The inputs of the pages Sensor lag and Rocketman search: examples or own files, and the addresses that name them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import streamlit as st

from stereolag import samples
from stereolag.core.arrays import Vector
from stereolag.core.inputs import Image, as_image, as_signal
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.core.settings import Bounds, Problem, SettingsError
from stereolag.io.clocks import Recording, at_one_rate
from stereolag.io.formats import ACCEPTED, RECORDING_SUFFIXES
from stereolag.io.guard import guarded
from stereolag.io.images import read_image
from stereolag.io.recordings import read_signal
from stereolag.ui.addresses import SettingsAddress, example_choice
from stereolag.ui.controls import persistent
from stereolag.ui.lag.live import Frozen, listen
from stereolag.ui.lag.sentences import TRY_LISTENING, TRY_OWN_RECORDINGS, TRY_RECORDINGS, own_facts, upload_limits
from stereolag.ui.navigation import head, show_try_first
from stereolag.ui.search.hand_marks import box_in, painted_mask
from stereolag.ui.search.sentences import TRY_CAMERA, TRY_OWN_PICTURES, TRY_PICTURES
from stereolag.ui.uploads import (
    LIVE,
    OWN,
    Upload,
    choose,
    forget_together,
    image_limits,
    in_fold,
    own_or_example,
    put_together,
    show_limits,
    upload_part,
    upload_picture,
)

RECORDINGS = "recordings"


@dataclass(frozen=True, eq=False)
class RecordingPair:
    """Two recordings and their properties; None if unknown."""

    signal_1: Vector
    signal_2: Vector
    sampling_rate: float | None
    speed: float | None
    description: str
    digest: str
    shared: bool

    @property
    def longest_lag(self) -> int:
        """Return the largest lag at which the recordings can still overlap, samples."""
        return max(self.signal_1.size, self.signal_2.size) - 1


def choose_recordings() -> RecordingPair:
    """Ask which recordings to compare."""
    examples = samples.recordings()
    with head("Sensor lag"):
        chosen = choose(examples, key=RECORDINGS, live="Live")
        show_try_first({LIVE: TRY_LISTENING, OWN: TRY_OWN_RECORDINGS}.get(chosen, TRY_RECORDINGS))
    if chosen == LIVE:
        return _live_recordings()
    return own_or_example(
        chosen, _own_recordings, example_recordings, examples, key=RECORDINGS, awaited="your recordings are"
    )


def _live_recordings() -> RecordingPair:
    """Listen to the visitor's microphones; return what was frozen, and stop the page here while nothing was."""
    frozen = listen()
    pair = None if frozen is None else _frozen_pair(frozen)
    if pair is None:
        LAG_ADDRESS.write_choices()
        st.stop()
    return pair


def _frozen_pair(frozen: Frozen) -> RecordingPair | None:
    """Return what was frozen as a pair; if a channel cannot be used, show why and return the last one."""
    file = frozen.file
    digest = f"{file.digest} 1 {file.digest} 2"
    speed = None if frozen.speed == LagSearch().speed else frozen.speed
    return put_together(lambda: replace(_pair(file, 1, file, 2, digest), speed=speed), f"{RECORDINGS}.live", digest)


@st.cache_resource(show_spinner="Loading the example …")
def example_recordings(name: str) -> RecordingPair:
    """Return one of the bundled pairs of recordings."""
    example = samples.recordings()[name]
    signal_1, signal_2 = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    return RecordingPair(
        signal_1, signal_2, example.sampling_rate, example.speed, example.description, f"recordings {name}", True
    )


@in_fold(RECORDINGS)
def _own_recordings() -> RecordingPair | None:
    """Ask for two files, or for one with several channels; return the last usable pair."""
    columns = st.columns(2, gap="medium")
    with columns[0]:
        first = _recording("Sensor 1", "file_1", note=f"{ACCEPTED}. A file of two channels is enough.")
        channel_1 = _channel(first, 0, key=f"{RECORDINGS}.channel_1")
    with columns[1]:
        second = _recording("Sensor 2", "file_2")
        both_in_one = second is None and first is not None and len(first.content.channels) > 1
        holder = first if both_in_one else second
        channel_2 = _channel(holder, 1 if both_in_one else 0, key=f"{RECORDINGS}.channel_2")
    show_limits(upload_limits())
    if first is None or holder is None:
        forget_together(f"{RECORDINGS}.own")
        return None
    digest = f"{first.digest} {channel_1} {holder.digest} {channel_2}"
    return put_together(lambda: _pair(first, channel_1, holder, channel_2, digest), f"{RECORDINGS}.own", digest)


def _recording(label: str, name: str, note: str = "") -> Upload[Recording] | None:
    """Ask for a file, and for one of its tracks if it has several."""
    return upload_part(
        label,
        lambda data, track: guarded(read_signal)(data, track=track),
        lambda recording: recording.tracks,
        "Track",
        key=f"{RECORDINGS}.{name}",
        types=RECORDING_SUFFIXES,
        note=note,
    )


def _channel(file: Upload[Recording] | None, at_first: int, *, key: str) -> int:
    """Ask for the channel of a file that has several; return its number, from 1.

    `at_first` is the index of the channel that is selected initially: 0 is the first.
    """
    if file is None or len(file.content.channels) == 1:
        return 1 if file is None else file.content.numbers[0]
    names = dict(zip(file.content.numbers, file.content.names, strict=True))
    return int(
        st.selectbox(
            "Channel",
            names,
            index=at_first,
            format_func=lambda number: f"{number}: {names[number]}" if names[number] else str(number),
            key=f"{key}.{file.digest}",
        )
    )


def _pair(
    first: Upload[Recording], channel_1: int, second: Upload[Recording], channel_2: int, digest: str
) -> RecordingPair:
    """Return the two channels as a pair; ValueError if they cannot be compared."""
    one, other = at_one_rate(first.content.channel(channel_1), second.content.channel(channel_2))
    facts = own_facts((one, other), (channel_1, channel_2), (first.content.highest, second.content.highest))
    return RecordingPair(
        as_signal(one.channels[0], "The recording of sensor 1"),
        as_signal(other.channels[0], "The recording of sensor 2"),
        one.sampling_rate or other.sampling_rate,
        None,
        f"Your own recordings.  \n{facts}",
        digest,
        False,
    )


PICTURES = "pictures"


@dataclass(frozen=True, eq=False)
class PictureAndTemplate:
    """An image, the template to find in it, and a mask: above 0 where the template counts, None to use its alpha.

    `place` is the (row, col) of the template's top-left pixel, known for an example and for a template cut from the
    image. `by_hand` names the parts of an example that the visitor made by hand; such inputs are not shared.
    """

    picture: Image
    template: Image
    description: str
    digest: str
    shared: bool
    mask: Image | None = None
    place: tuple[int, int] | None = None
    by_hand: tuple[str, ...] = ()

    @property
    def own(self) -> bool:
        """Return whether the image is the visitor's own."""
        return not self.shared and not self.by_hand


def choose_pictures() -> PictureAndTemplate | None:
    """Ask for the image, the template and the file of its mask; return None if a camera is chosen instead."""
    examples = samples.mazes()
    with head("Rocketman search"):
        chosen = choose(examples, key=PICTURES, live="Camera")
        show_try_first({LIVE: TRY_CAMERA, OWN: TRY_OWN_PICTURES}.get(chosen, TRY_PICTURES))
        if chosen == LIVE:
            return None
        given = "Template: a file" if chosen == OWN else "The example’s template"
        template_from = st.segmented_control(
            "Template",
            ("given", "cut"),
            default="given",
            format_func=lambda one: given if one == "given" else "Cut from the image",
            required=True,
            **persistent(f"{PICTURES}.from"),
            label_visibility="collapsed",
        )
    cut = template_from == "cut"
    return own_or_example(
        chosen,
        _own_cut if cut else _own_pictures,
        _example_cut if cut else example_pictures,
        examples,
        key=PICTURES,
        awaited="your image is" if cut else "both images are",
    )


def with_painted_mask(inputs: PictureAndTemplate) -> PictureAndTemplate:
    """Offer to paint a mask on the template, and return the inputs with the mask painted, if any."""
    painted = painted_mask(inputs.template, inputs.mask, digest=inputs.digest, key=f"{PICTURES}.painted")
    if painted is None:
        return inputs
    by_hand = () if inputs.own else (*inputs.by_hand, "mask you painted")
    digest = f"{inputs.digest} painted {painted.digest}"
    return replace(inputs, mask=painted.content, digest=digest, shared=False, by_hand=by_hand)


@st.cache_resource(show_spinner="Loading the example …")
def example_pictures(name: str) -> PictureAndTemplate:
    """Return one of the bundled images with its template."""
    example = samples.mazes()[name]
    return PictureAndTemplate(
        read_image(example.picture),
        read_image(example.template),
        example.description,
        f"maze {name}",
        True,
        place=(example.row, example.col),
    )


@in_fold(PICTURES)
def _own_pictures() -> PictureAndTemplate | None:
    """Ask for two files and an optional mask; return the last ones that fit together."""
    columns = st.columns(3, gap="medium")
    with columns[0]:
        picture = upload_picture("Image", key=f"{PICTURES}.picture")
    with columns[1]:
        template = upload_picture(
            "Template",
            key=f"{PICTURES}.template",
            note="The thing to find, cut from the image or at the same scale. Transparent parts do not count.",
        )
    with columns[2]:
        mask = upload_picture(
            "Mask of the template (optional)",
            key=f"{PICTURES}.mask",
            note="An image of the template’s size, black where the template does not count, as around a cursor or a "
            "logo. It replaces the template’s own transparency.",
        )
    show_limits(image_limits())
    if picture is None or template is None:
        forget_together(f"{PICTURES}.own")
        return None
    return put_together(lambda: _together(picture, template, mask), f"{PICTURES}.own")


@in_fold(PICTURES)
def _own_cut() -> PictureAndTemplate | None:
    """Ask for an image file, and for a box in it."""
    picture = upload_picture("Image", key=f"{PICTURES}.picture")
    show_limits(image_limits())
    if picture is None:
        return None
    return _cut(as_image(picture.content, "image", gaps=True), "Your own image.", picture.digest, shared=False)


def _example_cut(name: str) -> PictureAndTemplate:
    example = example_pictures(name)
    return _cut(example.picture, example.description, example.digest, shared=True)


def _cut(image: Image, description: str, digest: str, *, shared: bool) -> PictureAndTemplate:
    """Ask for a box in an image, whose pixels become the template; the result is private to the visitor."""
    box = box_in(image, digest=digest, shared=shared, key=f"{PICTURES}.cut")
    template = image[box.slices]
    digest = f"{digest} cut {box.row} {box.col} {box.height} {box.width}"
    said = f"{description} The cut-out finds itself: ask for more matches, or damage the image below."
    by_hand = ("template you cut out",) if shared else ()
    return PictureAndTemplate(image, template, said, digest, False, place=(box.row, box.col), by_hand=by_hand)


def _together(picture: Upload[Image], template: Upload[Image], mask: Upload[Image] | None) -> PictureAndTemplate:
    """Return image, template and mask together; ValueError if the template does not fit the image, or the mask."""
    image, small = (
        as_image(one.content, name, gaps=True) for one, name in ((picture, "image"), (template, "template"))
    )
    (rows, cols), (height, width) = image.shape[:2], small.shape[:2]
    if height > rows or width > cols:
        swapped = " Each file fits in the other’s place: change them over." if height >= rows and width >= cols else ""
        raise ValueError(
            f"The template is {width} × {height} pixels and the image {cols} × {rows}; the template must fit into the "
            f"image.{swapped}"
        )
    digest = " ".join(one.digest for one in (picture, template, mask) if one)
    marked = None if mask is None else _fitting_mask(mask.content, small)
    return PictureAndTemplate(image, small, "Your own images.", digest, False, marked)


def _fitting_mask(mask: Image, template: Image) -> Image:
    if mask.shape[:2] != template.shape[:2]:
        (height, width), (rows, cols) = mask.shape[:2], template.shape[:2]
        raise ValueError(
            f"The mask is {width} × {height} and the template {cols} × {rows} pixels; they must have the same size."
        )
    colours = mask if mask.ndim == 2 else mask[:, :, :3]
    if not (colours > 0).any():
        raise ValueError("The mask is black all over; it must be brighter where the template counts.")
    return mask


# Their addresses

LARGEST = 10**12
"""Largest sampling rate, samples per second, and largest speed, metres per second."""

_LAG_KEYS = {"method": "lag.method", "sampling_rate": "lag.rate", "speed": "lag.speed", "max_lag": "lag.max"}


def _first_search(pair: RecordingPair) -> LagSearch:
    known = {"sampling_rate": pair.sampling_rate, "speed": pair.speed}
    return LagSearch(**{name: value for name, value in known.items() if value is not None})


def _lag_key(name: str, pair: RecordingPair) -> str:
    """Return the key of a control; all except the method belong to the recordings."""
    key = _LAG_KEYS.get(name, f"lag.{name}")
    return key if name == "method" else f"{key}.{pair.digest}"


def _check_search(search: LagSearch, pair: RecordingPair) -> None:
    """Refuse values that the page's number boxes do not accept, and values too large to draw figures with."""
    if search.max_lag is not None and search.max_lag > pair.longest_lag:
        sentence = f"max_lag is {search.max_lag}; allowed are whole numbers from 0 to {pair.longest_lag} or None."
        raise SettingsError((Problem("max_lag", sentence),))
    for name, value in (("sampling_rate", search.sampling_rate), ("speed", search.speed)):
        low = Bounds.of(LagSearch.model_fields[name]).low
        if low is not None and not low <= value <= LARGEST:
            sentence = f"{name} is {value!r}; on this page allowed are numbers from {low:g} to {LARGEST:,}."
            raise SettingsError((Problem(name, sentence),))


LAG_ADDRESS: SettingsAddress[RecordingPair, LagSearch] = SettingsAddress(
    "lag.address",
    lambda: {"recordings": example_choice(RECORDINGS, samples.recordings(), LIVE)},
    _first_search,
    _lag_key,
    _check_search,
)


TEMPLATE_ADDRESS: SettingsAddress[PictureAndTemplate | None, TemplateQuery] = SettingsAddress(
    "template.address",
    lambda: {"picture": example_choice(PICTURES, samples.mazes(), LIVE)},
    lambda inputs: TemplateQuery(),
    lambda name, inputs: f"template.{name}",
)
