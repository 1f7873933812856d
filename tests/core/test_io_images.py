"""Pictures: every accepted kind is read correctly, and every bad one is refused in one clear sentence."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from benchmarks.picture_bytes import by_opencv, by_pillow, png, png_chunk
from stereolag.io.guard import guarded
from stereolag.io.images import UnseenFrames, read_frame, read_image

RNG = np.random.default_rng(5)
GREY = RNG.integers(0, 256, (13, 17), dtype=np.uint8)
RGB = RNG.integers(0, 256, (13, 17, 3), dtype=np.uint8)
RGBA = RNG.integers(0, 256, (13, 17, 4), dtype=np.uint8)
GREY16 = RNG.integers(0, 65536, (13, 17), dtype=np.uint16)
RGB16 = RNG.integers(0, 65536, (13, 17, 3), dtype=np.uint16)
RGBA16 = RNG.integers(0, 65536, (13, 17, 4), dtype=np.uint16)


def bgr_by_opencv(pixels: np.ndarray, ending: str) -> bytes:
    if pixels.ndim == 3:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_RGBA2BGRA if pixels.shape[2] == 4 else cv2.COLOR_RGB2BGR)
    return by_opencv(ending, pixels)


LOSSLESS = {"lossless": True, "exact": True}
BITS = RNG.random((13, 17)) > 0.5
HEIGHTS = np.where(RNG.random((9, 11)) < 0.2, np.nan, RNG.normal(size=(9, 11)))
FLOATS = np.float32(RGB[:, :, 0] / 7)
WRITTEN: dict[str, tuple[bytes, np.ndarray]] = {
    **{f"grey {kind}": (by_pillow(kind, GREY), GREY) for kind in ("PNG", "BMP", "TIFF", "PPM")},
    **{f"RGB {kind}": (by_pillow(kind, RGB), RGB) for kind in ("PNG", "BMP", "TIFF", "PPM")},
    "grey WEBP": (by_pillow("WEBP", GREY, **LOSSLESS), np.dstack([GREY] * 3)),
    "RGB WEBP": (by_pillow("WEBP", RGB, **LOSSLESS), RGB),
    "RGBA PNG": (by_pillow("PNG", RGBA), RGBA),
    "RGBA TIFF": (by_pillow("TIFF", RGBA), RGBA),
    "RGBA WEBP": (by_pillow("WEBP", RGBA, **LOSSLESS), RGBA),
    "grey with alpha": (by_pillow("PNG", Image.fromarray(RGBA[:, :, :2])), RGBA[:, :, [0, 0, 0, 1]]),
    "CMYK": (by_pillow("TIFF", Image.fromarray(RGB).convert("CMYK")), RGB),
    "floats": (by_pillow("TIFF", FLOATS), FLOATS),
    "floats of 64 bits, some without data": (by_opencv(".tiff", HEIGHTS), HEIGHTS),
    **{f"grey of 16 bits {ending}": (bgr_by_opencv(GREY16, ending), GREY16) for ending in (".png", ".tiff", ".pgm")},
    **{f"RGB of 16 bits {ending}": (bgr_by_opencv(RGB16, ending), RGB16) for ending in (".png", ".tiff")},
    **{f"RGBA of 16 bits {ending}": (bgr_by_opencv(RGBA16, ending), RGBA16) for ending in (".png", ".tiff")},
    "grey of 16 bits with alpha": (
        png(1, 1, 16, 4, pixels=b"\0\x12\x34\xff\xff"),
        np.array([[[0x1234, 0x1234, 0x1234, 0xFFFF]]], np.uint16),
    ),
    **{f"one bit {kind}": (by_pillow(kind, BITS), BITS * np.uint8(255)) for kind in ("PNG", "TIFF", "PPM")},
    # The values of a Netpbm are stretched to their type.
    "grey up to 15": (b"P5 3 1 15\n\0\x05\x0f", np.uint8([[0, 85, 255]])),
    "RGB up to 3": (b"P6 1 1 3\n\0\1\3", np.uint8([[[0, 85, 255]]])),
    "grey in words": (b"P2 # a\n2 1\n#b\n255 7 255", np.uint8([[7, 255]])),
    "one bit in words": (b"P1 4 2 0110 1 0 0 1", np.uint8([[255, 0, 0, 255], [0, 255, 255, 0]])),
    "RGB up to 65535": (b"P6 1 1 65535\n\0\1\0\2\xff\xff", np.uint16([[[1, 2, 65535]]])),
}


@pytest.mark.parametrize("kind", WRITTEN)
def test_every_accepted_kind_is_grey_rgb_or_rgba_without_loss(kind: str) -> None:
    data, expected = WRITTEN[kind]
    image = read_image(data)
    assert image.dtype == expected.dtype
    np.testing.assert_array_equal(image, expected)


@pytest.mark.parametrize("kind", ["JPEG", "GIF", "AVIF", "HEIF"])
def test_kinds_that_lose_a_little_are_close_and_upright(kind: str) -> None:
    smooth, on_its_side = np.add.outer(np.arange(64), np.arange(80)).astype(np.uint8), Image.Exif()
    on_its_side[0x0112] = 6
    turned = by_pillow(kind, smooth if kind == "GIF" else np.rot90(smooth).copy(), exif=on_its_side.tobytes())
    image = read_image(turned)
    grey = image if image.ndim == 2 else image[:, :, 0]
    assert np.abs(grey.astype(int) - smooth).max() <= 4
    with pytest.raises(ValueError, match="damaged or cut short"):
        read_image(turned[:300])


def test_a_palette_is_resolved():
    picture = Image.fromarray(np.array([[0, 1], [2, 1]], np.uint8)).convert("L")
    picture.putpalette([255, 0, 0, 0, 255, 0, 0, 0, 255])
    colours = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [0, 255, 0]]], np.uint8)
    np.testing.assert_array_equal(read_image(by_pillow("PNG", picture)), colours)
    for transparency in (1, bytes([255, 0, 255])):
        image = read_image(by_pillow("PNG", picture, transparency=transparency))
        np.testing.assert_array_equal(image[:, :, :3], colours)
        np.testing.assert_array_equal(image[:, :, 3], [[255, 0], [255, 0]])


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
        data = by_pillow("PNG", pixels, exif=exif)
    else:
        data = bgr_by_opencv(pixels, ".png")
        data = data[:33] + png_chunk(b"eXIf", exif.tobytes().removeprefix(b"Exif\0\0")) + data[33:]
    np.testing.assert_array_equal(read_image(data), upright)


def test_of_what_is_beside_the_pixels_of_a_png_only_an_orientation_counts_even_behind_them() -> None:
    data, upside_down = by_pillow("PNG", RGB), Image.Exif()
    gamma = png_chunk(b"gAMA", (100_000).to_bytes(4, "big"))
    np.testing.assert_array_equal(read_image(data[:33] + gamma + data[33:]), RGB)
    upside_down[0x0112] = 3
    behind = png_chunk(b"eXIf", upside_down.tobytes().removeprefix(b"Exif\0\0"))
    np.testing.assert_array_equal(read_image(data[:-12] + behind + data[-12:]), RGB[::-1, ::-1])


@pytest.mark.parametrize("tail", [1, 2, 100])
def test_every_cut_jpeg_is_damaged(tail: int) -> None:
    whole = by_pillow("JPEG", np.kron(RGB, np.ones((3, 3, 1), np.uint8)))
    assert read_image(whole).shape == (39, 51, 3)
    with pytest.raises(ValueError, match="damaged or cut short"):
        read_image(whole[:-tail])


def test_a_frame_lies_on_the_canvas_of_its_animation() -> None:
    stream = io.BytesIO()
    frames = [Image.fromarray(np.zeros((16, 16, 3), np.uint8) + shade) for shade in (7, 90)]
    frames[0].save(stream, "WEBP", save_all=True, append_images=frames[1:], lossless=True)
    data = stream.getvalue()
    wider = data[:24] + (19).to_bytes(3, "little") + (17).to_bytes(3, "little") + data[30:]
    image = read_image(wider, frame=1)
    assert image.shape == (18, 20, 3)
    assert (image[:16, :16] == 7).all()
    assert not image[16:].any()
    assert not image[:, 16:].any()


FRAMES = [np.full((12, 14, 3), shade, np.uint8) for shade in (10, 120, 240)]


def animated(kind: str) -> bytes:
    first, *others = (Image.fromarray(frame) for frame in FRAMES)
    options = {"lossless": True} if kind == "WEBP" else {"quality": 100}
    return by_pillow(kind, first, save_all=True, append_images=others, **options)


@pytest.mark.parametrize("kind", ["GIF", "WEBP", "PNG", "TIFF", "AVIF", "HEIF"])
def test_any_frame_can_be_chosen_and_none_is_left_out_in_silence(kind: str) -> None:
    data = animated(kind)
    for number, frame in enumerate(FRAMES, 1):
        image = read_image(data, frame=number)
        np.testing.assert_array_equal(image if image.ndim == 3 else image[:, :, np.newaxis], frame[:, :, : image.ndim])
        assert read_frame(data, number).count == 3
    with pytest.warns(UnseenFrames, match=r"holds 3 frames: choose one \(frame=1 is the first\)"):
        assert (read_image(data) == read_image(data, frame=1)).all()
    for wrong in (0, 4):
        with pytest.raises(ValueError, match=f"no frame {wrong}; it holds 3"):
            read_image(data, frame=wrong)
    with pytest.raises(ValueError, match="holds 3 frames"):  # nobody sees the warnings of a worker
        guarded(read_image)(data)


def test_one_frame_is_read_without_a_word_and_there_is_no_second() -> None:
    for data in (by_pillow("GIF", GREY), by_pillow("TIFF", RGB), b"P5 1 1 9\n\0", by_pillow("JPEG", RGB)):
        assert read_frame(data).count == 1
        with pytest.raises(ValueError, match="no frame 2; it holds 1"):
            read_image(data, frame=2)


def tiff(*pages: np.ndarray, order: str = "<", big: bool = False, **options: str) -> bytes:
    tifffile = pytest.importorskip("tifffile")
    stream = io.BytesIO()
    with tifffile.TiffWriter(stream, byteorder=order, bigtiff=big) as file:
        for page in pages:
            file.write(page, **({"photometric": "rgb" if page.ndim == 3 else "minisblack"} | options))
    return stream.getvalue()


@pytest.mark.parametrize(("order", "big"), [(">", False), ("<", False), ("<", True), (">", True)])
def test_pages_of_a_tiff_may_differ_in_size_and_numbers(order: str, big: bool) -> None:
    pages = [GREY, np.float64(RGB) / 7, GREY16]
    data = tiff(*pages, order=order, big=big)
    for number, page in enumerate(pages, 1):
        np.testing.assert_array_equal(read_image(data, frame=number), page)


NUMBERS = {
    np.int8: np.float32, np.int16: np.float32, np.int32: np.float64, np.uint32: np.float64, np.int64: np.float64,
    np.float32: np.float32, np.float64: np.float64,
}  # fmt: skip


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("kind", NUMBERS)
def test_all_numbers_of_a_tiff_keep_their_values(kind: type, channels: int) -> None:
    shape = (9, 11) if channels == 1 else (9, 11, 3)
    low, high = (-1, 1) if np.dtype(kind).kind == "f" else (np.iinfo(kind).min // 2, np.iinfo(kind).max // 2)
    pixels = RNG.uniform(low, high, shape).astype(kind)
    image = read_image(tiff(pixels))
    assert image.dtype == NUMBERS[kind]
    np.testing.assert_array_equal(image, pixels.astype(NUMBERS[kind]))


@pytest.mark.parametrize(
    ("pixels", "options", "said"),
    [
        (
            np.zeros((9, 11), np.float16),
            {},
            "1 × 16 bits per pixel, floats, which is not read: save it as grey, RGB or",
        ),
        (np.zeros((9, 11), np.complex64), {}, "1 × 64 bits per pixel, complex numbers, which"),
        (np.zeros((3, 9, 11), np.uint16), {"planarconfig": "separate"}, "in separate channels"),
        (RGB, {"subfiletype": 1}, "begins with a small preview, as raw photographs do"),
    ],
)
def test_a_tiff_that_is_not_read_is_named_and_not_called_damaged(pixels, options, said) -> None:
    with pytest.raises(ValueError, match=said):
        read_image(tiff(pixels, **options))


def test_path_bytes_and_file_are_the_same(tmp_path):
    data = by_pillow("PNG", RGB)
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
        (by_pillow("PNG", RGB)[:20], r"\(PNG\) is damaged or cut short"),
        (by_pillow("PNG", RGB)[:300], r"\(PNG\) is damaged or cut short"),
        (bgr_by_opencv(RGB16, ".png")[:500], r"\(PNG\) is damaged or cut short"),
        (png(12_000, 9_000, 1, 0, pixels=bytes(100)), "12000 × 9000 pixels.*at most 50 megapixels"),
        (b"II+\0\x08\0\0\0" + b"\xff" * 8, r"\(TIFF\) is damaged or cut short"),
    ],
    ids=["empty", "text", "pdf", "stub", "cut", "cut16", "108 MP", "a page beyond all files"],
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
