"""Short programs and commands that reproduce a result."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args, get_origin

import numpy as np

import stereolag
from stereolag.core.inputs import Image, as_grey, grey_scale, in_eight_bits
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.core.settings import Settings
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import SUBPIXEL, BlockMatcher, StereoSGBM
from stereolag.version import VERSION

if TYPE_CHECKING:
    from stereolag.assess.findings import Remedy

_PROGRAM = '''\
"""{purpose}

Written by stereolag {version}, which it {needs}. {files}
"""

from pathlib import Path

{imports}

FOLDER = Path(__file__).resolve().parent
{steps}'''

_DISPARITY = """
left = sl.read_image(FOLDER / {left})
right = sl.read_image(FOLDER / {right})
{prepared}
{matcher}
result = matcher.compute(left, right)

np.save(FOLDER / "disparity.npy", result.disparity)
sl.write_disparity(FOLDER / "disparity.pfm", result.disparity)
print(f"{{result.coverage:.1%}} of the pixels are measured; it took {{result.elapsed_s:.2f}} s")
"""

_RECTIFIED = """
cameras = sl.read_calibration(FOLDER / {cameras})
left, right, camera = sl.rectify(left, right, cameras, alpha={alpha})
"""

_DEPTH = """
depth = camera.depth(result.disparity)  # of the {of} image's pixels, metres; NaN where there is none
sl.write_depth(FOLDER / "depth.tif", depth)
sl.write_depth(FOLDER / "depth_mm.png", depth)  # millimetres; 0 where there is none, and beyond 65.535 m
print(f"{{np.isfinite(depth).mean():.1%}} of the pixels have a depth")
"""

_OPENCV = """

def eight_bits(image):  # OpenCV matches 8 bits: the values in use, spread over 0..255
    black, level = {black}, {level}
    return np.clip(np.rint((image.astype(np.float64) - black) / level), 0, 255).astype(np.uint8)


def grey_image(name):
    image = cv2.imread(str(FOLDER / name), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise SystemExit(f"{{name}} is not beside this file, or it is not an image.")
    image = {colours}
    return image if image.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(image[:, :, :3]), cv2.COLOR_BGR2GRAY)


left, right = grey_image({left}), grey_image({right})
if left.dtype != np.uint8:
    left, right = eight_bits(left), eight_bits(right)

{matcher}
raw = matcher.compute(left, right)  # the disparity × {subpixel}; (minDisparity - 1) * {subpixel} where there is none
disparity = np.where(raw > {none}, raw.astype(np.float32) / {subpixel}, np.float32(np.nan))

np.save(FOLDER / "disparity.npy", disparity)
print(f"{{np.isfinite(disparity).mean():.1%}} of the pixels are measured")
"""

_LAG = """
signal_1 = sl.read_signal(FOLDER / {first}).channels[0]
signal_2 = sl.read_signal(FOLDER / {second}).channels[0]

result = sl.signal_lag(
    signal_1,
    signal_2,
{settings}
)
print(f"lag {{result.lag}} samples, {{result.time_s:.6g}} s, score {{result.score:.3f}}: {{result.verdict}}")
"""

_FIND = """
image = sl.read_image(FOLDER / {image})
template = sl.read_image(FOLDER / {template})
{mask}
result = sl.match_template(
    image,
    template,
{settings}
)
for match in result.matches[: result.clear]:
    print(f"row {{match.row}}, column {{match.col}}, score {{match.score:.3f}}")
if not result.found:
    print(f"Not found: {{result.reason}}")
"""


class Cameras(NamedTuple):
    """How a program rectifies raw images.

    Attributes
    ----------
    name
        The name of the file with the calibration of both cameras.
    alpha
        The framing, as for :func:`stereolag.rectify`.
    remedies
        The input doctor's remedies applied afterwards, in order.
    """

    name: str
    alpha: float | None = None
    remedies: Sequence[Remedy] = ()


def script(
    matcher: StereoMatcher,
    left_name: str,
    right_name: str,
    calibration_name: str | None = None,
    *,
    cameras: Cameras | None = None,
) -> str:
    """Return a Python program that measures the same disparities, bit for bit, and the depth if there is a calibration.

    The program reads the files in its own folder, and writes ``disparity.npy`` and ``disparity.pfm`` there; with a
    calibration also ``depth.tif``, metres, and ``depth_mm.png``, millimetres.

    Parameters
    ----------
    matcher
        All its settings are written out, so that a later release with other defaults gives the same result.
    left_name, right_name
        The names of the two images, for example ``left.png``; folders in the names of files are dropped.
    calibration_name
        The name of the calibration of the rectified pair; None if there is none, or if `cameras` gives it.
    cameras
        How the program rectifies the images; None if they are rectified.
    """
    prepared, classes = "", imports(matcher)
    if cameras is not None:
        prepared = _RECTIFIED.format(cameras=_file_literal(cameras.name), alpha=cameras.alpha)
        prepared += "".join(
            f"left, right = apply_remedy(left, right, Remedy.{remedy.name})\n" for remedy in cameras.remedies
        )
        if cameras.remedies:
            classes = sorted([*classes, "from stereolag.assess.diagnosis import Remedy, apply_remedy"])
    if calibration_name is not None:
        prepared += f"camera = sl.read_calibration(FOLDER / {_file_literal(calibration_name)})\n"
    steps = _DISPARITY.format(
        left=_file_literal(left_name),
        right=_file_literal(right_name),
        prepared=prepared,
        matcher=constructor(matcher, before="matcher = "),
    )
    purpose = "Measure the disparity of a stereo pair, px: positive in front of infinity, NaN where there is none."
    if prepared:
        purpose = f"{purpose}\n\nFrom that, the depth along the optical axis, in metres."
        steps += _DEPTH.format(of="left" if cameras is None else "rectified left")
    return _program(
        purpose,
        "The images lie beside this file, and so will the results.",
        ["import numpy as np", "", "import stereolag as sl", *classes],
        steps,
    )


def opencv_script(
    matcher: BlockMatcher, left_name: str, right_name: str, images: tuple[Image, Image] | None = None
) -> str:
    """Return a Python program that measures the same disparities with ``cv2`` and ``numpy`` alone, bit for bit.

    It reads the two images in its own folder, PNG, or TIFF with grey floats, and writes ``disparity.npy`` there. All
    settings are written out under OpenCV's names. `images` are needed unless they have 8 bits: their values determine
    the conversion to 8 bits.
    """
    black, level, colours = 0.0, 1.0, "image"
    if images is not None:
        eight = in_eight_bits(*images)
        if eight[0].dtype == images[0].dtype:
            black, level = grey_scale(as_grey(images[0]), as_grey(images[1]))
        else:  # 8 bits stored in 16 are matched as 8 bits, so each channel is converted
            values, values_8 = (np.unique(one if one.ndim == 2 else one[:, :, :3]) for one in (images[0], eight[0]))
            level = float(np.ptp(values)) / float(np.ptp(values_8))
            black, colours = float(values[0]) - level * float(values_8[0]), "eight_bits(image)"
    if isinstance(matcher, StereoSGBM):
        arguments = matcher.opencv_arguments() | {"mode": f"cv2.{matcher.opencv_mode}"}
        lines = ["matcher = cv2.StereoSGBM.create(", *(f"    {name}={arguments[name]}," for name in arguments), ")"]
    else:  # StereoBM takes most of its settings one by one
        size = f"numDisparities={matcher.num_disparities}, blockSize={matcher.block_size}"
        others = {matcher.other_name(name): value for name, value in matcher}
        others = {name: value for name, value in others.items() if name not in ("numDisparities", "blockSize")}
        lines = [
            f"matcher = cv2.StereoBM.create({size})",
            *(f"matcher.set{name[0].upper()}{name[1:]}({value})" for name, value in others.items()),
        ]
    return _program(
        "Measure the disparity of a stereo pair with OpenCV alone, px: positive in front of infinity, NaN where there "
        "is none.",
        "The images lie beside this file, and so will the result.",
        ["import cv2", "import numpy as np"],
        _OPENCV.format(
            left=_file_literal(left_name),
            right=_file_literal(right_name),
            black=repr(black),
            level=repr(level),
            colours=colours,
            matcher="\n".join(lines),
            none=(matcher.min_disparity - 1) * SUBPIXEL,
            subpixel=SUBPIXEL,
        ),
        needs="does not need",
    )


def lag_command(search: LagSearch, first: str, second: str) -> str:
    """Return the command that measures the same lag between two files of one recording each."""
    return _command("lag", [first, second], search)


def lag_script(search: LagSearch, first: str, second: str) -> str:
    """Return a Python program that measures the same lag; every setting is written out."""
    return _program(
        "Measure the lag between two recordings: positive where the second hears the event later.",
        "The recordings lie beside this file.",
        ["import stereolag as sl"],
        _LAG.format(first=_file_literal(first), second=_file_literal(second), settings=_arguments(search.model_dump())),
    )


def find_command(query: TemplateQuery, image: str, template: str, mask: str | None = None) -> str:
    """Return the command that finds the same matches."""
    return _command("find", [image, template, *([] if mask is None else ["--mask", mask])], query)


def find_script(query: TemplateQuery, image: str, template: str, mask: str | None = None) -> str:
    """Return a Python program that finds the same matches; every setting is written out.

    A mask is above 0 in the valid pixels of the template.
    """
    settings = _arguments(query.arguments)
    return _program(
        "Find a template in an image: row and column of its top-left pixel.",
        "The images lie beside this file.",
        ["import stereolag as sl"],
        _FIND.format(
            image=_file_literal(image),
            template=_file_literal(template),
            mask="" if mask is None else f"mask = sl.read_image(FOLDER / {_file_literal(mask)})\n",
            settings=settings if mask is None else f"    mask=mask,\n{settings}",
        ),
    )


def _program(purpose: str, files: str, imports: Sequence[str], steps: str, needs: str = "needs") -> str:
    return _PROGRAM.format(
        purpose=purpose, version=VERSION, needs=needs, files=files, imports="\n".join(imports), steps=steps
    )


def _file_literal(name: str) -> str:
    """Return a file's name without folders as a string literal, safe for any name."""
    return _text_literal(re.split(r"[/\\]", name)[-1])


def _text_literal(text: str) -> str:
    """Return a text as a Python literal, in double quotes if these need no escapes."""
    literal = repr(text)
    return literal if '"' in literal else f'"{literal[1:-1]}"'


def _arguments(arguments: Mapping[str, object]) -> str:
    """Return the arguments of a call, and the seed, one per line."""
    return "\n".join(f"    {name}={_on_one_line(value)}," for name, value in [*arguments.items(), ("seed", 0)])


def _command(name: str, files: Sequence[str], settings: Settings) -> str:
    """Return a command with flags for all settings that have a value."""
    flags = [_flag(field.replace("_", "-"), value) for field, value in settings if value is not None]
    return " ".join(["stereolag", name, *files, *flags])


def _flag(name: str, value: object) -> str:
    if isinstance(value, bool):
        return f"--{name}" if value else f"--no-{name}"
    if isinstance(value, list | tuple):
        return f"--{name} {','.join(map(str, value))}"
    exact = isinstance(value, float) and float(f"{value:.12g}") == value
    return f"--{name} {value:.12g}" if exact else f"--{name} {value}"


MAX_LINE_LENGTH = 88
"""Characters of a line in a program."""
INDENT_WIDTH = 4


def constructor(settings: Settings, *, before: str = "") -> str:
    """Return the call that makes equal settings: all numbers and choices, and nested settings that were changed.

    Classes of the public API are written ``sl.Name``, others ``Name``: :func:`imports` returns their imports. A call
    that is too long for a line after the text `before` it, for example ``"matcher = "``, has one argument per line.
    """
    return _formatted(settings, before, 0)


def imports(settings: Settings) -> list[str]:
    """Return the import lines for the classes in the call of :func:`constructor` that are not public."""
    modules: dict[str, set[str]] = {}
    for kind in _classes(settings):
        if not _is_public(kind):
            modules.setdefault(kind.__module__, set()).add(kind.__name__)
    return [f"from {module} import {', '.join(sorted(names))}" for module, names in sorted(modules.items())]


def _formatted(value: Any, before: str, column: int) -> str:
    """Return `before` and the value on one line, or on several if one is too long, given its first column."""
    line = before + _on_one_line(value)
    start, arguments, end = _parts(value)
    if column + len(line) < MAX_LINE_LENGTH or not arguments:
        return line
    inner = column + INDENT_WIDTH
    lines = [" " * inner + _formatted(item, name, inner) + ",\n" for name, item in arguments]
    return before + start + "\n" + "".join(lines) + " " * column + end


def _on_one_line(value: Any) -> str:
    if isinstance(value, str):
        return _text_literal(value)
    start, arguments, end = _parts(value)
    if not start:
        return repr(value)
    comma = "," if isinstance(value, tuple) and len(value) == 1 else ""
    return start + ", ".join(name + _on_one_line(item) for name, item in arguments) + comma + end


def _parts(value: Any) -> tuple[str, list[tuple[str, Any]], str]:
    """Return the opening bracket, the items with their ``name=``, and the closing bracket; empty for a plain value."""
    if isinstance(value, Settings):
        kind = type(value)
        name = f"sl.{kind.__name__}" if _is_public(kind) else kind.__name__
        return f"{name}(", [(f"{field}=", item) for field, item in _fields(value)], ")"
    if isinstance(value, list):
        return "[", [("", item) for item in value], "]"
    if isinstance(value, tuple):
        return "(", [("", item) for item in value], ")"
    return "", [], ""


def _fields(settings: Settings) -> Iterator[tuple[str, Any]]:
    """Yield the fields that are written out.

    The others are tags of a union, which can have only one value, and stages that are off or nested settings at their
    defaults, which would obscure the actual choices.
    """
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        only_value = get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
        is_default_stage = value == field.default and (value is None or isinstance(value, Settings))
        if not only_value and not is_default_stage:
            yield name, value


def _classes(value: Any) -> Iterator[type[Settings]]:
    """Yield the class of every settings object in a value."""
    if isinstance(value, Settings):
        yield type(value)
    for _, item in _parts(value)[1]:
        yield from _classes(item)


def _is_public(kind: type[Settings]) -> bool:
    return getattr(stereolag, kind.__name__, None) is kind
