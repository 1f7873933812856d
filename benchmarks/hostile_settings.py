"""Hostile calibrations and matcher settings by name."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib

import numpy as np

from benchmarks.picture_bytes import MB, READ, Case
from benchmarks.recording_bytes import saved

ROTATION = "1, 0, 0, 0, 1, 0, 0, 0, 1"


def plain(**changes: object) -> bytes:
    return json.dumps({"focal_px": 700, "baseline_m": 0.5} | changes).encode()


def rig(camera: str = "500, 0, 160, 0, 500, 120, 0, 0, 1", **changes: str) -> bytes:
    parts = {
        "D1": "0, 0, 0, 0",
        "D2": "0, 0, 0, 0",
        "R": ROTATION,
        "T": "-0.1, 0, 0",
        "image_size": "320, 240",
    } | changes
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


def laughs(merging: bool = False) -> bytes:
    """Return ten lists, each with ten aliases of the one before: 10^10 words once expanded."""
    first, more = ("{x: 1}", "{<<: [%s]}") if merging else ("[lol]", "[%s]")
    lines = [f"a0: &a0 {first}"]
    lines += [f"a{n}: &a{n} {more % ', '.join([f'*a{n - 1}'] * 10)}" for n in range(1, 11)]
    return "\n".join(lines).encode()


def xml(inside: str, before: str = "") -> bytes:
    return f'<?xml version="1.0"?>\n{before}<opencv_storage>{inside}</opencv_storage>'.encode()


def entities() -> bytes:
    """Return ten entities, each ten times the one before."""
    first = '<!ENTITY a0 "lol">'
    more = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 11))
    return xml("<Q>&a10;</Q>", f"<!DOCTYPE opencv_storage [{first}{more}]>")


def archive(packing: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", packing) as made:
        for name, content in members.items():
            made.writestr(f"{name}.npy", content)
    return file.getvalue()


def lying_archive(size: int, claimed: int) -> bytes:
    """Return an archive of one array that claims a size other than its unpacked one."""
    whole = bytearray(archive(Q=saved(np.zeros(0)) + bytes(size)))
    for mark, place in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        start = whole.index(mark)
        whole[start + place : start + place + 4] = struct.pack("<I", claimed)
    return bytes(whole)


def pickled() -> bytes:
    """Return an archive of object arrays, one of which would print when loaded."""

    class Printing:
        def __reduce__(self) -> tuple[object, ...]:
            return print, ("unpickled",)

    file = io.BytesIO()
    np.savez(file, K1=np.array([Printing()], dtype=object), K2=np.array([None]))
    return file.getvalue()


def members(count: int) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as made:
        for number in range(count):
            made.writestr(f"{number}", b"")
    return file.getvalue()


def trees() -> dict[str, Case]:
    """Return hostile YAML, XML and NPZ by name."""
    q = saved(np.eye(4))
    return {
        "YAML, ten by ten aliases": (laughs, "more than 100,000 values, its aliases followed"),
        "YAML, a list that holds itself": (lambda: b"Q: &a [*a]", "broken or cut short"),
        "YAML, an alias of nothing": (lambda: b"Q: *a", "YAML: it is broken or cut short"),
        "YAML, lists within 500,000 lists": (lambda: b"Q: " + b"[" * 500_000, "more than 16 levels deep"),
        "YAML, lists in lines within 400,000": (lambda: b"- " * 400_000 + b"1", "more than 16 levels deep"),
        "YAML, 500,000 question marks": (lambda: b"? " * 500_000, "more than 16 levels deep|YAML"),
        "YAML, 900,000 exclamation marks": (lambda: b"a: !" + b"!" * 900_000, ""),
        "YAML, a number to the base of 60": (lambda: b"Q: 1" + b":59" * 300_000, "must hold numbers, not"),
        "YAML, a number of a megabyte": (lambda: b"Q: " + b"7" * 1_000_000, "finite numbers"),
        "YAML, an anchor of a megabyte": (lambda: b"Q: &" + b"a" * 1_000_000 + b" 1", "must hold 16 numbers"),
        "YAML, 250,000 keys of one name": (lambda: b"{" + b"a: 1," * 200_000 + b"}", "YAML|JSON"),
        "YAML, an object of Python": (
            lambda: b"Q: !!python/object/apply:os.abort []",
            "must hold 16 numbers|finite numbers",
        ),
        "YAML, a list for a key": (lambda: b"? [1, 2]\n: 3", "YAML"),
        "YAML, quotes that do not end": (lambda: b'Q: "' + b"a" * 900_000, "YAML: it is broken or cut short"),
        "YAML, 200,000 directives": (lambda: b"%TAG !a! b\n" * 80_000, "YAML"),
        "XML, ten by ten entities": (entities, "defines types or entities"),
        "XML, an entity of a megabyte": (
            lambda: xml("&a;" * 9, f'<!DOCTYPE x [<!ENTITY a "{"a" * 900_000}">]>'),
            "defines types or entities",
        ),
        "XML, a file of this machine": (
            lambda: xml("<Q>&a;</Q>", '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'),
            "defines types or entities",
        ),
        "XML, 140,000 elements within each other": (
            lambda: xml("<a>" * 140_000 + "</a>" * 140_000),
            "more than 16 levels deep",
        ),
        "XML, 200,000 elements": (lambda: xml("<a/>" * 200_000), "more than 100,000 values|no names with values"),
        "XML, 60,000 attributes": (
            lambda: xml("<a " + " ".join(f'a{n}="1"' for n in range(60_000)) + "/>"),
            "no known format",
        ),
        "XML, a text of a megabyte": (lambda: xml("<Q>" + "1 " * 500_000 + "</Q>"), "must hold 16 numbers"),
        "XML, an encoding that is not known": (
            lambda: b'<?xml version="1.0" encoding="lots"?><a>1</a>',
            "encoding that is not known|XML",
        ),
        "XML, nothing but a mark": (lambda: b"<", "XML: it is broken or cut short"),
        "NPZ, 8 arrays of 1 GB": (lambda: lying_archive(64 * MB, 2**30), "MB unpacked; at most"),
        "NPZ, an array of 64 MB that claims 200 bytes": (lambda: lying_archive(64 * MB, 200), "damaged|no known"),
        "NPZ, packed by bzip2": (lambda: archive(zipfile.ZIP_BZIP2, Q=q + bytes(64 * MB)), "packed by a method"),
        "NPZ, 900 arrays of 64 kB": (lambda: archive(**{f"a{n}": q + bytes(60_000) for n in range(900)}), ""),
        "NPZ, 30,000 members": (lambda: members(30_000), "has a directory of"),
        "NPZ, of 17 MB": (lambda: b"PK\x03\x04" + bytes(17 * MB), "at most 16,777,216 are accepted"),
        "NPZ, pickled objects": (pickled, "holds object"),
        "NPZ, an array that claims 10^12 numbers": (
            lambda: archive(Q=saved(np.eye(4)).replace(b"(4, 4)", b"(1000000, 1000000)")),
            "is cut short",
        ),
        "NPZ, cut short": (lambda: archive(Q=q)[:-30], "damaged or cut short"),
        "NPZ, a wrong checksum": (
            lambda: archive(Q=q).replace(struct.pack("<I", zlib.crc32(q)), b"\0\1\2\3"),
            "damaged or cut short",
        ),
        "NPZ, whole": (lambda: archive(Q=saved(np.array(json.loads(reprojection())["Q"]))), READ),
    }


def calibrations() -> dict[str, Case]:
    far = "from -1e.12 to 1e.12"
    return {
        "principal point of 1e308": (lambda: plain(cx=1e308, cy=-1e308), far),
        "focal length of 1e-300": (lambda: plain(focal_px=1e-300), "allowed are 0.001 to 1e.07"),
        "focal length of 1e308": (lambda: plain(focal_px=1e308), far),
        "focal length true": (lambda: plain(focal_px=True), "must hold numbers, not “True”"),
        "focal length of 9,000 digits": (lambda: plain().replace(b"700", b"7" * 9000), "finite numbers"),
        "baseline of 1e-308": (lambda: plain(baseline_m=1e-308), "allowed are 1e-09 to 1e.09"),
        "width of 1e9": (lambda: plain(width=1e9), "allowed are 1 to 100000"),
        "numbers that are lists of lists": (lambda: plain(focal_px=[[[[1]]], 2]), "finite numbers only"),
        "lists within 100,000 lists": (lambda: b'{"focal_px": ' + b"[" * 100_000, "cannot be parsed"),
        "projections of ±1e308": (lambda: projections("720", "1e308", "-1e308"), far),
        "projection of nan": (lambda: projections("nan", "45", "-339"), "finite numbers only"),
        "reprojection with 1 / baseline of 1e-300": (lambda: reprojection(q32=1e-300, q33=5), "allowed are"),
        "cameras with a centre at 1e11": (lambda: rig("500, 0, 1e11, 0, 500, 120, 0, 0, 1"), "from -1e.07 to 1e.07"),
        "cameras with a centre at 1e7": (lambda: rig("500, 0, 1e7, 0, 500, 1e7, 0, 0, 1"), ""),
        "distortion of 1e9": (lambda: rig(D1="1e9, 1e9, 0, 0"), ""),
        "rotation of 1e12": (lambda: rig(R="1e12, 0, 0, 0, 1e12, 0, 0, 0, 1e12"), "from -10 to 10"),
        "rotation by 180°": (lambda: rig(R="-1, 0, 0, 0, -1, 0, 0, 0, 1"), ""),
        "translation of 5e-324": (lambda: rig(T="-5e-324, 0, 0"), ""),
        "matrix of 1e308 rows": (lambda: rig().replace(b"rows: 3", b"rows: 1e308"), "announces 1e.308 × 3"),
        "a name of 1 MB": (lambda: b"a" * MB, "no known format"),
        "spaces of 1 MB": (lambda: b"a" + b" " * (MB - 9) + b"=", ""),
        "300,000 names": (lambda: b"a:\n" * 300_000, "more than 100,000 values"),
        "100,000 assignments": (lambda: b"".join(b"k%d=1\n" % i for i in range(80_000)), "80,000 names or lines"),
        "60 MB": (lambda: b" " * (60 * MB), "at most 1,048,576 are accepted"),
        **trees(),
        "not UTF-8": (lambda: b"\xff" + plain(), "cannot be parsed"),
    }


def settings(method: str = "StereoBM", **changes: object) -> bytes:
    return json.dumps({"method": method, "settings": changes}).encode()


def matchers() -> dict[str, Case]:
    return {
        "window of 10^18": (lambda: settings(block_size=10**18 + 1), "block_size is 10*1; allowed are whole numbers"),
        "window of 9,000 digits": (
            lambda: settings().replace(b"{}", b'{"block_size": %s}' % (b"9" * 9000)),
            "not JSON",
        ),
        "window a list": (lambda: settings(block_size=[1]), "block_size is a list of 1; allowed are whole numbers"),
        "overlap of 1e308": (lambda: settings("CorrelationMatcher", overlap=1e308), "overlap is 1e.308; allowed are"),
        "score an image of Markdown": (
            lambda: settings("CorrelationMatcher", score="![x](http://e.org)"),
            "score is '..x..http:..e.org.'; allowed are 'zncc', 'ncc'",
        ),
        "unknown setting of Markdown": (lambda: settings(**{"![x](http://e.org)": 1}), "StereoBM has no setting"),
        "settings a number": (lambda: b'{"method": "StereoBM", "settings": 3}', '"settings", an object'),
        "method a list": (lambda: b'{"method": ["StereoBM"], "settings": {}}', "names the method"),
        "method of a megabyte": (lambda: settings("a" * 60_000), "names the method"),
        "100,000 lists": (lambda: b"[" * 65_000, "not JSON"),
        "60 MB": (lambda: b" " * (60 * MB), "at most 65,536 are accepted"),
        "not UTF-8": (lambda: b"\xff\xfe", "not JSON"),
        "a texture test of lists": (
            lambda: settings("CorrelationMatcher", texture=[[]]),
            "texture is a list of 1; allowed are settings of TextureTest",
        ),
    }
