"""Hostile files by name, each made on demand: bombs, lying, slow and truncated files, and odd but legal ones."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from PIL import Image

from benchmarks.camera_files import RAW, RECTIFYING
from benchmarks.hostile_settings import calibrations, matchers, plain, projections, reprojection, rig
from benchmarks.picture_bytes import (
    FAST_PNG,
    MB,
    READ,
    RNG_SEED,
    Case,
    big_tiff,
    bmp,
    bomb,
    by_opencv,
    by_pillow,
    claiming,
    exif,
    gif,
    gif_comment,
    interlaced,
    jpeg,
    jpeg_scans,
    jpeg_sized,
    jpeg_with,
    noise,
    overlapping_exif,
    png,
    png_chunk,
    png_claiming,
    riff_chunk,
    segment,
    smooth,
    tiff,
    tiff_overlapping,
    tiff_pages,
    tiff_tiled,
    turned,
    webp,
    webp_frames,
    webp_sized,
    webp_with,
)
from benchmarks.recording_bytes import (
    filmed,
    id3,
    lying_flac,
    matlab,
    npy,
    npy_of,
    plain_wav,
    saved,
    sound,
    wav,
    zipped,
)
from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.io.recordings import read_signal
from stereolag.io.settings import read_matcher, settings_json
from stereolag.stereo.methods import METHODS

READERS: dict[str, Callable[[bytes], object]] = {
    "image": read_image,
    "signal": read_signal,
    "disparity": read_disparity,
    "disparity ÷ 4": partial(read_disparity, divisor=4),
    "calibration": read_calibration,
    "matcher": read_matcher,
}


@dataclass(frozen=True)
class HostileFile:
    """A hostile file: its name, the name of its reader, and its `Case`."""

    name: str
    reader: str
    make: Callable[[], bytes]
    answer: str


def hostile_files() -> dict[str, HostileFile]:
    """Return all hostile files by name, without making any."""
    kinds = {
        "": ("image", images()),
        "recording: ": ("signal", signals()),
        "map: ": ("disparity", disparities()),
        "calibration: ": ("calibration", calibrations()),
        "settings: ": ("matcher", matchers()),
    }
    return {
        f"{start}{name}": HostileFile(f"{start}{name}", reader, make, answer)
        for start, (reader, cases) in kinds.items()
        for name, (make, answer) in cases.items()
    }


def valid_files() -> dict[str, list[bytes]]:
    """Return small valid files of every kind, grouped by reader."""
    rng = np.random.default_rng(RNG_SEED)
    pixels = rng.integers(0, 256, (9, 11, 3), dtype=np.uint8)
    deep = rng.integers(0, 65_536, (9, 11, 3), dtype=np.uint16)
    orientation = Image.Exif()
    orientation[274] = 6
    pictures = [by_pillow(kind, pixels, exif=orientation) for kind in ("PNG", "JPEG", "TIFF", "WEBP", "AVIF", "HEIF")]
    pictures += [by_pillow(kind, pixels) for kind in ("BMP", "PPM", "GIF")]
    pictures += [by_pillow("WEBP", pixels, lossless=True), jpeg(pixels, progressive=True), webp_frames(1)]
    pictures += [
        by_pillow("TIFF", pixels, compression=kind) for kind in ("tiff_lzw", "tiff_deflate", "jpeg", "packbits")
    ]
    pictures += [by_opencv(ending, deep) for ending in (".png", ".tiff", ".ppm")]
    pictures += [by_opencv(ending, deep[:, :, 0]) for ending in (".png", ".tiff", ".pgm")]
    pictures += [by_pillow(kind, pixels[:, :, 0] > 99) for kind in ("PNG", "TIFF", "PPM")]
    pictures += [b"P3 2 2 255\n1 2 3 4 5 6 7 8 9 10 11 12\n", bmp(9, 3, 8, 1, b"\x09\1\0\0" * 3 + b"\0\1")]
    samples = rng.uniform(-0.5, 0.5, (300, 2))
    sounds = [
        sound(kind, samples=samples) for kind in ("WAV", "FLAC", "OGG", "MP3", "AIFF", "AU", "CAF", "W64", "RF64")
    ]
    codecs = (("mp4", "aac"), ("mov", "alac"), ("webm", "libopus"), ("matroska", "flac"), ("adts", "aac"))
    codecs += (("avi", "ac3"), ("mpegts", "mp2"), ("asf", "mp2"), ("mpeg", "ac3"))
    sounds += [filmed(*kind, samples[:, 0].repeat(10), rate=48_000) for kind in codecs]
    sounds += [filmed("amr", "libopencore_amrnb", samples[:, 0], rate=8000), zipped(samples), matlab(y=samples, fs=8e3)]
    sounds += [
        sound("WAV", kind, samples=samples[:, 0]) for kind in ("GSM610", "MS_ADPCM", "IMA_ADPCM", "ULAW", "FLOAT")
    ]
    sounds += [
        sound("OGG", "OPUS", samples=samples),
        saved(samples),
        b"Samples\r\n0.5,1\r\n-2e3,7\r\n3,4\r\n# a\n1,2\n",
        b"Date;Time;A;Alarm\n" + b"".join(b"13.05.2024;10:00:%02d,5;+ 0,%d;LL\n" % (row, row) for row in range(30)),
        b"time,A\n" + b"".join(b"2024-05-13T10:00:%02d.5Z,%d\n" % (row, row) for row in (*range(9), *range(20, 30))),
    ]
    maps = [
        b"Pf\n3 2\n-1.0\n" + np.arange(6, dtype="<f4").tobytes(),
        b"P5\n3 2\n65535\n" + bytes(range(12)),
        saved(np.arange(6.0).reshape(2, 3)),
        by_opencv(".png", np.arange(600, dtype=np.uint16).reshape(20, 30)),
    ]
    ros = b"image_width: 640\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: [7, 0, 3, -1, 0, 7, 2, 0, 0, 0, 1, 0]\n"
    cameras = (
        b"cam0=[400 0 100; 0 400 90; 0 0 1]\ncam1=[400 0 110; 0 400 90; 0 0 1]\ndoffs=10\nbaseline=193\nwidth=200\n"
    )
    files = [cameras, projections("720", "45", "-339"), rig(), plain(cx=3, width=640), reprojection(), ros]
    files += [source for make in (*RAW.values(), *RECTIFYING.values()) for source in make() if len(make()) == 1]
    methods = [method() for method in METHODS if not inspect.isabstract(method)]
    written = [settings_json(method).encode() for method in methods]
    return {"image": pictures, "signal": sounds, "disparity": maps, "calibration": files, "matcher": written}


def images() -> dict[str, Case]:
    cut = "damaged or cut short"
    most = "at most 50 megapixels"
    files: dict[str, Case] = {
        "PNG, 16-bit colour, IDAT claims 2 GB": (lambda: png_claiming(16, 2), ""),
        "PNG, header claims 900 megapixels": (lambda: png(30_000, 30_000, pixels=b""), "900 megapixels"),
        "PNG, header claims 2^31 a side": (lambda: png(2**31 - 1, 2**31 - 1, pixels=b""), most),
        "PNG, 49 million pixels in one column": (lambda: png(1, 49_000_000), "1,000,000 pixels in a row or column"),
        "PNG, comment of 60 MB": (lambda: png(before=png_chunk(b"tEXt", b"Comment\0" + b"a" * (60 * MB))), READ),
        "PNG, packed comment of 64 MB": (lambda: png(before=png_chunk(b"zTXt", b"Comment\0\0" + bomb(64 * MB))), ""),
        "PNG, 3 million chunks": (lambda: png(before=png_chunk(b"teXt", b"") * 3_000_000), ""),
        "PNG, EXIF of overlapping tags": (lambda: png(before=png_chunk(b"eXIf", overlapping_exif(4 * MB))), ""),
        "PNG, 1 pixel and 64 MB behind it": (lambda: png(1, 1, pixels=bytes(64 * MB)), READ),
        "PNG, 60 MB after its end": (lambda: png() + bytes(60 * MB), READ),
        "PNG, palette of 60 MB": (lambda: png(colour=3, before=png_chunk(b"PLTE", bytes(60 * MB))), ""),
        "PNG, palette missing": (lambda: png(colour=3), ""),
        "PNG, cut short": (lambda: by_pillow("PNG", noise(3, 60))[:-900], cut),
        "PNG, no IDAT": (lambda: png()[:33] + png_chunk(b"IEND", b""), cut),
        "JPEG, comments of 60 MB": (lambda: jpeg_with(segment(0xFE, b"a" * 65_000) * 960), READ),
        "JPEG, a million comments": (lambda: jpeg_with(segment(0xFE, b"") * 1_000_000), ""),
        "JPEG, 900 EXIF of overlapping tags": (
            lambda: jpeg_with(segment(0xE1, b"Exif\0\0" + overlapping_exif(65_000)) * 900),
            "",
        ),
        "JPEG, broken EXIF": (lambda: jpeg_with(segment(0xE1, b"Exif\0\0II*\0\xff\xff\xff\xff")), READ),
        "JPEG, claims to hold many pictures": (lambda: jpeg_with(segment(0xE2, b"MPF\0II*\0\x08\0\0\0\xff\xff")), READ),
        "JPEG, 3,000 scans": (lambda: jpeg_scans(3000), ""),
        "JPEG, 49 megapixels in 60 scans": (lambda: jpeg_scans(60, 7000), ""),
        "JPEG, header claims 4 gigapixels": (lambda: jpeg_sized(65_500, 65_500), most),
        "JPEG, header claims 49 megapixels of 256": (lambda: jpeg_sized(7000, 7000), ""),
        "JPEG, 60 MB of fill bytes": (lambda: jpeg_with(b"\xff" * (60 * MB)), ""),
        "JPEG, 30 million restarts": (lambda: jpeg()[:-2] + b"\xff\xd0" * (30 * MB) + b"\xff\xd9", ""),
        "JPEG, cut short": (lambda: jpeg(noise(3, 200))[:-3000], cut),
        "JPEG, nothing but its mark": (lambda: b"\xff\xd8\xff", cut),
        "GIF, comment of 30 million blocks": (lambda: gif(gif_comment(60 * MB, 1)), ""),
        "GIF, a million frames": (lambda: gif(count=1_000_000), ""),
        "GIF, frame beyond the screen": (lambda: gif(frame=(65_535, 65_535)), ""),
        "GIF, screen of 4 gigapixels": (lambda: gif(screen=(65_535, 65_535)), most),
        "GIF, no frame": (lambda: gif(count=0), cut),
        "TIFF, directory that follows itself": (lambda: tiff_pages(0, loop=True), READ),
        "TIFF, 400,000 pages": (lambda: tiff_pages(400_000), ""),
        "TIFF, 20,000 overlapping tags of 1 MB": (tiff_overlapping, ""),
        "TIFF, tile of 30,000 a side": (lambda: tiff_tiled(30_000), ""),
        "TIFF, 10 million strips": (lambda: tiff({273: (4, 10_000_000, 8)}, pixels=bytes(60 * MB)), ""),
        "TIFF, strips beyond the file": (lambda: tiff({273: (4, 4_000_000, 8)}), cut),
        "TIFF, 60,000 channels": (lambda: tiff({277: (3, 1, 60_000)}), ""),
        "TIFF, width a word": (lambda: tiff({256: (2, 4, 0x31313131)}), cut),
        "TIFF, header claims 16 gigapixels": (lambda: tiff({256: (4, 1, 130_000), 257: (4, 1, 130_000)}), most),
        "TIFF, deflated bomb": (lambda: tiff({259: (3, 1, 8), 279: (4, 1, 60_000)}, pixels=bomb(64 * MB)[:60_000]), ""),
        "TIFF, BigTIFF of 2^60 strips": (lambda: big_tiff(2**60), cut),
        "TIFF, directory beyond the file": (lambda: b"II*\0\xff\xff\xff\xff" + bytes(40), cut),
        "WEBP, profile of 60 MB": (lambda: webp_with(riff_chunk(b"ICCP", bytes(60 * MB)), 0x20), READ),
        "WEBP, EXIF of overlapping tags": (lambda: webp_with(riff_chunk(b"EXIF", overlapping_exif(4 * MB)), 8), ""),
        "WEBP, 90,000 frames": (lambda: webp_frames(90_000), "holds 90000 frames"),
        "WEBP, header claims 268 megapixels": (lambda: webp_sized(16_383), ""),
        "WEBP, canvas of 281 terapixels": (lambda: webp_with(b"", 0, (2**24, 2**24)), ""),
        "WEBP, cut short": (lambda: webp(noise(3, 200))[:-900], cut),
        "AVIF, header claims 49 megapixels of 64 by 64": (lambda: claiming("AVIF", 7000), ""),
        "AVIF, cut short": (lambda: by_pillow("AVIF", noise(3, 200))[:-900], cut),
        "HEIC, header claims 4 gigapixels": (lambda: claiming("HEIF", 65_500), most),
        "HEIC, header claims 49 megapixels of 64 by 64": (lambda: claiming("HEIF", 7000), cut),
        "HEIC, cut short": (lambda: by_pillow("HEIF", noise(3, 200))[:-900], cut),
        "BMP, header claims 4 gigapixels": (lambda: bmp(65_000, 65_000, 24, 0, bytes(64)), most),
        "BMP, 60 MB of runs": (lambda: bmp(7000, 7000, 8, 1, b"\1\1" * (30 * MB)), ""),
        "BMP, one run in 49 megapixels": (lambda: bmp(1_000_000, 49, 8, 1, b"\1\1\0\0" * 49 + b"\0\1"), ""),
        "BMP, 4 billion colours": (lambda: bmp(8, 8, 8, 0, bytes(64), 2**32 - 1), ""),
        "BMP, smallest height of all": (lambda: bmp(8, -(2**31), 24, 0, bytes(192)), most),
        "PGM, 60 MB of spaces": (lambda: b"P5" + b" " * (60 * MB), "no size"),
        "PPM, 60 MB of digits": (lambda: b"P6 " + b"1" * (60 * MB), "no size"),
        "PPM, 49 megapixels announced": (lambda: b"P6 7000 7000 255\n" + bytes(90), "cut short"),
        "PPM as text, 60 MB": (lambda: b"P3 4000 2500 255\n" + b"1 2\n" * 15_000_000, ""),
        "PPM as text, 7 million comments": (lambda: b"P3 2 2 255\n" + b"#\n" * 7_000_000, "cut short"),
        "60 MB of zeros": (lambda: bytes(60 * MB), "not an image"),
    }
    odd = {"255": (3, 1, 255), "a word": (2, 3, 0x7075), "two": (3, 2, 6 | 6 << 16), "4 billion": (3, 2**32 - 1, 26)}
    for name, entry in odd.items():
        files[f"JPEG, orientation {name}"] = (partial(jpeg_with, segment(0xE1, b"Exif\0\0" + exif(*entry))), READ)
    whole: dict[str, Callable[[], bytes]] = {
        "PNG, 49 megapixels, RGB noise": lambda: by_opencv(".png", noise(3), *FAST_PNG),
        "PNG, 49 megapixels, 16-bit RGB": lambda: by_opencv(".png", smooth(3, np.uint16), *FAST_PNG),
        "PNG, 49 megapixels, RGB, turned": lambda: turned(by_opencv(".png", smooth(3), *FAST_PNG)),
        "PNG, 49 megapixels, interlaced noise": lambda: interlaced(noise(3)),
        "TIFF, 49 megapixels, 16-bit RGB": lambda: by_opencv(".tiff", smooth(3, np.uint16)),
        "TIFF, 49 megapixels, floats": lambda: by_pillow("TIFF", smooth(1).astype(np.float32)),
        "JPEG, 49 megapixels, progressive": lambda: jpeg(smooth(3), progressive=True, subsampling=0),
        "WEBP, 49 megapixels, RGBA": lambda: by_opencv(".webp", smooth(4), cv2.IMWRITE_WEBP_QUALITY, 50),
        "AVIF, 49 megapixels": lambda: by_pillow("AVIF", smooth(3), speed=10),
        "HEIC, 49 megapixels": lambda: by_pillow("HEIF", smooth(3), enc_params={"preset": "ultrafast"}),
        "GIF, 49 megapixels": lambda: by_pillow("GIF", smooth(1)),
        "PPM, 40 megapixels, 16 bits": lambda: b"P6 8000 5000 65535\n" + bytes(240_000_000),
        "PGM, 49 megapixels, 16 bits, largest 1023": lambda: b"P5 7000 7000 1023\n" + bytes(98_000_000),
    }
    return files | {name: (make, READ) for name, make in whole.items()}


def signals() -> dict[str, Case]:
    broken = "of 0 channels by its header"
    most = "at most 30,000,000"
    header = "header cannot be read"
    silence = np.zeros(30_000_000, np.int16)
    return {
        "text, a short line and one of 60 MB": (lambda: b"1\n" + b"2" * (60 * MB), ""),
        "text, one line of 60 MB": (lambda: b"1," * (30 * MB), ""),
        "text, 60 million empty lines": (lambda: b"\n" * (60 * MB), ""),
        "text, 30 million lines": (lambda: b"1\n" * 29_999_000, ""),
        "text, 60 MB of long numbers": (lambda: b"0.123456789012345678\n" * 2_900_000, READ),
        "text, 60 MB of comments": (lambda: b"# " + b"\n# ".join([b"a" * 60] * 950_000), "No line of the text"),
        "text, 60 MB of words": (lambda: b"word and word\n" * 4_000_000, ""),
        "text, wrong in the last line": (lambda: b"1.25\n" * 9_000_000 + b"x", ""),
        "text, NUL at the end": (lambda: b"1.25\n" * 9_000_000 + b"\0", ""),
        "text, 60 MB of UTF-16 beyond its plane": (lambda: ("\U0001f600\n" * 9_000_000).encode("utf-16"), ""),
        "text, 200 MB": (lambda: b"1.25\n" * 40_000_000, "at most 67 MB"),
        "text, 60 MB of separators": (lambda: (b";" * 4000 + b"\n") * 15_000, ""),
        "text, number of 4,000 digits": (lambda: b"1" * 4000 + b"\n2\n", ""),
        "WAV, data claims 4 GB": (lambda: plain_wav(claimed=2**32 - 1), ""),
        "WAV, 65,535 channels": (lambda: plain_wav(65_535), ""),
        "WAV, 0 channels": (lambda: plain_wav(0), broken),
        "WAV, rate of 4 billion": (lambda: plain_wav(rate=2**32 - 1), ""),
        "WAV, block of 0 bytes": (lambda: wav((1, 1, 8000, 16_000, 0, 16), bytes(800)), ""),
        "WAV, 0 bits": (lambda: wav((1, 1, 8000, 16_000, 2, 0), bytes(800)), ""),
        "WAV, ADPCM of 0 a block": (lambda: wav((17, 1, 8000, 16_000, 2, 4), bytes(800)), ""),
        "WAV, notes of 60 MB": (lambda: plain_wav(before=riff_chunk(b"LIST", b"INFO" + bytes(60 * MB))), READ),
        "WAV, 4 million chunks": (lambda: plain_wav(before=riff_chunk(b"abcd", b"") * 4_000_000), ""),
        "WAV, 30 million samples": (lambda: plain_wav(data=bytes(60_000_000)), READ),
        "WAV, 30 million doubles": (lambda: wav((3, 1, 8000, 64_000, 8, 64), bytes(240_000_000)), READ),
        "WAV, 50 million samples": (lambda: plain_wav(data=bytes(100_000_000)), most),
        "FLAC, 30 million silent samples": (lambda: sound("FLAC", samples=silence), READ),
        "FLAC, header claims 30 million of 100": (lambda: lying_flac(30_000_000), ""),
        "FLAC, header claims 2^36 of 100": (lambda: lying_flac(2**36 - 1), most),
        "OGG, cut short": (lambda: sound("OGG")[:1500], ""),
        "OGG, 15,000 in a row": (lambda: sound("OGG", samples=np.zeros(100)) * 15_000, ""),
        "OGG, 20 minutes of Vorbis": (lambda: sound("OGG", samples=silence[:20_000_000], rate=16_000), READ),
        "MP3, tag of 60 MB": (lambda: id3(60 * MB), ""),
        "MP3, 60 MB of its mark": (lambda: b"\xff\xfb\x90\0" * (15 * MB), ""),
        "MP3, 60 MB of noise": (lambda: b"\xff\xfb\x90\0" + np.random.default_rng(1).bytes(60 * MB), ""),
        "MP4, 20 minutes of AAC": (lambda: filmed("mp4", "aac", silence[:20_000_000] / 1.0, rate=16_000), ""),
        "MP4, a box of 2^63 bytes": (lambda: b"\0\0\0\1ftyp" + b"\x7f" * 8 + bytes(900), "damaged, cut short"),
        "MP4, 3 million boxes": (lambda: b"\0\0\0\x08free" * 3_000_000, ""),
        "MKV, noise": (lambda: b"\x1aE\xdf\xa3" + np.random.default_rng(1).bytes(9 * MB), "damaged, cut short"),
        "AAC, 60 MB of its mark": (lambda: b"\xff\xf1\x50\x80\x01\x1f\xfc" * (8 * MB), ""),
        "NPZ, 64 MB of zeros": (lambda: zipped(np.zeros(8 * MB)), READ),
        "NPZ, 900 MB of zeros": (lambda: zipped(np.zeros(112 * MB)), "more than 256 MB|at most 256 MB"),
        "MAT, 31 million zeros": (lambda: matlab(y=np.zeros(31_000_000, np.uint8)), most),
        "MAT, 64 MB of zeros": (lambda: matlab(y=np.zeros(8 * MB)), READ),
        "text, a clock of 10 million dates": (lambda: b"2024-05-13 10:00:00,1.5\n" * 2_500_000, ""),
        "AIFF, DWVW_16": (lambda: sound("AIFF", "DWVW_16"), "coding DWVW"),
        "NPY, 30 million": (lambda: saved(np.zeros(30_000_000)), READ),
        "NPY, 31 million": (lambda: saved(np.zeros(31_000_000, np.uint8)), most),
        "NPY, halves that overflow": (lambda: saved(np.full(9, np.inf, np.float16)), "9 infinite"),
        "NPY, shape (True, True)": (lambda: npy_of("(True, True)"), header),
        "NPY, shape (-1,)": (lambda: npy_of("(-1,)"), header),
        "NPY, shape ('a',)": (lambda: npy_of("('a',)"), header),
        "NPY, shape of 10^30": (lambda: npy_of("(1000000000000000, 1000000000000000)"), "cut short"),
        "NPY, shape of 10^999": (lambda: npy_of(f"({'9' * 999},)"), "cut short"),
        "NPY, shape of 300 sides": (lambda: npy_of(f"({'1, ' * 300})"), header),
        "NPY, objects": (lambda: npy_of("(8,)", "'|O'"), "holds object"),
        "NPY, records": (lambda: npy_of("(8,)", "[('a', '<f8')]"), "records of several fields"),
        "NPY, text": (lambda: npy_of("(8,)", "'<U9999999'"), "allowed are integers and floats"),
        "NPY, a header that is code": (lambda: npy("__import__('os').abort()"), header),
        "NPY, a header of parentheses": (lambda: npy("(" * 60_000), header),
        "NPY, a header that claims 4 GB": (lambda: b"\x93NUMPY\x02\0\xff\xff\xff\xff" + bytes(99), header),
        "NPY, version 200": (lambda: npy_of("(8,)").replace(b"\x01\x00", b"\xc8\0", 1), header),
    }


def disparities() -> dict[str, Case]:
    return {
        "PGM, 60 MB of comments": (lambda: b"P5" + b"#\n" * (30 * MB), "no size and largest value"),
        "PFM, 60 MB of spaces": (lambda: b"Pf" + b" " * (60 * MB), "is not a PFM"),
        "PFM, 60 MB of scale": (lambda: b"Pf 2 2 " + b"1" * (60 * MB), "is not a PFM"),
        "PFM, scale 1e999": (lambda: b"Pf\n2 2\n1e999\n" + bytes(16), "scale 1e999"),
        "PFM, scale nan": (lambda: b"Pf\n2 2\nnan\n" + bytes(16), "scale nan"),
        "PFM, other digits": (lambda: "Pf\n² ²\n1\n".encode() + bytes(16), "is not a PFM"),
        "PFM, 10^18 pixels": (lambda: b"Pf\n999999999 999999999\n1\n", "at most 50 megapixels"),
        "PFM, 49 megapixels, big-endian": (lambda: b"Pf\n7000 7000\n1\n" + np.ones(49_000_000, ">f4").tobytes(), READ),
        "PFM, numbers of 1e38": (lambda: b"Pf\n2 2\n-1\n" + np.full(4, 1e38, "<f4").tobytes(), "no disparity at all"),
        "PNG, 49 megapixels, 16 bits": (lambda: by_opencv(".png", smooth(1, np.uint16), *FAST_PNG), READ),
        "NPY, 49 megapixels, columns first": (lambda: saved(np.ones((7000, 7000), np.int16, order="F")), READ),
        "NPY, no dimension": (lambda: npy_of("()"), r"shape \(\)"),
        "NPY, zero by a billion": (lambda: npy_of("(1000000000, 0)"), "holds none"),
        "60 MB of zeros": (lambda: bytes(60 * MB), "cannot be read"),
    }
