"""Formats of recordings and of other files, recognised by their first bytes; the list of accepted formats."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass

WHAT = "recording"
"""The name of these files in errors."""


@dataclass(frozen=True)
class SoundFormat:
    """A file format that holds sound.

    Attributes
    ----------
    name, suffixes
        Its name, and the suffixes of its files.
    mark
        Matches the beginning of its files.
    demuxer
        Its reader in FFmpeg.
    is_audio
        Whether libsndfile reads it first, and FFmpeg only if that fails.
    states_delay
        Whether it can state the delay that its codec adds at the beginning.
    """

    name: str
    suffixes: tuple[str, ...]
    mark: re.Pattern[bytes]
    demuxer: str
    is_audio: bool = False
    states_delay: bool = True

    @property
    def a_file(self) -> str:
        """The format in a sentence: "an MP3 file"."""
        return f"{'an' if self.name in _AFTER_AN else 'a'} {self.name} file"


_AFTER_AN = {"AAC", "AIFF", "AMR", "AU", "AVI", "FLV", "MP3", "MP4", "MPEG", "MPEG-TS", "OGG"}


def _format(name: str, suffixes: str, mark: bytes, demuxer: str, **facts: bool) -> SoundFormat:
    return SoundFormat(name, tuple(suffixes.split()), re.compile(mark, re.DOTALL), demuxer, **facts)


SOUND_FORMATS = (
    _format("WAV", "wav", rb"(?:RIF[FX]|RF64|BW64)(?!....(?:AVI |WEBP))", "wav", is_audio=True),
    _format("W64", "w64", rb"riff\x2e\x91\xcf\x11", "w64", is_audio=True),
    _format("FLAC", "flac", rb"fLaC", "flac", is_audio=True),
    _format("OGG", "ogg oga opus", rb"OggS", "ogg", is_audio=True),
    _format("MP3", "mp3", rb"ID3|\xff[\xfb\xfa\xf3\xf2\xe3\xe2]", "mp3", is_audio=True),
    _format("AIFF", "aif aiff aifc", rb"FORM(?:....AIF[FC]|.{0,7}\Z)", "aiff", is_audio=True),
    _format("AU", "au snd", rb"\.snd\0|dns\..\0", "au", is_audio=True),
    _format("CAF", "caf", rb"caff\0", "caf", is_audio=True),
    _format("MP4", "mp4 m4a m4v mov 3gp", rb"....(?:ftyp|mdat)|\0...(?:moov|wide|free|skip)", "mov"),
    _format("Matroska", "mkv mka webm", rb"\x1aE\xdf\xa3", "matroska"),
    _format("AVI", "avi", rb"RIFF....AVI ", "avi", states_delay=False),
    _format("AAC", "aac", rb"\xff[\xf0\xf1\xf8\xf9]", "aac", states_delay=False),
    _format("AMR", "amr", rb"#!AMR", "amr", states_delay=False),
    _format("Windows Media", "wma wmv asf", rb"\x30\x26\xb2\x75\x8e\x66\xcf\x11", "asf", states_delay=False),
    _format("FLV", "flv", rb"FLV\x01", "flv", states_delay=False),
    _format("MPEG", "mpg mpeg", rb"\0\0\x01\xba", "mpeg", states_delay=False),
    _format("MPEG-TS", "mts m2ts ts", rb"(?:....)?G.{187,191}G.{187,191}G", "mpegts", states_delay=False),
)


RECORDING_SUFFIXES = (
    *(suffix for one in SOUND_FORMATS for suffix in one.suffixes),
    *("npy", "npz", "mat"),
    *("csv", "txt", "tsv", "dat", "asc", "lvm", "log", "json", "jsonl"),
)
ACCEPTED = (
    f"{', '.join(one.name for one in SOUND_FORMATS if one.is_audio)}; the sound of MP4, M4A, MOV, MKV, WebM, AVI, AAC, "
    "3GP, AMR, Windows Media, FLV and MPEG; NPY, NPZ and MAT; and columns of numbers (CSV, TXT)"
)

EXPORT_NUMBERS = "export its numbers as CSV, NPY or WAV"
UNPACK = "unpack it"
_NOT_A_RECORDING = "a recording is sound or numbers"
FOREIGN_FORMATS = tuple(
    (re.compile(mark, re.DOTALL), name, remedy)
    for mark, name, remedy in (
        (rb"MATLAB 7\.\d MAT-file", "a MATLAB file of version 7.3 (HDF5)", "save it by save(file, '-v7')"),
        (rb"\x89HDF", "an HDF5 file", EXPORT_NUMBERS),
        (rb"\xd0\xcf\x11\xe0", "a file of older Excel or Word (XLS, DOC)", "save the sheet as CSV"),
        (rb"TDSm", "a TDMS file of LabVIEW", EXPORT_NUMBERS),
        (rb"0 {7}[^\n]{160}\d\d\.\d\d\.\d\d|\xffBIOSEMI", "an EDF or BDF file", EXPORT_NUMBERS),
        (rb"PAR1|ARROW1|FEA1", "a Parquet or Arrow file", EXPORT_NUMBERS),
        (rb"CDF[\x01\x02\x05]", "a NetCDF file", EXPORT_NUMBERS),
        (rb"SIMPLE  =", "a FITS file", EXPORT_NUMBERS),
        (rb"SQLite format 3", "a database of SQLite", EXPORT_NUMBERS),
        (rb"\x80[\x02-\x05][\x8c\x95c}\](]", "a pickle of Python", "save the array by numpy.save"),
        (rb"MThd", "a MIDI file (notes, no sound)", "export it as WAV"),
        (rb"wvpk|MAC |TTA1|DSD |MP\+|MPCK|tBaK", "an audio file of a rare kind", "export it as WAV or FLAC"),
        (rb"\x1f\x8b|BZh|\xfd7zXZ|7z\xbc\xaf|Rar!|\x28\xb5\x2f\xfd", "a packed archive", UNPACK),
        (rb"%PDF", "a PDF", EXPORT_NUMBERS),
        (rb"\x89PNG|\xff\xd8\xff|GIF8|II\*\0|MM\0\*|RIFF....WEBP|BM....\0\0\0\0", "a picture", _NOT_A_RECORDING),
        (rb"\x7fELF|MZ.{0,20}\0", "a program", _NOT_A_RECORDING),
        (rb"\s*<(?i:!doctype|html|\?xml|svg|gpx)", "an HTML or XML file", EXPORT_NUMBERS),
        (rb"\{\\rtf", "a text with layout (RTF)", "save it as plain text"),
    )
)
"""Files of other kinds: the beginning, a name for an error, and what to do with them."""

_CONTROL_BYTES = bytes(set(range(32)) - set(b"\0\t\n\v\f\r\x1a\x1b")) + b"\x7f"
_MAX_CONTROL_SHARE = 0.01
"""Share of control bytes in the beginning of a file above which it is not text."""


def sound_format(head: bytes) -> SoundFormat | None:
    """Return the format of a file by its beginning, None if it is not a known format of sound."""
    return next((one for one in SOUND_FORMATS if one.mark.match(head)), None)


def check_text(head: bytes) -> None:
    """Refuse a file of a known kind that is not a recording, or one that is not text.

    Raises
    ------
    ValueError
        Such a file; the error names its kind and what to do.
    """
    for mark, name, remedy in FOREIGN_FORMATS:
        if mark.match(head):
            raise ValueError(f"The {WHAT} is {name}, which is not read: {remedy}.")
    nuls = head.count(0)
    controls = len(head) - len(head.translate(None, _CONTROL_BYTES))
    is_utf_16 = nuls and 0 in (head[::2].count(0), head[1::2].count(0))
    is_binary = controls > max(1, _MAX_CONTROL_SHARE * len(head)) or (nuls > 0.1 * len(head) and not is_utf_16)
    if is_binary and not head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise ValueError(
            f"The {WHAT} is neither a known file nor a text: it begins with the bytes {head[:6].hex(' ')}; accepted "
            f"are {ACCEPTED}."
        )
