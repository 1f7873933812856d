"""Hostile calibrations and settings of matchers by name."""

from __future__ import annotations

import json

import numpy as np
from hostile_cases import MB, HostileFile

ROTATION = "1, 0, 0, 0, 1, 0, 0, 0, 1"


def plain(**changes: object) -> bytes:
    return json.dumps({"focal_px": 700, "baseline_m": 0.5} | changes).encode()


def rig(camera: str = "500, 0, 160, 0, 500, 120, 0, 0, 1", **changes: str) -> bytes:
    parts = {"D1": "0, 0, 0, 0", "R": ROTATION, "T": "-0.1, 0, 0", "image_size": "320, 240"} | changes
    cameras = "".join(f"{name}:\n  rows: 3\n  cols: 3\n  data: [{camera}]\n" for name in ("M1", "M2"))
    return ("%YAML:1.0\n---\n" + cameras + "".join(f"{name}: [{part}]\n" for name, part in parts.items())).encode()


def projections(focal: str, left: str, right: str) -> bytes:
    row = "{}: {} 0 600 {} 0 720 170 0 0 0 1 0\n"
    return (row.format("P2", focal, left) + row.format("P3", focal, right)).encode()


def reprojection(**changes: float) -> bytes:
    q = np.array([[1, 0, 0, -300.0], [0, 1, 0, -200], [0, 0, 0, 700], [0, 0, 10, 0]])
    for place, value in changes.items():
        q[int(place[1]), int(place[2])] = value
    return json.dumps({"Q": q.tolist()}).encode()


def calibrations() -> list[HostileFile]:
    far = "from -1e.12 to 1e.12"
    files = {
        "principal point of 1e308": (lambda: plain(cx=1e308, cy=-1e308), far),
        "principal point of 1e9": (lambda: plain(cx=1e9), "allowed are -1e.07 to 1e.07 px"),
        "focal length of 1e-300": (lambda: plain(focal_px=1e-300), "allowed are 0.001 to 1e.07"),
        "focal length of 1e308": (lambda: plain(focal_px=1e308), far),
        "focal length true": (lambda: plain(focal_px=True), "no focal_px|no known format"),
        "focal length null": (lambda: plain(focal_px=None), "no known format"),
        "focal length of 4,000 digits": (lambda: plain().replace(b"700", b"7" * 4000), "finite numbers|1e.12"),
        "focal length of 9,000 digits": (lambda: plain().replace(b"700", b"7" * 9000), "cannot be parsed"),
        "baseline of 1e308": (lambda: plain(baseline_m=1e308), far),
        "baseline of 1e-308": (lambda: plain(baseline_m=1e-308), "allowed are 1e-09 to 1e.09"),
        "doffs of -1e308": (lambda: plain(doffs_px=-1e308), far),
        "1e38 disparities": (lambda: plain(num_disparities=1e38), far),
        "width of 1e308": (lambda: plain(width=1e308), far),
        "width of 1e9": (lambda: plain(width=1e9), "allowed are 1 to 100000"),
        "numbers that are lists of lists": (lambda: plain(focal_px=[[[[1]]], 2]), "finite numbers only"),
        "lists within 100,000 lists": (lambda: b'{"focal_px": ' + b"[" * 100_000, "cannot be parsed"),
        "lists within 90 lists": (lambda: b'{"focal_px": ' + b"[" * 90 + b"]" * 90 + b"}", "finite numbers only"),
        "projections of ±1e308": (lambda: projections("720", "1e308", "-1e308"), far),
        "projection with focal length 5e-324": (lambda: projections("5e-324", "45", "-339"), "allowed are 0.001 to"),
        "projection of nan": (lambda: projections("nan", "45", "-339"), "finite numbers only"),
        "reprojection with 1 / baseline of 5e-324": (
            lambda: reprojection(q32=5e-324),
            "baseline_m is inf; allowed are finite",
        ),
        "reprojection with 1 / baseline of 1e-300": (lambda: reprojection(q32=1e-300, q33=5), "allowed are"),
        "reprojection with a focal length of 1e300": (lambda: reprojection(q23=1e300), far),
        "cameras of 1e308": (lambda: rig("1e308, 0, 1e308, 0, 1e308, 1e308, 0, 0, 1"), far),
        "cameras with a centre at 1e11": (lambda: rig("500, 0, 1e11, 0, 500, 120, 0, 0, 1"), "from -1e.07 to 1e.07"),
        "cameras with a focal length of 1e-300": (
            lambda: rig("1e-300, 0, 160, 0, 500, 120, 0, 0, 1"),
            "0.001 to 1e.07",
        ),
        "cameras with a centre at 1e7": (lambda: rig("500, 0, 1e7, 0, 500, 1e7, 0, 0, 1"), ""),
        "distortion of 1e308": (lambda: rig(D1="1e308, 1e308, 0, 0"), far),
        "distortion of 1e9": (lambda: rig(D1="1e9, 1e9, 0, 0"), ""),
        "distortion of -5": (lambda: rig(D1="-5, 0, 0, 0"), ""),
        "rotation of 1e308": (lambda: rig(R="1e308, 0, 0, 0, 1e308, 0, 0, 0, 1e308"), far),
        "rotation of 1e12": (lambda: rig(R="1e12, 0, 0, 0, 1e12, 0, 0, 0, 1e12"), "from -10 to 10"),
        "rotation by 180°": (lambda: rig(R="-1, 0, 0, 0, -1, 0, 0, 0, 1"), ""),
        "translation of 1e308": (lambda: rig(T="-1e308, 0, 0"), far),
        "translation of 5e-324": (lambda: rig(T="-5e-324, 0, 0"), ""),
        "matrix of 1e308 rows": (lambda: rig().replace(b"rows: 3", b"rows: 1e308"), "announces 1e.308 × 3"),
        "matrix of -3 rows": (lambda: rig().replace(b"rows: 3", b"rows: -3"), "announces -3 × 3"),
        "a name of 1 MB": (lambda: b"a" * MB, "no known format"),
        "spaces of 1 MB": (lambda: b"a" + b" " * (MB - 9) + b"=", ""),
        "300,000 names": (lambda: b"a:\n" * 300_000, "no known format"),
        "1 MB of brackets": (lambda: b"a: " + b"[" * (MB - 9), "no known format"),
        "1 MB of dashes": (lambda: b"- " * (MB // 2 - 9), "no known format"),
        "100,000 assignments": (lambda: b"".join(b"k%d=1\n" % i for i in range(80_000)), "no known format"),
        "60 MB": (lambda: b" " * (60 * MB), "at most 1,048,576 are accepted"),
        "NUL": (lambda: plain() + b"\0", "NUL byte"),
        "not UTF-8": (lambda: b"\xff" + plain(), "not a text file"),
    }
    return [HostileFile(f"calibration: {name}", "calibration", make, answer) for name, (make, answer) in files.items()]


def settings(method: str = "StereoBM", **changes: object) -> bytes:
    return json.dumps({"method": method, "settings": changes}).encode()


def matchers() -> list[HostileFile]:
    files = {
        "window a word": (
            lambda: settings(block_size="wide"),
            "block_size is 'wide'; allowed are whole numbers from 5 to 255",
        ),
        "window of 2.5": (lambda: settings(block_size=2.5), "block_size is 2.5; allowed are whole numbers"),
        "window of 10^18": (
            lambda: settings(block_size=10**18 + 1),
            "block_size is 10*1; allowed are whole numbers from 5 to 255",
        ),
        "window of -1": (lambda: settings(block_size=-1), "block_size is -1; allowed are whole numbers from 5"),
        "window of 4,000 digits": (
            lambda: settings().replace(b"{}", b'{"block_size": %s}' % (b"9" * 4000)),
            "block_size is",
        ),
        "window of 9,000 digits": (
            lambda: settings().replace(b"{}", b'{"block_size": %s}' % (b"9" * 9000)),
            "not JSON",
        ),
        "window NaN": (lambda: settings(block_size=float("nan")), "block_size is"),
        "window infinite": (lambda: settings(block_size=float("inf")), "block_size is"),
        "window null": (lambda: settings(block_size=None), "block_size is None; allowed are whole numbers"),
        "window a list": (lambda: settings(block_size=[1]), "block_size is a list of 1; allowed are whole numbers"),
        "overlap of 1e308": (
            lambda: settings("CorrelationMatcher", overlap=1e308),
            "overlap is 1e.308; allowed are numbers from 0 below 1",
        ),
        "overlap NaN": (lambda: settings("CorrelationMatcher", overlap=float("nan")), "overlap is"),
        "score an image of Markdown": (
            lambda: settings("CorrelationMatcher", score="![x](http://e.org)"),
            "score is '..x..http:..e.org.'; allowed are 'zncc', 'ncc'",
        ),
        "unknown setting of Markdown": (lambda: settings(**{"![x](http://e.org)": 1}), "StereoBM has no setting"),
        "settings a number": (lambda: b'{"method": "StereoBM", "settings": 3}', '"settings", an object'),
        "settings a list": (lambda: b'{"method": "StereoBM", "settings": []}', '"settings", an object'),
        "method a list": (lambda: b'{"method": ["StereoBM"], "settings": {}}', "names the method"),
        "method of a megabyte": (lambda: settings("a" * 60_000), "names the method"),
        "no method": (lambda: b'{"settings": {}}', "must be a JSON object"),
        "a list": (lambda: b"[]", "must be a JSON object"),
        "100,000 lists": (lambda: b"[" * 65_000, "not JSON"),
        "60 MB": (lambda: b" " * (60 * MB), "at most 65,536 are accepted"),
        "not UTF-8": (lambda: b"\xff\xfe", "not JSON"),
        "a texture test of lists": (
            lambda: settings("CorrelationMatcher", texture=[[]]),
            "texture is a list of 1; allowed are settings of TextureTest",
        ),
        "filling a word": (
            lambda: settings("CorrelationMatcher", filling="perhaps"),
            "filling is 'perhaps'; allowed are True and False",
        ),
    }
    return [HostileFile(f"settings: {name}", "matcher", make, answer) for name, (make, answer) in files.items()]
