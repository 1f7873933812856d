"""Hostile files by name, each made on demand: bombs, lying, slow and truncated files, and odd but legal ones."""

from __future__ import annotations

import inspect
import itertools

import numpy as np
from camera_files import RAW, RECTIFYING
from hostile_cases import HostileFile
from hostile_maps import disparities
from hostile_pictures import images
from hostile_recordings import signals
from hostile_settings import calibrations, matchers, plain, projections, reprojection, rig
from picture_bytes import RNG_SEED, animated_png, bmp, by_opencv, by_pillow, jpeg, webp_frames
from PIL import Image
from recording_bytes import saved, sound

from stereolag.io.settings import settings_json
from stereolag.stereo.methods import METHODS


def hostile_files() -> dict[str, HostileFile]:
    """Return all of them by name, without making any."""
    every = list(itertools.chain(images(), signals(), disparities(), calibrations(), matchers()))
    names = {file.name: file for file in every}
    if len(names) != len(every):
        raise ValueError("two hostile files have one name")
    return names


def valid_files() -> dict[str, list[bytes]]:
    """Return small valid files of every kind, grouped by reader."""
    rng = np.random.default_rng(RNG_SEED)
    pixels = rng.integers(0, 256, (9, 11, 3), dtype=np.uint8)
    deep = rng.integers(0, 65_536, (9, 11, 3), dtype=np.uint16)
    held = Image.Exif()
    held[274] = 6
    pictures = [by_pillow(kind, pixels, exif=held) for kind in ("PNG", "JPEG", "TIFF", "WEBP")]
    pictures += [by_pillow(kind, pixels) for kind in ("BMP", "PPM", "GIF")]
    pictures += [
        by_pillow("WEBP", pixels, lossless=True),
        jpeg(pixels, progressive=True),
        webp_frames(2),
        animated_png(2),
    ]
    pictures += [
        by_pillow("TIFF", pixels, compression=kind) for kind in ("tiff_lzw", "tiff_deflate", "jpeg", "packbits")
    ]
    pictures += [by_opencv(ending, deep) for ending in (".png", ".tiff", ".ppm")]
    pictures += [by_opencv(ending, deep[:, :, 0]) for ending in (".png", ".tiff", ".pgm")]
    pictures += [by_pillow(kind, pixels[:, :, 0] > 99) for kind in ("PNG", "TIFF", "PPM")]
    pictures += [b"P3 2 2 255\n1 2 3 4 5 6 7 8 9 10 11 12\n", bmp(9, 3, 8, 1, b"\x09\1\0\0" * 3 + b"\0\1")]
    samples = rng.uniform(-0.5, 0.5, (300, 2))
    sounds = [sound(kind, samples=samples) for kind in ("WAV", "FLAC", "OGG", "MP3", "AIFF")]
    sounds += [
        sound("WAV", kind, samples=samples[:, 0]) for kind in ("GSM610", "MS_ADPCM", "IMA_ADPCM", "ULAW", "FLOAT")
    ]
    sounds += [
        sound("OGG", "OPUS", samples=samples),
        saved(samples),
        b"Samples\r\n0.5,1\r\n-2e3,7\r\n3,4\r\n# a\n1,2\n",
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
