"""``python -m tools.golden record FILE`` and ``compare FILE``: public results before and after a refactoring.

Only public names, commands and pages are used, so that it runs on any commit: record on the commit before, compare on
the one after. Arrays and files are recorded as digests, everything else as JSON; times and versions are omitted.
``--only lags`` restricts it to one group, ``--from CHECKOUT`` uses the package of another checkout.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import difflib
import enum
import functools
import hashlib
import io
import json
import re
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

PROJECT = Path(__file__).resolve().parents[1]

SKIPPED_PREFIXES = ("elapsed_s", "settings", "_")
"""Prefixes of the names of fields that differ from run to run, or that are compared as files."""

RECORDED_PROPERTIES = ("verdict", "rivals", "inverted", "drift_ppm", "found", "reason", "healthy", "range")
"""Properties that are part of a result."""

TIMES = re.compile(r'"(elapsed_s|seconds|milliseconds|ms|time_ms|version|stereolag)": ("[^"]*"|[\d.e+-]+)')

ADDRESSES = {
    "Sensor_lag": [
        "",
        "recordings=harbour&method=phat",
        "max_lag=60000&speed=340.5&sampling_rate=48000",
        "method=sampled&max_lag=-3&unknown=1",
    ],
    "Rocketman_search": [
        "",
        "picture=maze_dulled&method=sampled",
        "max_matches=3&min_score=0.4&min_scale=0.9&max_scale=1.1&max_rotation=5",
        "method=nonsense&min_score=7",
    ],
    "Depth_maps": [
        "",
        "pair=fence&size=1%2F4&maps=correlation,bm",
        "pair=cube&size=1%2F2&window_size=11&overlap=0.8&search.kind=rectified&search.num_disparities=48&bm.block_size=9",
        "pair=square&size=1%2F4&median=on&median.radius=3&left_right=none&sgbm.mode=hh&window_size=9999",
    ],
}

MAX_TEXT_LENGTH = 4000
"""Characters up to which a text file is recorded in full, so that differences can be read."""

OPENED_KEYS = ("depth.take.opened", "lag.take.opened", "template.take.opened")
"""Session-state keys of the collapsible parts in which pages offer their files."""


def plain(value: Any) -> Any:
    """Return a result as JSON of plain values; arrays become a digest of their type, shape and bytes."""
    if isinstance(value, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()[:16]
        return f"{value.dtype} {value.shape} {digest}"
    if isinstance(value, bytes):
        return f"{len(value)} bytes {hashlib.sha256(value).hexdigest()[:16]}"
    if isinstance(value, enum.Enum):
        return f"{value.name}"
    if isinstance(value, np.generic):
        return value.item()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value) if not field.name.startswith(SKIPPED_PREFIXES)]
        names += [
            name
            for name in RECORDED_PROPERTIES
            if isinstance(getattr(type(value), name, None), property | functools.cached_property)
        ]
        return {name: plain(getattr(value, name)) for name in names}
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, range) or value != value:  # NaN equals nothing, not even itself
        return repr(value)
    return value if value is None or isinstance(value, bool | int | float | str) else repr(value)


def of_map(result: Any) -> dict[str, Any]:
    """Return the arrays of a disparity map."""
    names = ("disparity", "dy", "dx", "lag", "score", "valid", "filled", "reason")
    return {name: plain(getattr(result, name)) for name in names}


def half(image: Any) -> Any:
    """Return every second row and column, so that all methods together take seconds only."""
    return np.ascontiguousarray(image[::2, ::2])


def maps() -> Iterator[tuple[str, Any]]:
    """Yield the maps of all methods on the bundled pairs."""
    import stereolag as sl
    from stereolag import samples

    for name, pair in samples.stereo_pairs().items():
        left, right = (half(sl.read_image(path)) for path in (pair.left, pair.right))
        reach = (pair.num_disparities // 2 + 15) // 16 * 16
        search = sl.SearchArea.rectified(reach, vertical=1)
        matchers = {
            "report": sl.preset("report", num_disparities=reach),
            "fast": sl.preset("fast", num_disparities=reach),
            "accurate": sl.preset("accurate", num_disparities=reach),
            "windows zncc": sl.CorrelationMatcher(window_size=11, overlap=0.9, search=search),
            "windows phase": sl.CorrelationMatcher(
                window_size=16, overlap=0.75, search=sl.SearchArea.centred(40), score="phase"
            ),
            "windows ncc": sl.CorrelationMatcher(window_size=9, overlap=0.5, search=search, score="ncc"),
            "bm": sl.StereoBM(num_disparities=reach, block_size=15),
            "sgbm": sl.StereoSGBM(num_disparities=reach, block_size=5),
        }
        truth = half(sl.read_disparity(pair.disparity)) / 2
        for title, matcher in matchers.items():
            result = matcher.compute(left, right)
            evaluation = sl.evaluate(result.disparity, truth)
            yield f"{name} {title}", {"map": of_map(result), "evaluation": plain(evaluation)}
        grey = left[..., 0].astype(np.float32), right[..., 0].astype(np.float32)
        yield f"{name} accurate float32", of_map(matchers["accurate"].compute(*grey))
        deep = left.astype(np.uint16) * 257, right.astype(np.uint16) * 257
        yield f"{name} fast uint16", of_map(matchers["fast"].compute(*deep))


def lags() -> Iterator[tuple[str, Any]]:
    """Yield the lags of the bundled recordings, whole and in part, and of synthetic ones."""
    import stereolag as sl
    from stereolag import samples

    random = np.random.default_rng(1)
    noise = random.normal(size=20_000)
    pairs = {
        name: (sl.read_signal(one.signal_1), sl.read_signal(one.signal_2)) for name, one in samples.recordings().items()
    }
    tone = np.sin(np.arange(9000) / 7)
    pairs |= {
        "noise": (noise[500:], noise[:-500]),
        "apart": (noise[:8000], random.normal(size=8000)),
        "inverted": (noise[:-40], -noise[40:]),
        "tone": (tone[50:], tone[:-50]),
    }
    for name, (first, second) in pairs.items():
        for method in ("fft", "phat", "sampled", "direct"):
            reach = {"max_lag": 600} if method == "direct" or name not in ("coast", "harbour") else {}
            yield f"{name} {method}", plain(sl.signal_lag(first, second, method=method, seed=0, **reach))
    coast = pairs["coast"]
    yield "coast within 60000", plain(sl.signal_lag(*coast, max_lag=60_000, speed=333))


def searches() -> Iterator[tuple[str, Any]]:
    """Yield the places of templates in the bundled mazes."""
    import stereolag as sl
    from stereolag import samples

    for name, maze in samples.mazes().items():
        picture, template = sl.read_image(maze.picture), sl.read_image(maze.template)
        part = np.ascontiguousarray(picture[maze.row - 100 : maze.row + 200, maze.col - 150 : maze.col + 250])
        yield f"{name} fft", plain(sl.match_template(picture, template, max_matches=3))
        yield f"{name} sampled", plain(sl.match_template(picture, template, method="sampled", seed=0))
        yield f"{name} direct", plain(sl.match_template(half(part), half(template), method="direct"))
        yield f"{name} opaque", plain(sl.match_template(picture[..., 1], template[..., 1]))
        yield f"{name} posed", plain(sl.match_template(part, template, scales=(0.9, 1.1), rotations=(-4, 4)))
        yield f"{name} absent", plain(sl.match_template(part[:150, :150], template))


def flows() -> Iterator[tuple[str, Any]]:
    """Yield optical flow and scene flow of the drive."""
    import stereolag as sl
    from stereolag import samples

    (drive,) = samples.drives().values()
    frames = [[half(sl.read_image(paths[at])) for paths in (drive.left, drive.right)] for at in (3, 4)]
    (left, right), (next_left, next_right) = frames
    yield "flow", plain(sl.optical_flow(left, next_left))
    yield "flow narrow", plain(sl.optical_flow(left, next_left, search=8))
    calibration = sl.read_calibration(drive.calibration).scaled(0.5)
    yield "calibration", plain(calibration)
    matcher = sl.preset("fast", num_disparities=64)
    first, second = matcher.compute(left, right), matcher.compute(next_left, next_right)
    flow = sl.optical_flow(left, next_left)
    yield "scene flow", plain(sl.scene_flow(first, second, flow, calibration, frames=(left, next_left)))


def diagnoses() -> Iterator[tuple[str, Any]]:
    """Yield the findings on the bundled pairs, unchanged and with defects."""
    import stereolag as sl
    from stereolag import samples

    for name, pair in samples.stereo_pairs().items():
        left, right = (half(sl.read_image(path)) for path in (pair.left, pair.right))
        versions = {
            "as it is": (left, right),
            "swapped": (right, left),
            "row off": (left, np.roll(right, 2, axis=0)),
            "darker": (left, (right * 0.6).astype(np.uint8)),
            "identical": (left, left),
        }
        for title, (one, other) in versions.items():
            yield f"{name} {title}", plain(sl.diagnose(one, other, num_disparities=64).findings)


def commands() -> Iterator[tuple[str, Any]]:
    """Yield the output of every command on the bundled examples, and the files it writes."""
    from stereolag.commands import main
    from stereolag.samples import ASSETS

    signals, stereo, drive = ASSETS / "signals", ASSETS / "stereo", ASSETS / "drive" / "motorway"
    cube = [stereo / "cube" / f"{side}.png" for side in ("left", "right")]
    truth = ["--truth", stereo / "cube" / "disparity.png", "--calibration", stereo / "cube" / "calibration.json"]
    given: dict[str, list[Any]] = {
        "help": ["--help"],
        "lag help": ["lag", "--help"],
        "find help": ["find", "--help"],
        "depth help": ["depth", "--help"],
        "depth fast help": ["depth", "--preset", "fast", "--help"],
        "depth bm help": ["depth", "--method", "bm", "--help"],
        "sequence help": ["sequence", "--help"],
        "calibrate help": ["calibrate", "--help"],
        "lag": ["lag", signals / "coast_1.flac", signals / "coast_2.flac"],
        "lag json": ["lag", signals / "harbour_1.flac", signals / "harbour_2.flac", "--json"],
        "find": ["find", ASSETS / "maze" / "maze.png", ASSETS / "maze" / "rocketman.png"],
        "find json": ["find", ASSETS / "maze" / "maze.png", ASSETS / "maze" / "rocketman.png", "--json"],
        "depth": ["depth", *cube, *truth],
        "depth json": ["depth", *cube, *truth, "--json", "--preset", "fast", "--median.radius", "4"],
        "depth files": ["depth", *cube, *truth, "--preset", "fast", "--out", "map"],
        "depth bm files": ["depth", *cube, "--method", "bm", "--out", "map"],
        "sequence": ["sequence", "left", "right", "--out", "maps", "--method", "bm"],
        "refused flag": ["depth", *cube, "--preset", "fast", "--window-size", "9999"],
        "refused file": ["depth", cube[0], signals / "coast_1.flac"],
        "refused pair": ["depth", cube[0], stereo / "road" / "right.png"],
    }
    for name, arguments in given.items():
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            for side in ("left", "right") if name == "sequence" else ():
                Path(side).mkdir()
                for path in sorted((drive / side).iterdir())[:4]:
                    Path(side, path.name).symlink_to(path)
            out, err = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                try:
                    code = main([str(one) for one in arguments])
                except SystemExit as ended:
                    code = ended.code if isinstance(ended.code, int) else 1
            files = {
                path.relative_to(folder).as_posix(): written(path.read_bytes())
                for path in sorted(Path(folder).rglob("*"))
                if path.is_file() and not path.is_symlink()
            }
            texts = [without_times(one.getvalue()).replace(str(ASSETS), "assets") for one in (out, err)]
            yield name, {"code": code, "out": texts[0].splitlines(), "err": texts[1].splitlines()[-3:], "files": files}


def without_times(text: str) -> str:
    """Return a text without run times and versions, which differ from run to run."""
    text = TIMES.sub(r'"\1": …', text)
    text = re.sub(r"\b[\d.,]+ (ms|s)\b", r"… \1", text)
    text = re.sub(r"\b[\d.,]+ a second\b", "… a second", text)
    text = re.sub(r"(Computed in \*\*)[^*]+", r"\1…", text)
    return re.sub(r"stereolag \d+\.\d+(\.\d+)?", "stereolag …", text)


def written(data: bytes) -> Any:
    """Return a file's digest; of a text without times, and in full if it is short; of a ZIP those of its entries."""
    if zipfile.is_zipfile(io.BytesIO(data)):
        with zipfile.ZipFile(io.BytesIO(data)) as whole:
            return {name: written(whole.read(name)) for name in whole.namelist()}
    if data[:4] == b"RIFF" and b"PEAK" in data[:200]:
        at = data.index(b"PEAK")
        data = data[: at + 12] + data[at + 16 :]  # the time of writing
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return plain(data)
    if text.startswith("number,"):
        text = re.sub(r"^((?:[^,\n]*,){6})[^,\n]*", r"\1…", text, flags=re.MULTILINE)  # the milliseconds of each frame
    if text.startswith("method,"):
        text = re.sub(r",[^,\n]*$", "", text, flags=re.MULTILINE)  # the last column is a time
    text = without_times(text)
    return text.splitlines() if len(text) < MAX_TEXT_LENGTH else plain(text.encode())


def files() -> Iterator[tuple[str, Any]]:
    """Yield maps and settings written and read back through the public API."""
    import stereolag as sl
    from stereolag import samples

    disparity = half(sl.read_disparity(samples.stereo_pairs()["cube"].disparity))
    with tempfile.TemporaryDirectory() as folder:
        for ending in ("pfm", "npy", "png"):
            path = Path(folder, f"map.{ending}")
            sl.write_disparity(path, disparity)
            yield f"map {ending}", [plain(path.read_bytes()), plain(sl.read_disparity(path))]
        for name in ("report", "fast", "accurate"):
            path = Path(folder, f"{name}.json")
            sl.write_matcher(path, sl.preset(name, num_disparities=48))
            kept = json.loads(path.read_text())
            kept.pop("stereolag", None)
            yield f"settings {name}", [kept, plain(sl.read_matcher(path))]
    for name, pair in samples.stereo_pairs().items():
        yield f"calibration {name}", plain(sl.read_calibration(pair.calibration))
        yield f"image {name}", plain(sl.read_image(pair.left))


def pages() -> Iterator[tuple[str, Any]]:
    """Yield the contents of pages at several addresses: texts, control values, and the resulting address."""
    from streamlit.testing.v1 import AppTest

    for name, addresses in ADDRESSES.items():
        (path,) = (PACKAGE_ROOT / "pages").glob(f"*_{name}.py")
        for address in addresses:
            app = AppTest.from_file(PACKAGE_ROOT / "app.py", default_timeout=120)
            for key in OPENED_KEYS:
                app.session_state[key] = True
            app.switch_page(str(path.relative_to(PACKAGE_ROOT)))
            for part in filter(None, address.split("&")):
                key, _, value = part.partition("=")
                app.query_params[key] = value.replace("%2F", "/")
            with downloads_kept() as kept:
                app.run()
            yield f"{name}?{address}", shown(app) | {"files": kept}


@contextlib.contextmanager
def downloads_kept() -> Iterator[dict[str, Any]]:
    """Collect the digests of all files that a page offers, by name."""
    import streamlit as st
    from streamlit.delta_generator import DeltaGenerator

    kept: dict[str, Any] = {}
    original = DeltaGenerator.download_button

    def draw(self: Any, label: str, data: Any, file_name: str | None = None, *others: Any, **more: Any) -> Any:
        if not more.get("disabled"):
            made = data() if callable(data) else data
            kept[f"{label} {file_name}"] = written(made.encode() if isinstance(made, str) else made)
        return original(self, label, b"", file_name, *others, **more)

    page, on_page = st.download_button.__self__, st.download_button
    DeltaGenerator.download_button, st.download_button = draw, functools.partial(draw, page)
    try:
        yield kept
    finally:
        DeltaGenerator.download_button, st.download_button = original, on_page


def shown(app: Any) -> dict[str, Any]:
    """Return the texts, controls, address and exceptions of a page."""
    controls = {}
    for kind in ("slider", "number_input", "selectbox", "segmented_control", "toggle", "checkbox", "text_input"):
        with contextlib.suppress(KeyError, AttributeError):
            for one in app.get(kind):
                controls[f"{kind} {getattr(one, 'label', '')}"] = plain(getattr(one, "value", None))
    texts = [
        without_times(str(one.value))
        for kind in ("title", "header", "subheader", "error", "warning", "info", "success", "markdown", "caption")
        for one in app.get(kind)
        if "<style>" not in str(one.value)
    ]
    return {
        "exceptions": [str(one.value) for one in app.exception],
        "address": {key: value for key, value in sorted(app.query_params.items())},
        "controls": controls,
        "texts": sorted(set(texts)),
    }


GROUPS: dict[str, Callable[[], Iterator[tuple[str, Any]]]] = {
    one.__name__: one for one in (maps, lags, searches, flows, diagnoses, commands, files, pages)
}

PACKAGE_ROOT = PROJECT


def results(groups: list[str]) -> dict[str, Any]:
    """Return the results of groups; an exception counts as a result."""
    found: dict[str, Any] = {}
    for group in groups:
        try:
            for name, result in GROUPS[group]():
                found[f"{group}: {name}"] = result
        except Exception as error:
            found[f"{group}: ended by"] = f"{type(error).__name__}: {error}"
        print(f"{group}: {sum(name.startswith(group + ':') for name in found)} results", file=sys.stderr)
    return found


def differences(before: Any, after: Any, place: str) -> Iterator[str]:
    """Yield a description of every difference; of texts and lists, only the lines that differ."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in [*before, *(key for key in after if key not in before)]:
            yield from differences(before.get(key, "(absent)"), after.get(key, "(absent)"), f"{place} › {key}")
    elif isinstance(before, list) and isinstance(after, list):
        if before != after:
            lines = [[json.dumps(one, ensure_ascii=False) for one in side] for side in (before, after)]
            changed = [line for line in difflib.ndiff(*lines) if line[0] in "+-"]
            yield "\n    ".join((place, *changed))
    elif isinstance(before, str) and isinstance(after, str) and "\n" in before:
        yield from differences(before.splitlines(), after.splitlines(), place)
    elif before != after:
        yield f"{place}\n    - {before}\n    + {after}"


def main() -> int:
    """Record or compare results; return 1 if any value differs."""
    global PACKAGE_ROOT
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("action", choices=["record", "compare"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", action="append", choices=[*GROUPS], help="a group; all by default")
    parser.add_argument("--from", dest="checkout", type=Path, default=PROJECT, help="the checkout whose package runs")
    options = parser.parse_args()
    PACKAGE_ROOT = options.checkout.resolve()
    sys.path.insert(0, str(PACKAGE_ROOT))
    warnings.simplefilter("ignore")
    found = json.loads(json.dumps(results(options.only or [*GROUPS])))
    if options.action == "record":
        options.file.write_text(json.dumps(found, indent=1, ensure_ascii=False))
        print(f"{len(found)} results recorded.")
        return 0
    kept = json.loads(options.file.read_text())
    expected = {name: one for name, one in kept.items() if name.split(":")[0] in (options.only or GROUPS)}
    lines = [*differences(expected, found, "")]
    print(*lines, sep="\n")
    print(f"{len(expected)} results compared; {len(lines)} values differ.")
    return bool(lines)


if __name__ == "__main__":
    sys.exit(main())
