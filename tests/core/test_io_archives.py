"""ZIP archives: contents survive; bombs, lies and odd names are refused in a sentence, at little cost."""

import io
import struct
import time
import tracemalloc
import zipfile
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolag.io.sources import MAX_BYTES, bundle, file_name, is_archive, read_archive
from tests.archives import zipped

names = st.dictionaries(st.text(max_size=300), st.binary(max_size=50), min_size=1, max_size=4)


@given(names)
@settings(max_examples=15)
def test_any_names_give_harmless_ones_with_their_bytes(files):
    try:
        data = bundle(files)
    except ValueError as error:
        assert "several that become" in str(error)
        return
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == [file_name(name) for name in files]
        assert [archive.read(name) for name in archive.namelist()] == list(files.values())


@given(st.text(max_size=300))
def test_a_file_name_is_harmless_and_stays_so(name):
    safe = file_name(name)
    assert safe
    assert len(safe.encode()) <= 255
    assert not set(safe) & set('/\\:*?"<>|[]()`#! \n\0')
    assert safe[0] not in "-._"
    assert safe[-1] not in "."


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("disparity_map-2.pfm", "disparity_map-2.pfm"),
        ("../../etc/passwd", "passwd"),
        ("C:\\users\\me\\left.png", "left.png"),
        ("**bold** [x](http://y).png", "y-.png"),
        ("links – Kopie (2).PNG", "links-Kopie-2-.PNG"),
        ("Größe.png", "Größe.png"),
        ("..", "file"),
        ("", "file"),
        ("con.txt", "file-con.txt"),
        (".hidden", "hidden"),
        ("x" * 300 + ".png", "x" * 50 + ".png"),
    ],
)
def test_file_names(name, expected):
    assert file_name(name) == expected


@pytest.mark.parametrize("files", [{}, {"a/x.png": b"", "b/x.png": b""}, {"A.png": b"", "a.PNG": b""}])
def test_no_files_and_two_of_one_name_are_refused(files):
    with pytest.raises(ValueError, match=r"empty|several that become (x\.png|A\.png, a\.PNG);"):
        bundle(files)


MB = 2**20


def directory_of(data: bytes) -> int:
    """Return the offset of the directory of an archive."""
    return struct.unpack("<I", data[-6:-2])[0]


def changed(data: bytes, place: int, layout: str, value: int) -> bytes:
    """Return the archive with a number replaced in the first entry of its directory."""
    found = bytearray(data)
    struct.pack_into(layout, found, directory_of(data) + place, value)
    return bytes(found)


def liar(stated: int) -> bytes:
    """Return an archive of a 16 MB file that states another size."""
    return changed(zipped({"left.png": bytes(16 * MB)}, method=zipfile.ZIP_DEFLATED), 24, "<I", stated)


def end_of_archive(files: int = 0, directory_bytes: int = 0, directory_begin: int = 0) -> bytes:
    return struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, files, files, directory_bytes, directory_begin, 0)


def overlapping() -> bytes:
    """Return an archive whose entries all refer to the same 16 MB file (D. Fifield, 2019)."""
    data = zipped({"a": bytes(16 * MB)}, method=zipfile.ZIP_DEFLATED)
    begin = directory_of(data)
    entry = data[begin:-22]
    entries = b"".join(entry[:46] + bytes([97 + number]) for number in range(20))
    return data[:begin] + entries + end_of_archive(20, len(entries), begin)


HOSTILE: dict[str, tuple[Callable[[], bytes], str]] = {
    "a bomb of overlapping files": (overlapping, "320 MB unpacked; at most 256 MB"),
    "4 GB stated": (lambda: liar(2**32 - 2), "4,096 MB unpacked"),
    "3,000 files": (lambda: zipped({f"{number}.png": b"" for number in range(3000)}), "3,000 files; at most 2,000"),
    "a directory of 2 MB": (lambda: bytes(2 * MB) + end_of_archive(9, 2 * MB), "a directory of 2 MB"),
    "ZIP64": (lambda: b"PK\x06\x07" + bytes(16) + end_of_archive(), "more than 4 GB"),
    "encrypted": (lambda: changed(zipped({"left.png": b"1"}), 8, "<H", 1), "is encrypted"),
    "LZMA": (lambda: zipped({"a.png": b"1"}, method=zipfile.ZIP_LZMA), "a method other than “deflate”"),
    "bzip2": (lambda: zipped({"a.png": b"1"}, method=zipfile.ZIP_BZIP2), "a method other than “deflate”"),
    "a name that leads up": (lambda: zipped({"../../etc/passwd": b"1"}), "points outside it"),
    "a name from the root": (lambda: zipped({"/etc/passwd": b"1"}), "points outside it"),
    "a name with a drive": (lambda: zipped({"C:\\windows\\left.png": b"1"}), "points outside it"),
    "a name of 1,000 letters": (lambda: zipped({"a" * 1000: b"1"}), "too long a name"),
    "folders in folders": (lambda: zipped({"a/" * 50 + "b": b"1"}), "too long a name"),
    "folders alone": (lambda: zipped({"a/": b"", "__MACOSX/a": b"", ".hidden": b""}), "holds no files"),
    "nothing": (end_of_archive, "holds no files"),
    "two of one name": (lambda: zipped({"a": b"1", "b": b"2"}).replace(b"b", b"a"), "two files named “a”"),
    "no archive": (lambda: b"PK\x03\x04 and nothing more", "damaged or cut short"),
    "20 MB of ends": (lambda: b"PK\5\6" * (5 * MB), "damaged or cut short|a directory of"),
    "a name of Markdown": (lambda: zipped({"../![x](http://e.org)": b"1"}), r"“\.\./\?\(x\)\(http:\?e\.org\)” in"),
    "empty": (lambda: b"", "empty file"),
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_hostile_archive_is_refused_in_time_and_memory(name: str) -> None:
    make, sentence = HOSTILE[name]
    data = make()
    tracemalloc.start()
    start = time.process_time()
    with pytest.raises(ValueError, match=sentence) as caught:
        read_archive(data)
    seconds, peak = time.process_time() - start, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(str(caught.value)) < 250
    assert "\n" not in str(caught.value)
    assert seconds < 5
    assert peak < 40 * MB


@pytest.mark.parametrize("stated", [10, 100 * MB])
def test_a_file_that_states_another_size_is_damaged(stated: int) -> None:
    archive = read_archive(liar(stated))
    tracemalloc.start()
    with pytest.raises(ValueError, match=r"“left\.png” in the archive is damaged"):
        archive.read("left.png")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MAX_BYTES


def test_every_cut_archive_is_refused_or_its_files_are_whole() -> None:
    whole = zipped({"a/left.png": bytes(range(256)), "a/right.png": b"2" * 999})
    for length in range(0, len(whole), 7):
        with pytest.raises(ValueError, match="archive"):
            read_archive(whole[:length])


@given(st.data())
def test_a_changed_archive_gives_what_was_in_it_or_a_sentence(data: st.DataObject) -> None:
    files = {"left.png": bytes(range(200)), "right.png": b"2" * 500}
    found = bytearray(zipped(files))
    for _ in range(data.draw(st.integers(1, 4))):
        found[data.draw(st.integers(0, len(found) - 1))] = data.draw(st.integers(0, 255))
    try:
        archive = read_archive(bytes(found))
        for name in archive.names:
            assert archive.read(name) in (*files.values(), b"")
    except ValueError as error:
        assert "archive" in str(error)


def test_what_is_taken_away_is_read_but_not_folders_and_what_systems_add() -> None:
    files = {"left.png": np.arange(9, dtype=np.uint8).tobytes(), "settings.json": b"{}"}
    data = bundle(files)
    assert data == bundle(dict(files))
    assert is_archive(data)
    assert not is_archive(b"\x89PNG")
    archive = read_archive(io.BytesIO(data))
    assert archive.names == tuple(files)
    assert {name: archive.read(name) for name in archive.names} == files
    with pytest.raises(ValueError, match="holds no “b”"):
        archive.read("b")
    more = {"set/": b"", "set/left.png": b"1", "__MACOSX/set/._left.png": b"", "set/.DS_Store": b"", "Thumbs.db": b""}
    assert read_archive(zipped(more)).names == ("set/left.png",)
