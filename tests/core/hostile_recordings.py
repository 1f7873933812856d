"""Hostile recordings by name."""

from __future__ import annotations

import struct
from functools import partial

import numpy as np
from hostile_cases import MB, READ, HostileFile
from picture_bytes import riff_chunk
from recording_bytes import id3, lying_flac, npy, npy_of, plain_wav, saved, sound, wav

HEADERS = {
    "shape (True, True)": (lambda: npy_of("(True, True)"), "header cannot be read"),
    "shape (-1,)": (lambda: npy_of("(-1,)"), "header cannot be read"),
    "shape (2.0,)": (lambda: npy_of("(2.0,)"), "header cannot be read"),
    "shape ('a',)": (lambda: npy_of("('a',)"), "header cannot be read"),
    "shape of a trillion": (lambda: npy_of("(1000000000000,)"), "cut short"),
    "shape of 10^30": (lambda: npy_of("(1000000000000000, 1000000000000000)"), "cut short"),
    "shape of 10^999": (lambda: npy_of(f"({'9' * 999},)"), "header cannot be read"),
    "shape of 500 sides": (lambda: npy_of(f"({'1, ' * 300})"), "header cannot be read"),
    "shape with a 0": (lambda: npy_of("(0, 8)"), ""),
    "order 7": (lambda: npy_of("(8,)", order="7"), "header cannot be read"),
    "objects": (lambda: npy_of("(8,)", "'|O'"), "holds object"),
    "records": (lambda: npy_of("(8,)", "[('a', '<f8')]"), "records of several fields"),
    "dates": (lambda: npy_of("(8,)", "'<M8[s]'"), "header cannot be read|text, times"),
    "text": (lambda: npy_of("(8,)", "'<U9999999'"), "text, times"),
    "floats of 7 bytes": (lambda: npy_of("(8,)", "'<f7'"), "float56"),
    "a header that is code": (lambda: npy("__import__('os').abort()"), "header cannot be read"),
    "a header of parentheses": (lambda: npy("(" * 60_000), "header cannot be read"),
    "a header of quotes and spaces": (lambda: npy("'descr'" + " " * 60_000), "header cannot be read"),
    "a header that claims 4 GB": (lambda: b"\x93NUMPY\x02\0\xff\xff\xff\xff" + bytes(99), "header cannot be read"),
    "version 200": (lambda: npy_of("(8,)").replace(b"\x01\x00", b"\xc8\0", 1), "header cannot be read"),
}


def signals() -> list[HostileFile]:
    broken = "damaged, cut short or without channels"
    files = {
        "text, a short line and one of 60 MB": (lambda: b"1\n" + b"2" * (60 * MB), "characters long"),
        "text, one line of 60 MB": (lambda: b"1," * (30 * MB), "characters long"),
        "text, words and one line of 60 MB": (lambda: b"a\n" * 50 + b"b" * (60 * MB), "characters long"),
        "text, 60 million empty lines": (lambda: b"\n" * (60 * MB), "lines; at most"),
        "text, 30 million lines": (lambda: b"1\n" * 29_999_000, "lines; at most"),
        "text, 10 million lines": (lambda: b"1.25\n" * 9_999_999, READ),
        "text, 60 MB of long numbers": (lambda: b"0.123456789012345678\n" * 2_900_000, READ),
        "text, 60 MB in 32 columns": (
            lambda: b",".join([b"12"] * 32) * 1 + (b"\n" + b",".join([b"12"] * 32)) * 600_000,
            READ,
        ),
        "text, 30 million numbers in 30 columns": (
            lambda: (b",".join([b"1"] * 30) + b"\n") * 1_000_000,
            "at most 20,000,000 are accepted",
        ),
        "text, 60 MB of comments": (lambda: b"# " + b"\n# ".join([b"a" * 60] * 950_000), "No line of the text"),
        "text, 9 million comments": (lambda: b"#\n" * 9_000_000, "No line of the text"),
        "text, 9 million comments, then numbers": (lambda: b"#\n" * 9_000_000 + b"1\n2\n", READ),
        "text, 9 million numbers with comments": (lambda: b"1 #a\n" * 9_000_000, READ),
        "text, numbers among 9 million empty lines": (lambda: b"1\n" + b"\n" * 9_000_000 + b"2\n", READ),
        "text, 60 MB of words": (lambda: b"word and word\n" * 4_000_000, "No line of the text"),
        "text, wrong in the last line": (lambda: b"1.25\n" * 9_000_000 + b"x", "Line 9000001 holds “x”"),
        "text, NaN in the last line": (lambda: b"1.25\n" * 9_000_000 + b"nan", "Line 9000001 holds nan"),
        "text, NUL at the end": (lambda: b"1.25\n" * 9_000_000 + b"\0", "Line 9000001 holds a NUL byte"),
        "text, 60 MB of UTF-16": (lambda: ("1.25\n" * 6_000_000).encode("utf-16"), READ),
        "text, 60 MB of UTF-16 beyond its plane": (lambda: ("\U0001f600\n" * 9_000_000).encode("utf-16"), ""),
        "text, 60 MB in Latin-1": (lambda: b"\xb5V\n" + b"1.25\n" * 9_000_000, READ),
        "text, 200 MB": (lambda: b"1.25\n" * 40_000_000, "at most 67 MB"),
        "text, returns only": (lambda: b"1.25\r" * 9_000_000, READ),
        "text, 60 MB of separators": (lambda: (b";" * 4000 + b"\n") * 15_000, "No line of the text"),
        "text, number of 4,000 digits": (lambda: b"1" * 4000 + b"\n2\n", ""),
        "WAV, data claims 4 GB": (lambda: plain_wav(claimed=2**32 - 1), ""),
        "WAV, 65,535 channels": (lambda: plain_wav(65_535), ""),
        "WAV, 0 channels": (lambda: plain_wav(0), broken),
        "WAV, rate 0": (lambda: plain_wav(rate=0), ""),
        "WAV, rate of 4 billion": (lambda: plain_wav(rate=2**32 - 1), ""),
        "WAV, block of 0 bytes": (lambda: wav((1, 1, 8000, 16_000, 0, 16), bytes(800)), ""),
        "WAV, 0 bits": (lambda: wav((1, 1, 8000, 16_000, 2, 0), bytes(800)), ""),
        "WAV, encoding 65,534": (lambda: wav((65_534, 1, 8000, 16_000, 2, 16), bytes(800)), ""),
        "WAV, ADPCM of 0 a block": (lambda: wav((17, 1, 8000, 16_000, 2, 4), bytes(800)), ""),
        "WAV, notes of 60 MB": (lambda: plain_wav(before=riff_chunk(b"LIST", b"INFO" + bytes(60 * MB))), READ),
        "WAV, 4 million chunks": (lambda: plain_wav(before=riff_chunk(b"abcd", b"") * 4_000_000), ""),
        "WAV, 7 million cues": (
            lambda: plain_wav(before=riff_chunk(b"cue ", struct.pack("<I", 2**31) + bytes(60 * MB))),
            "",
        ),
        "WAV, 30 million samples": (lambda: plain_wav(data=bytes(60_000_000)), READ),
        "WAV, 2 × 15 million samples": (lambda: plain_wav(2, data=bytes(60_000_000)), READ),
        "WAV, 30 million doubles": (
            lambda: wav((3, 1, 8000, 64_000, 8, 64), bytes(240_000_000)),
            READ,
        ),
        "WAV, 50 million samples": (lambda: plain_wav(data=bytes(100_000_000)), "at most 30,000,000"),
        "WAV, only its mark": (lambda: b"RIFF", broken),
        "FLAC, 30 million silent samples": (lambda: sound("FLAC", samples=np.zeros(30_000_000, np.int16)), READ),
        "FLAC, 4 × 7 million silent samples": (
            lambda: sound("FLAC", samples=np.zeros((7_000_000, 4), np.int16)),
            READ,
        ),
        "FLAC, header claims 30 million of 100": (lambda: lying_flac(30_000_000), ""),
        "FLAC, header claims 2^36 of 100": (lambda: lying_flac(2**36 - 1), "at most 30,000,000"),
        "FLAC, header claims none": (lambda: lying_flac(0), ""),
        "FLAC, cut short": (lambda: sound("FLAC")[:2000], ""),
        "OGG, cut short": (lambda: sound("OGG")[:1500], ""),
        "OGG, 15,000 in a row": (lambda: sound("OGG", samples=np.zeros(100)) * 15_000, ""),
        "OGG, 60 MB of its mark": (lambda: b"OggS" * (15 * MB), broken),
        "OGG, 20 minutes of Vorbis": (lambda: sound("OGG", samples=np.zeros(20_000_000, np.int16), rate=16_000), READ),
        "MP3, tag of 60 MB": (lambda: id3(60 * MB), ""),
        "MP3, 60 MB of its mark": (lambda: b"\xff\xfb\x90\0" * (15 * MB), ""),
        "MP3, 60 MB of noise": (lambda: b"\xff\xfb\x90\0" + np.random.default_rng(1).bytes(60 * MB), ""),
        "MP3, 20 minutes": (lambda: sound("MP3", samples=np.zeros(20_000_000, np.int16), rate=16_000), READ),
        "AIFF, cut short": (lambda: sound("AIFF")[:40], ""),
        "AIFF, rate of nonsense": (lambda: sound("AIFF").replace(b"\x40\x0b\xfa", b"\x7f\xff\xff"), ""),
        "NPY, 30 million": (lambda: saved(np.zeros(30_000_000)), READ),
        "NPY, 31 million": (lambda: saved(np.zeros(31_000_000, np.uint8)), "at most 30,000,000"),
        "NPY, 2 × 15 million, columns first": (lambda: saved(np.asfortranarray(np.zeros((15_000_000, 2)))), READ),
        "NPY, halves that overflow": (lambda: saved(np.full(9, np.inf, np.float16)), "9 NaN or infinite"),
    }
    encodings = ["PCM_U8", "PCM_24", "FLOAT", "DOUBLE", "ULAW", "ALAW", "MS_ADPCM", "IMA_ADPCM", "GSM610", "G721_32"]
    encodings += ["NMS_ADPCM_16", "NMS_ADPCM_24", "NMS_ADPCM_32"]
    files |= {f"WAV, {name}": (partial(sound, "WAV", name), READ) for name in encodings}
    for name in ("PCM_S8", "PCM_U8", "FLOAT", "ULAW", "IMA_ADPCM", "GSM610"):
        files[f"AIFF, {name}"] = (partial(sound, "AIFF", name), READ)
    files["AIFF, DWVW_16"] = (partial(sound, "AIFF", "DWVW_16"), "encoding DWVW")
    files["OGG, OPUS"] = (partial(sound, "OGG", "OPUS"), READ)
    files |= {f"NPY, {name}": case for name, case in HEADERS.items()}
    return [HostileFile(name, "signal", make, answer) for name, (make, answer) in files.items()]
