"""A PLY reader that is independent of this project's writer."""

import struct

CODES = {"float": "f", "uchar": "B"}


def read_ply(data: bytes) -> dict[str, list[float]]:
    """Return the vertices of a binary little-endian PLY, by name, read from its header alone."""
    header, body = data.split(b"end_header\n", 1)
    lines = [line.split() for line in header.decode("ascii").splitlines() if not line.startswith("comment")]
    assert lines[:2] == [["ply"], ["format", "binary_little_endian", "1.0"]]
    assert lines[2][:2] == ["element", "vertex"]
    names = [line[2] for line in lines[3:] if line[0] == "property"]
    layout = "<" + "".join(CODES[line[1]] for line in lines[3:])
    assert len(body) == int(lines[2][2]) * struct.calcsize(layout)
    vertices = list(struct.iter_unpack(layout, body))
    return {name: [vertex[place] for vertex in vertices] for place, name in enumerate(names)}
