"""The inputs of a page: one of the examples, or the visitor's own files, read from their bytes."""

from __future__ import annotations

import functools
import hashlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar, cast

import streamlit as st

from stereolag.core.inputs import Image
from stereolag.core.jobs import limits
from stereolag.io.guard import guarded
from stereolag.io.images import IMAGE_SUFFIXES, Frame, read_frame
from stereolag.io.sources import escape, quote
from stereolag.ui import prose
from stereolag.ui.controls import last_valid, persistent
from stereolag.ui.elements import show_offer, show_refused
from stereolag.ui.streamlit_inside import Container, UploadedFile, files_shared_out

T = TypeVar("T")

REPLACEMENT_WAIT_S = 2.0
"""Time an uploader may be empty before its file counts as removed, s; replacing a file empties it first."""

MAX_SET_ASIDE_S = 120.0
"""Time within which a file that seemed removed is restored if its replacement proves unreadable, s."""

REFUSED_KEY = "uploads.refused"
"""Session-state key of whether the own files of this run were refused."""

HERE_KEY = "uploads.here"
"""Session-state key of {label of a file this run requires: whether it is there}."""


@dataclass(frozen=True, eq=False)
class Upload(Generic[T]):
    """The content read from a file; the digest is the sha256 of its bytes, followed by the variant it was read with."""

    digest: str
    content: T


@dataclass(frozen=True, eq=False)
class _Kept(Generic[T]):
    """An upload with its files and variant, and their bytes if they may have to be read again."""

    upload: Upload[T]
    source: tuple[tuple[str, ...], str | None]
    contents: list[bytes]
    said: str


@dataclass
class _State(Generic[T]):
    """The state of one uploader.

    Attributes
    ----------
    kept
        The content in use.
    refused, sentence
        Files and variant that cannot be read, and why, so that they are not read again in every rerun.
    emptied
        Whether the uploader was emptied, by the visitor or because another file is arriving.
    set_aside
        When a file seemed to be removed, and the content read from it.
    """

    kept: _Kept[T] | None = None
    refused: tuple[tuple[str, ...], str | None] | None = None
    sentence: str = ""
    emptied: bool = False
    set_aside: tuple[float, _Kept[T] | None] = (-math.inf, None)

    def forget(self) -> None:
        """Forget the content, but not what was set aside."""
        self.kept, self.refused, self.emptied = None, None, False

    def keep(
        self,
        content: T,
        files: tuple[str, ...],
        variant: str | None,
        contents: list[bytes],
        said: str = "The file you uploaded here before is still in use.",
    ) -> Upload[T]:
        """Keep the content read from the bytes of these files, in place of any other, and return it as an upload."""
        self.forget()
        upload = Upload(_digest(contents) + (variant or ""), content)
        self.kept = _Kept(upload, (files, variant), [] if variant is None else contents, said)
        return upload


def upload(
    label: str,
    read: Callable[[bytes], T],
    *,
    key: str,
    types: Sequence[str],
    note: str = "",
    variant: str | None = None,
    lasting: bool = True,
) -> Upload[T] | None:
    """Ask for a file and return its content as read by `read`, or None while there is none.

    If the file cannot be read, the reader's sentence is shown and the previous file stays in use.

    Parameters
    ----------
    label, note
        Label of the uploader, and a hint beside it.
    read
        Takes the bytes; raises ValueError with one clear sentence.
    key
        Widget key.
    types
        Extensions of the files that can be read. Others can be uploaded too, since Streamlit would drop them without
        saying why; `read` says why it refuses them.
    variant
        Anything else that the reading depends on; None if there is nothing, so that the bytes need not be kept.
    lasting
        Whether the file is still there when the visitor returns from another page or from an example.
    """
    file = st.file_uploader(label, key=key, help=_accepted(types, note), on_change=_note_emptied, args=(key,))

    def read_one(contents: list[bytes]) -> T:
        try:
            return read(contents[0])
        except ValueError as error:
            raise ValueError(f"{quote(file.name)}: {error}" if file else str(error)) from error

    given = _read_once([] if file is None else [file], read_one, key, variant, lasting)
    if "(optional)" not in label:
        st.session_state.setdefault(HERE_KEY, {})[label] = given is not None
    return given


def upload_part(
    label: str,
    read: Callable[[bytes, int], T],
    parts: Callable[[T], Sequence[str]],
    word: str,
    *,
    key: str,
    types: Sequence[str],
    note: str = "",
) -> Upload[T] | None:
    """Ask for a file, and for one of its parts if it has several, such as tracks or frames.

    Parameters
    ----------
    read
        Takes the bytes and the number of a part, from 1.
    parts
        Returns the names of all parts of the file from the content read.
    word
        Name of such a part: "Track".
    label, key, types, note
        As for :func:`upload`.
    """
    held = st.session_state.get(key)
    chooser = f"{key}.{word.lower()}.{held.file_id if held else ''}"  # another file has other parts
    number: int = st.session_state.get(chooser, 1)
    file = upload(
        label,
        lambda data: read(data, number),
        key=key,
        types=types,
        note=note,
        variant=f" {word.lower()} {number}" if number != 1 else "",
    )
    names = [] if file is None else parts(file.content)
    if len(names) > 1:
        st.selectbox(word, range(1, len(names) + 1), format_func=lambda one: names[one - 1], key=chooser)
    return file


MAX_OFFERED_FRAMES = 10_000
"""Number of frames of a file that can be chosen, so that a hostile file does not fill the page."""


def frame_names(content: object) -> list[str]:
    """Return the names of all frames of a frame's file; none for other content."""
    count = content.count if isinstance(content, Frame) else 0
    return [f"{number} of {count}" for number in range(1, min(count, MAX_OFFERED_FRAMES) + 1)]


def upload_picture(label: str, *, key: str, note: str = "") -> Upload[Image] | None:
    """Ask for an image, and for one of its frames if it has several; as :func:`upload`."""
    file = upload_part(label, guarded(read_frame), frame_names, "Frame", key=key, types=IMAGE_SUFFIXES, note=note)
    return None if file is None else Upload(file.digest, file.content.pixels)


def upload_named(
    label: str,
    read: Callable[[Sequence[tuple[str, bytes]]], T],
    *,
    key: str,
    types: Sequence[str],
    note: str = "",
    variant: str | None = None,
) -> Upload[T] | None:
    """Ask for files and return the content read from all of them and their names, as :func:`upload` does for one.

    They are read in order of name, not of arrival: left before right, camera 0 before camera 1.
    """
    files = sorted(
        st.file_uploader(
            label,
            key=key,
            help=_accepted(types, note),
            accept_multiple_files=True,
            on_change=_note_emptied,
            args=(key,),
        ),
        key=lambda file: file.name.lower(),
    )
    names = [file.name for file in files]
    return _read_once(files, lambda contents: read([*zip(names, contents, strict=True)]), key, variant)


def _accepted(types: Sequence[str], note: str) -> str:
    """Return the help of an uploader: a note, and the accepted types of files."""
    return " ".join(filter(None, (note, f"Accepted: {', '.join(one.upper() for one in types)}.")))


def put_together(make: Callable[[], T] | None, key: str, digest: str | None = None) -> T | None:
    """Return the combination of several uploads; if they do not fit together, show why and return the last one.

    If some are missing, `make` is None, and the last combination is forgotten. If the `digest` of the combination is
    given and unchanged, it is not made again.
    """
    kept: T | None = st.session_state.get(key)
    if make is None:
        st.session_state.pop(key, None)
        return None
    if digest is not None and getattr(kept, "digest", None) == digest:
        return kept
    made = last_valid(make, key, "{}" if kept is None else "{} The previous files stay in use.")
    st.session_state[REFUSED_KEY] = made is None
    return made


def refuse(sentence: str) -> None:
    """Show why an input cannot be used, if there is no previous one to use instead."""
    show_refused(sentence)
    st.session_state[REFUSED_KEY] = True


def _read_once(
    files: Sequence[UploadedFile],
    read: Callable[[list[bytes]], T],
    key: str,
    variant: str | None,
    lasting: bool = True,
) -> Upload[T] | None:
    """Return the content of these files, read before or now; show why if they cannot be read."""
    state: _State[T] = _state(key)
    if not files:
        if state.kept is not None and lasting and state.emptied:
            _wait_for_another()
            state.set_aside = time.monotonic(), state.kept
            state.forget()
        if state.kept is None or not lasting:
            state.forget()
            return None
        show_offer(state.kept.said, "Remove", f"{key}.remove", state.forget)
        source, contents = (state.kept.source[0], variant), state.kept.contents
    else:
        state.emptied = False
        source, contents = (tuple(file.file_id for file in files), variant), [file.getvalue() for file in files]
    if state.kept is not None and state.kept.source == source:
        return state.kept.upload
    if state.kept is None:
        moment, before = state.set_aside
        state.set_aside = -math.inf, None
        state.kept = before if time.monotonic() - moment <= MAX_SET_ASIDE_S else None
    if state.refused != source:
        try:
            with st.spinner("Reading the file …"):
                return state.keep(read(contents), *source, contents)
        except ValueError as error:
            state.refused, state.sentence = source, str(error)
    if state.kept is None:
        refuse(state.sentence)
        return None
    show_refused(f"{state.sentence} The previous file stays in use.")
    return state.kept.upload


def hand_in(
    files: Sequence[tuple[str, bytes]],
    read: Callable[[Sequence[tuple[str, bytes]]], T],
    said: str,
    *,
    key: str,
    variant: str | None = None,
) -> None:
    """Use files as those of the uploader `key`, like :func:`upload_named`; `said` tells the visitor about them."""
    contents = [content for _, content in files]
    _state(key).keep(read(files), (_digest(contents),), variant, contents, said)


def hand_in_picture(data: bytes, said: str, *, key: str) -> None:
    """Use a picture as that of the uploader `key`, like :func:`upload_picture`; `said` tells the visitor about it."""
    hand_in([("", data)], lambda files: guarded(read_frame)(files[0][1]), said, key=key, variant="")


def forget_upload(key: str) -> None:
    """Forget the file of the uploader `key`."""
    _state(key).forget()


def _digest(contents: Sequence[bytes]) -> str:
    return " ".join(hashlib.sha256(content).hexdigest() for content in contents)


def _state(key: str) -> _State[Any]:
    return cast(_State[Any], st.session_state.setdefault(f"{key}.state", _State()))


def _wait_for_another() -> None:
    """Return once no other file has arrived for a while; if one does, its rerun of the page ends this run here."""
    end = time.monotonic() + REPLACEMENT_WAIT_S
    with st.spinner("Removing the file …"):
        pulse = st.empty()
        while time.monotonic() < end:
            time.sleep(0.05)
            pulse.empty()


def _note_emptied(key: str) -> None:
    if not st.session_state[key]:
        _state(key).emptied = True


# An example, or own files

OWN = "own"
LIVE = "live"

GONE = (
    "The files of this page are gone: they last as long as the session they were added in, which ends when the page "
    "is reloaded, the server restarts or the connection is lost for too long. Add them again; the settings are kept."
)


class Example(Protocol):
    """The interface of every bundled example."""

    @property
    def title(self) -> str:
        """Return the heading."""


def choose(examples: Mapping[str, Example], *, key: str, live: str = "") -> str:
    """Return the name of the chosen example, ``OWN``, or ``LIVE`` if that is offered, under the title `live`."""
    titles = {name: one.title for name, one in examples.items()} | {OWN: "Your own files"}
    if live:
        titles[LIVE] = live
    chosen = st.segmented_control(
        "Inputs",
        [*titles],
        default=next(iter(examples)),
        format_func=titles.__getitem__,
        required=True,
        **persistent(key),
        label_visibility="collapsed",
    )
    # Own files are initially selected only by an address, or by a browser that remembers an earlier session.
    st.session_state.setdefault(f"{key}.gone", chosen == OWN)
    if chosen in examples:
        st.session_state[f"{key}.example"] = chosen
    return str(chosen)


def no_files_yet(key: str) -> None:
    """Record that a visitor led to "own files" has not uploaded any yet, so that none are reported as gone."""
    st.session_state[f"{key}.gone"] = False


def own_or_example(
    chosen: str,
    ask: Callable[[], T | None],
    load: Callable[[str], T],
    examples: Mapping[str, Example],
    *,
    key: str,
    awaited: str,
    notes: Container | None = None,
) -> T:
    """Return the chosen inputs; stop the page here if the visitor's own files were refused, or are gone.

    Parameters
    ----------
    chosen
        Return value of :func:`choose`.
    ask
        Asks for the visitor's own files; returns None while some are missing.
    load
        Loads an example by its name.
    examples, key
        The arguments given to :func:`choose`.
    awaited
        Subject and verb of the notice shown until the visitor's files are there: "both images are".
    notes
        Where to say how several files dropped together were distributed; here if None.
    """
    if chosen != OWN:
        return load(chosen)
    st.session_state.update({REFUSED_KEY: False, HERE_KEY: {}})
    # Always there: anything that moves the boxes below makes them be drawn again, without their files.
    place = (notes or st).empty()
    if shared := files_shared_out():
        went = (f"{quote(name)} {f'went to **{escape(box)}**' if box else 'was not taken'}" for name, box in shared)
        place.caption(f"Dropped together: {', '.join(went)}.", width="content")
    own = ask()
    if own is not None:
        st.session_state[f"{key}.gone"] = False
        return own
    if st.session_state[REFUSED_KEY]:
        # Do not show results of an example below a refused file.
        st.stop()
    if st.session_state[f"{key}.gone"]:
        prose.warning(GONE, icon=":material/cloud_off:")
        st.stop()  # results of an example must not be mistaken for those of the files
    name: str = st.session_state.get(f"{key}.example", next(iter(examples)))
    here: dict[str, bool] = st.session_state[HERE_KEY]
    missing = [label for label, is_here in here.items() if not is_here] if any(here.values()) else []
    until = f"Still missing: {', '.join(missing)}. Until then" if missing else f"Until {awaited} here,"
    prose.info(f"{until} the page shows the example “{examples[name].title}”.", icon=":material/upload_file:")
    return load(name)


def in_fold(key: str) -> Callable[[Callable[[], T | None]], Callable[[], T | None]]:
    """Return a decorator that draws the uploaders of a page in a fold: open while files are missing, then closed.

    It is closed only once, so the visitor can open it again. `key` is the one given to :func:`choose`.
    """
    fold, there, opening = f"{key}.fold", f"{key}.there", f"{key}.fold.opening"

    def folded(ask: Callable[[], T | None]) -> Callable[[], T | None]:
        @functools.wraps(ask)
        def asked() -> T | None:
            st.session_state[fold] = st.session_state.pop(opening, st.session_state.get(fold, True))
            with st.expander("Your own files", icon=":material/upload_file:", key=fold, on_change="rerun"):
                own = ask()
            if st.session_state.get(there, False) != (own is not None):
                st.session_state[there], st.session_state[opening] = own is not None, own is None
                st.rerun()
            return own

        return asked

    return folded


def show_limits(largest: str) -> None:
    """Show the size limits of files, and that files stay in the visitor's session."""
    prose.caption(f"{largest} Your files stay in this session: nothing is written to disk or shown to anyone else.")


def image_limits() -> str:
    """Return a sentence about the size limits of an image file."""
    return f"Images may have up to {st.get_option('server.maxUploadSize')} MB and {limits().max_megapixels} megapixels."
