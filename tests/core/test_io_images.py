"""Pictures: every accepted kind is read correctly, and every bad one is refused in one clear sentence."""

from __future__ import annotations

import io
import struct
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from stereolag.io.images import read_image

RNG = np.random.default_rng(5)
GREY = RNG.integers(0, 256, (13, 17), dtype=np.uint8)
RGB = RNG.integers(0, 256, (13, 17, 3), dtype=np.uint8)
RGBA = RNG.integers(0, 256, (13, 17, 4), dtype=np.uint8)
GREY16 = RNG.integers(0, 65536, (13, 17), dtype=np.uint16)
RGB16 = RNG.integers(0, 65536, (13, 17, 3), dtype=np.uint16)
RGBA16 = RNG.integers(0, 65536, (13, 17, 4), dtype=np.uint16)


def encoded(picture: Image.Image, kind: str = "PNG", **options) -> bytes:
    stream = io.BytesIO()
    picture.save(stream, kind, **options)
    return stream.getvalue()


def encoded_by_opencv(pixels: np.ndarray, ending: str) -> bytes:
    if pixels.ndim == 3:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_RGBA2BGRA if pixels.shape[2] == 4 else cv2.COLOR_RGB2BGR)
    return cv2.imencode(ending, pixels)[1].tobytes()


def png(width: int, height: int, bit_depth: int, colour_type: int, rows: bytes) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, bit_depth, colour_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


@pytest.mark.parametrize("kind", ["PNG", "BMP", "TIFF", "PPM", "WEBP"])
@pytest.mark.parametrize("pixels", [GREY, RGB], ids=["grey", "rgb"])
def test_lossless_kinds_come_back_exactly(kind, pixels):
    options = {"lossless": True} if kind == "WEBP" else {}
    image = read_image(encoded(Image.fromarray(pixels), kind, **options))
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, np.stack([GREY] * 3, axis=-1) if image.ndim > pixels.ndim else pixels)


@pytest.mark.parametrize("kind", ["PNG", "TIFF", "WEBP"])
def test_transparency_comes_as_a_fourth_channel(kind):
    options = {"lossless": True, "exact": True} if kind == "WEBP" else {}
    np.testing.assert_array_equal(read_image(encoded(Image.fromarray(RGBA), kind, **options)), RGBA)


@pytest.mark.parametrize("ending", [".png", ".tiff"])
@pytest.mark.parametrize("pixels", [GREY16, RGB16, RGBA16], ids=["grey", "rgb", "rgba"])
def test_16_bits_a_channel_are_kept(pixels, ending):
    image = read_image(encoded_by_opencv(pixels, ending))
    assert image.dtype == np.uint16
    np.testing.assert_array_equal(image, pixels)


def test_16_bit_pgm_and_grey_with_alpha():
    np.testing.assert_array_equal(read_image(encoded_by_opencv(GREY16, ".pgm")), GREY16)
    grey_alpha = read_image(png(1, 1, 16, 4, b"\0\x12\x34\xff\xff"))
    np.testing.assert_array_equal(grey_alpha, np.array([[[0x1234, 0x1234, 0x1234, 0xFFFF]]], np.uint16))


def test_jpeg_and_gif_are_close():
    smooth = np.add.outer(np.arange(64), np.arange(80)).astype(np.uint8)
    for kind in ("JPEG", "GIF"):
        image = read_image(encoded(Image.fromarray(smooth), kind))
        grey = image if image.ndim == 2 else image[:, :, 0]
        assert np.abs(grey.astype(int) - smooth).max() <= 4


def test_one_bit_becomes_black_and_white():
    bits = RNG.random((13, 17)) > 0.5
    for kind in ("PNG", "TIFF", "PPM"):
        np.testing.assert_array_equal(read_image(encoded(Image.fromarray(bits), kind)), bits * np.uint8(255))


def test_a_palette_is_resolved():
    picture = Image.fromarray(np.array([[0, 1], [2, 1]], np.uint8)).convert("L")
    picture.putpalette([255, 0, 0, 0, 255, 0, 0, 0, 255])
    colours = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [0, 255, 0]]], np.uint8)
    np.testing.assert_array_equal(read_image(encoded(picture)), colours)
    for transparency in (1, bytes([255, 0, 255])):
        image = read_image(encoded(picture, transparency=transparency))
        np.testing.assert_array_equal(image[:, :, :3], colours)
        np.testing.assert_array_equal(image[:, :, 3], [[255, 0], [255, 0]])


def test_grey_with_alpha_becomes_rgba():
    image = read_image(encoded(Image.fromarray(RGBA[:, :, :2])))
    np.testing.assert_array_equal(image, RGBA[:, :, [0, 0, 0, 1]])


def test_cmyk_becomes_rgb():
    image = read_image(encoded(Image.fromarray(RGB).convert("CMYK"), "TIFF"))
    np.testing.assert_array_equal(image, RGB)


def test_a_float_tiff_stays_float():
    pixels = RNG.random((13, 17), dtype=np.float32)
    np.testing.assert_array_equal(read_image(encoded(Image.fromarray(pixels), "TIFF")), pixels)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("pixels", [RGB, RGB16], ids=["uint8", "uint16"])
def test_the_orientation_of_the_camera_is_applied(orientation, pixels):
    exif = Image.Exif()
    exif[0x0112] = orientation
    upright = [
        pixels, pixels[:, ::-1], pixels[::-1, ::-1], pixels[::-1],
        pixels.swapaxes(0, 1), np.rot90(pixels, -1), np.rot90(pixels, 2).swapaxes(0, 1), np.rot90(pixels),
    ][orientation - 1]  # fmt: skip
    if pixels.dtype == np.uint8:
        data = encoded(Image.fromarray(pixels), exif=exif)
    else:
        data = with_exif(encoded_by_opencv(pixels, ".png"), exif.tobytes())
    np.testing.assert_array_equal(read_image(data), upright)


def with_exif(data: bytes, exif: bytes) -> bytes:
    body = exif.removeprefix(b"Exif\0\0")
    chunk = struct.pack(">I", len(body)) + b"eXIf" + body + struct.pack(">I", zlib.crc32(b"eXIf" + body))
    return data[:33] + chunk + data[33:]


@pytest.mark.parametrize("tail", [1, 2, 100])
def test_every_cut_jpeg_is_damaged(tail: int) -> None:
    whole = encoded(Image.fromarray(np.kron(RGB, np.ones((3, 3, 1), np.uint8))), "JPEG")
    assert read_image(whole).shape == (39, 51, 3)
    with pytest.raises(ValueError, match="damaged or cut short"):
        read_image(whole[:-tail])


def test_netpbm_values_are_stretched_to_their_type() -> None:
    np.testing.assert_array_equal(read_image(b"P5 3 1 15\n\0\x05\x0f"), [[0, 85, 255]])
    np.testing.assert_array_equal(read_image(b"P6 1 1 3\n\0\1\3"), [[[0, 85, 255]]])
    np.testing.assert_array_equal(read_image(b"P2 # a\n2 1\n#b\n255 7 255"), [[7, 255]])
    np.testing.assert_array_equal(read_image(b"P1 4 2 0110 1 0 0 1"), [[255, 0, 0, 255], [0, 255, 255, 0]])
    deep = np.array([[[1, 2, 65535]]], np.uint16)
    found = read_image(b"P6 1 1 65535\n" + deep.astype(">u2").tobytes())
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, deep)


def test_a_frame_lies_on_the_canvas_of_its_animation() -> None:
    stream = io.BytesIO()
    frames = [Image.fromarray(np.zeros((16, 16, 3), np.uint8) + shade) for shade in (7, 90)]
    frames[0].save(stream, "WEBP", save_all=True, append_images=frames[1:], lossless=True)
    data = stream.getvalue()
    wider = data[:24] + (19).to_bytes(3, "little") + (17).to_bytes(3, "little") + data[30:]
    image = read_image(wider)
    assert image.shape == (18, 20, 3)
    assert (image[:16, :16] == 7).all()
    assert not image[16:].any()
    assert not image[:, 16:].any()


def test_path_bytes_and_file_are_the_same(tmp_path):
    data = encoded(Image.fromarray(RGB))
    path = tmp_path / "picture.png"
    path.write_bytes(data)
    upload = io.BytesIO(data)
    upload.read(20)
    for source in (path, str(path), data, bytearray(data), memoryview(data), upload):
        np.testing.assert_array_equal(read_image(source), RGB)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty file"),
        (b"Dear sir, this is a text that somebody named .png", "not an image.*accepted are PNG, JPEG"),
        (b"%PDF-1.7\n", "not an image"),
        (encoded(Image.fromarray(RGB))[:20], r"\(PNG\) is damaged or cut short"),
        (encoded(Image.fromarray(RGB))[:300], r"\(PNG\) is damaged or cut short"),
        (encoded_by_opencv(RGB16, ".png")[:500], r"\(PNG\) is damaged or cut short"),
        (encoded(Image.fromarray(np.kron(RGB, np.ones((9, 9, 1), np.uint8))), "JPEG")[:2000], "damaged or cut short"),
        (png(30_000, 30_000, 8, 0, bytes(100)), r"900 megapixels\); at most 50"),
        (png(10_000, 6_000, 8, 2, bytes(100)), "10000 × 6000 pixels.*at most 50 megapixels"),
        (png(12_000, 9_000, 1, 0, bytes(100)), "12000 × 9000 pixels.*at most 50 megapixels"),
    ],
    ids=["empty", "text", "pdf", "stub", "cut", "cut16", "cut jpeg", "900 MP", "60 MP", "108 MP"],
)
def test_bad_files_are_one_clear_sentence(data, message):
    with pytest.raises(ValueError, match=message) as caught:
        read_image(io.BytesIO(data))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


def test_what_is_no_source_is_refused():
    with pytest.raises(ValueError, match="not from int"):
        read_image(3)
    with pytest.raises(ValueError, match="binary mode"):
        read_image(io.StringIO("text"))
    with pytest.raises(FileNotFoundError):
        read_image("no such file.png")


def test_real_pictures(data_dir):
    shapes = {path.name: read_image(path).shape for path in (data_dir / "stereo" / "teddy").glob("left.*")}
    assert shapes == {"left.png": (375, 450, 3)}
    assert read_image(data_dir / "stereo" / "tsukuba" / "gt.pgm").shape == (288, 384)
