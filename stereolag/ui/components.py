"""Components of the pages that run in the browser, each from a folder of ``web/``, and the data delivered to them.

The scripts are plain ES modules, so that they can be checked and tested as they are. Streamlit takes the script of a
component as one string and imports it from a ``blob:`` address, where relative imports do not work. It serves the files
of an ``asset_dir`` only for installed packages, but the app can also be started from a checkout. Files served by our
own routes would take one request per module, to an address that depends on the path behind a proxy. So :func:`joined`
puts a module and the modules it imports into one string, each in its own scope: no more requests, no address, and
nothing that a component does not use.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import streamlit as st

from stereolag.core.arrays import Array, FloatMap, Rgb
from stereolag.core.inputs import Image, as_eight_bit, as_grey
from stereolag.figures.pictures import coloured, data_url, png
from stereolag.figures.templates import relief
from stereolag.templates.by_hand import ReducedSearch, best_of_blocks, block_side
from stereolag.templates.score_maps import ScoreMap
from stereolag.ui.streamlit_inside import ComponentRenderer

WEB = Path(__file__).parent / "web"

IMPORT = re.compile(r'^import \{([^}]*)\} from "(\.[^"]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?:async )?(?:function|class|const) (\w+)", re.MULTILINE)
UNSUPPORTED = re.compile(r"^(?:import\b(?!\()|export (?!default\b)).*", re.MULTILINE)
INCLUDE = re.compile(r'^ *@import "(\.[^"]+)";\n', re.MULTILINE)


VIEW = """
export default (component) => Shown.show(component, (panel, data, words, tools) => {{
  const {{ html, svg, live, filled, shortened, drag, keys, within }} = tools;
  return html`{}`;
}});
"""
"""Script that shows a panel, the default export of its module, with its markup as a function, a lit-html template."""


@cache
def component(name: str) -> ComponentRenderer:
    """Return the component whose module is ``web/<name>/<name>.js``, with its markup and styles beside it, if any."""
    folder = WEB / name
    sheet = folder / f"{name}.css"
    return st.components.v2.component(
        f"stereolag.{name}",
        html='<div class="view"></div>' if (folder / f"{name}.html").exists() else None,
        css=expanded(sheet) if sheet.exists() else None,
        js=script(folder),
    )


def script(folder: Path) -> str:
    """Return the module of a component, with its markup if it has any.

    The default export of the module is the class of its panel. The markup is a template with expressions in ``${…}``
    that `Panel` of ``web/shared/panel.js`` draws. It becomes part of the script, since a page's security policy may
    forbid turning text into code.
    """
    markup = folder / f"{folder.name}.html"
    view = VIEW.format(expanded(markup).strip()) if markup.exists() else ""
    return joined(folder / f"{folder.name}.js").replace("export default class", "const Shown = class") + view


def expanded(path: Path) -> str:
    """Return a style sheet or markup, with its imports replaced by the imported files."""
    return INCLUDE.sub(lambda found: expanded(path.parent / found[1]), path.read_text(encoding="utf-8"))


@cache
def joined(path: Path) -> str:
    """Return a module and all modules it imports as one module, in order of dependency.

    Functions, classes and constants can be imported and exported by name; only the module itself may have a default
    export.

    Raises
    ------
    ValueError
        If a module imports or exports in another way, or imports itself.
    """
    names: dict[Path, str] = {}
    scopes: list[str] = []

    def add(module: Path, importing: tuple[Path, ...]) -> str:
        if module in importing:
            raise ValueError(f"{module.name} imports itself, by way of {importing[-1].name}.")
        if module not in names:
            body, exported = translated(module, importing)
            scopes.append(f"const $m{len(names)} = (() => {{\n{body}return {{ {', '.join(exported)} }};\n}})();\n")
            names[module] = f"$m{len(names)}"
        return names[module]

    def translated(module: Path, importing: tuple[Path, ...]) -> tuple[str, list[str]]:
        text = module.read_text(encoding="utf-8")

        def bound(found: re.Match[str]) -> str:
            scope = add((module.parent / found[2]).resolve(), (*importing, module))
            return f"const {{{found[1].replace(' as ', ': ')}}} = {scope};\n"

        text = IMPORT.sub(bound, text)
        exported = EXPORT.findall(text)
        text = EXPORT.sub(lambda found: found[0].removeprefix("export "), text)
        unknown = UNSUPPORTED.search(text) or (
            re.search("^export default.*", text, re.MULTILINE) if importing else None
        )
        if unknown:
            raise ValueError(f"{module.name}: {unknown[0]!r} cannot be joined with other modules.")
        return text, exported

    body, _ = translated(path.resolve(), ())
    return "".join(scopes) + body


def deliver(item: bytes, *, key: str) -> None:
    """Send an item of :func:`packed_item` to the components of the page that need it.

    Its header has a `kind`, and a `name` unless its digest is its name. Each delivery is a separate component, so
    Streamlit sends it again only if it has changed.

    Parameters
    ----------
    item
        The packed item.
    key
        Key of the delivery on the page.
    """
    component("delivery")(key=key, data=item)


# Items for the browser

SCORE_STEPS = 30_000
"""Steps of a score from 0 to 1; code 0 means no score."""

TRUTH_STEPS_PER_PX = 64
"""Resolution of the ground truth as sent."""

TRUTH_OFFSET_PX = 512
"""Offset added to the ground truth to make it positive; values that still do not fit are sent as unknown."""


class Packed(NamedTuple):
    """An item for the browser, and the digest that identifies its content."""

    data: bytes
    digest: str


def packed_item(header: Mapping[str, Any], parts: Sequence[bytes] = ()) -> Packed:
    """Return an item as bytes: the length of its JSON header in four bytes (little-endian), the header, and the parts.

    Two fields are added to the header: `parts`, the start and length of each part after the header, and `digest`, a
    digest of the content unless the header already has one.
    """
    places = [(end - len(part), len(part)) for end, part in zip(accumulate(map(len, parts)), parts, strict=True)]
    digest = header.get("digest") or hashlib.sha256(json.dumps(header).encode() + b"".join(parts)).hexdigest()
    text = json.dumps({**header, "digest": digest, "parts": places}).encode()
    return Packed(len(text).to_bytes(4, "little") + text + b"".join(parts), digest)


def packed_pictures(header: Mapping[str, Any], pictures: Sequence[Rgb | bytes]) -> bytes:
    """Return an item with each picture, (rows, cols, 3) uint8 RGB or a PNG, as a PNG, and `steps`, those of a score."""
    return packed_item(
        {**header, "steps": SCORE_STEPS},
        [picture if isinstance(picture, bytes) else png(picture) for picture in pictures],
    ).data


def scores_as_colours(scores: Array) -> Rgb:
    """Return scores, -1..1, as (rows, cols, 3) uint8 whose red and green are the high and low byte of the code."""
    return _in_two_bytes(np.where(np.isnan(scores), 0, np.rint((scores + 1) * SCORE_STEPS) + 1))


def _in_two_bytes(codes: Array) -> Rgb:
    high, low = np.divmod(codes.astype(np.uint16), 256)
    return np.stack([high, low, np.zeros_like(low)], axis=-1).astype(np.uint8)


def packed_search(
    search: ReducedSearch, *, name: str, words: Mapping[str, Any], places: Sequence[Mapping[str, Any]] = ()
) -> bytes:
    """Return a search as :func:`packed_pictures`: picture, template with alpha, scores, and the scores in colour.

    Parameters
    ----------
    search
        The search to send.
    name
        Its name in the browser.
    words
        Texts of the panel.
    places
        Places to frame: the `kind` of each, and its `corners` as x and y in the reduced picture.
    """
    return packed_pictures(
        {
            "name": name,
            "factor": search.factor,
            "row": search.row,
            "col": search.col,
            "places": list(places),
            "leaders": [
                {"row": row, "col": col, "score": score, "relief": data_url(png(relief(search, row, col)))}
                for row, col, score in search.leaders
            ],
            "words": dict(words),
        },
        (
            search.picture,
            np.dstack([search.template, search.opaque * np.uint8(255)]),
            scores_as_colours(search.score_map),
            coloured(search.score_map, 0, 1),
        ),
    )


def packed_score_map(png: bytes, score_map: ScoreMap, *, name: str, words: Mapping[str, Any]) -> bytes:
    """Return a map as :func:`packed_pictures`: picture, best scores and their offsets.

    Parameters
    ----------
    png
        The map as drawn by :func:`~stereolag.figures.templates.score_map_png`.
    score_map
        (rows, cols), NaN = no score.
    name
        Name of the search to which a clicked place is sent.
    words
        Texts below the map.
    """
    factor = block_side(score_map)
    best, down, right = best_of_blocks(score_map, factor)
    return packed_pictures(
        {"name": name, "factor": factor, "words": dict(words)},
        (
            png,
            scores_as_colours(best),
            np.stack([down, right, np.zeros_like(down)], axis=-1).astype(np.uint8),
        ),
    )


def packed_grey_pair(left: Image, right: Image, truth: FloatMap | None, *, name: str, digest: str) -> bytes:
    """Return a pair as an item: PNGs of both images, and of the ground truth.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) checked images of the same size and dtype. 8-bit values are kept unchanged.
    truth
        (H, W) disparities, px, NaN = unknown; None if there is no ground truth. Sent as a PNG whose red and green are
        the high and low byte.
    name, digest
        Name of the place, and digest of the pair, in the browser.
    """
    grey = as_eight_bit(as_grey(left), as_grey(right))
    parts = [png(image) for image in grey]
    if truth is not None:
        codes = np.rint((truth.astype(np.float64) + TRUTH_OFFSET_PX) * TRUTH_STEPS_PER_PX)
        parts.append(png(_in_two_bytes(np.where((codes > 0) & (codes < 2**16), codes, 0))))
    return packed_item(
        {
            "kind": "pair",
            "name": name,
            "digest": digest,
            "rows": left.shape[0],
            "cols": left.shape[1],
            "deviation": float(grey[0].std()),
        },
        parts,
    ).data
