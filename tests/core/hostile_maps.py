"""Hostile disparity maps by name."""

from __future__ import annotations

import numpy as np
from hostile_cases import MB, READ, HostileFile
from hostile_recordings import HEADERS
from picture_bytes import FAST_PNG, by_opencv, noise, png_claiming, smooth
from recording_bytes import npy_of, saved


def disparities() -> list[HostileFile]:
    files = {
        "PGM, 60 MB of spaces": (lambda: b"P5" + b" " * (60 * MB), "not a binary PGM"),
        "PGM, 60 MB of comments": (lambda: b"P5" + b"#\n" * (30 * MB), "not a binary PGM"),
        "PGM, 60 MB of digits": (lambda: b"P5 " + b"9" * (60 * MB), "not a binary PGM"),
        "PFM, 60 MB of spaces": (lambda: b"Pf" + b" " * (60 * MB), "not a grey PFM"),
        "PFM, 60 MB of scale": (lambda: b"Pf 2 2 " + b"1" * (60 * MB), "not a grey PFM"),
        "PFM, scale 1e999": (lambda: b"Pf\n2 2\n1e999\n" + bytes(16), "scale 1e999"),
        "PFM, scale nan": (lambda: b"Pf\n2 2\nnan\n" + bytes(16), "scale nan"),
        "PFM, scale _1_": (lambda: b"Pf\n2 2\n1_1\n" + bytes(16), "scale 1_1"),
        "PFM, other digits": (lambda: "Pf\n² ²\n1\n".encode() + bytes(16), "not a grey PFM"),
        "PFM, 10^18 pixels": (lambda: b"Pf\n999999999 999999999\n1\n", "at most 50 megapixels"),
        "PFM, 49 megapixels": (lambda: b"Pf\n7000 7000\n-1\n" + np.ones(49_000_000, "<f4").tobytes(), READ),
        "PFM, 49 megapixels, big-endian": (lambda: b"Pf\n7000 7000\n1\n" + np.ones(49_000_000, ">f4").tobytes(), READ),
        "PFM, numbers of 1e38": (lambda: b"Pf\n2 2\n-1\n" + np.full(4, 1e38, "<f4").tobytes(), READ),
        "PNG, 49 megapixels, 16 bits": (lambda: by_opencv(".png", smooth(1, np.uint16), *FAST_PNG), READ),
        "PGM, 49 megapixels, 16 bits": (lambda: b"P5 7000 7000 65535\n" + b"\1\1" * 49_000_000, READ),
        "NPY, 49 megapixels": (lambda: saved(np.ones((7000, 7000), np.float32)), READ),
        "NPY, 49 megapixels, halves": (lambda: saved(np.ones((7000, 7000), np.float16)), READ),
        "NPY, 49 megapixels, integers, columns first": (
            lambda: saved(np.ones((7000, 7000), np.int16, order="F")),
            READ,
        ),
        "NPY, no dimension": (lambda: npy_of("()"), r"shape \(\)"),
        "NPY, no pixels": (lambda: npy_of("(0, 8)"), "holds none"),
        "NPY, zero by a billion": (lambda: npy_of("(1000000000, 0)"), "holds none"),
        "PNG, 16 bits, IDAT claims 2 GB": (lambda: png_claiming(16, 0), "damaged or cut short"),
        "60 MB of zeros": (lambda: bytes(60 * MB), "cannot be read"),
    }
    files |= {
        f"NPY, {name}": case for name, case in HEADERS.items() if name.startswith(("shape (", "objects", "order"))
    }
    found = [HostileFile(f"map: {name}", "disparity", make, answer) for name, (make, answer) in files.items()]
    eight = {
        "PNG, 49 megapixels, 8 bits": lambda: by_opencv(".png", noise(1), *FAST_PNG),
        "PGM, 49 megapixels, 8 bits": lambda: b"P5 7000 7000 255\n" + noise(1).tobytes(),
    }
    return found + [HostileFile(f"map: {name}", "disparity ÷ 4", make, READ) for name, make in eight.items()]
