"""``stereolag find``: the place of a template in an image."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

import stereolag as sl
from stereolag.commands.arguments import (
    DONE,
    DOUBTFUL,
    CommandParser,
    SettingsFlags,
    add_frames,
    print_result,
    read,
    read_frames,
)
from stereolag.core.searches import TemplateQuery


def run(arguments: Sequence[str]) -> int:
    """Search as the arguments ask, print the result, and return the exit code."""
    parser = CommandParser(
        "find",
        "Find a template in an image: row and column of its top-left pixel, best first. It is found where every part "
        "of it agrees with the image, in whatever light. Transparent pixels of the template do not count.",
        "IMAGE TEMPLATE [--min-score 0..1] [--max-matches N] [--json] [further settings]",
        f"; {DOUBTFUL} nothing is found",
    )
    parser.add_argument("image", metavar="IMAGE", help="PNG, JPEG, HEIC, AVIF, WEBP, BMP, TIFF, PPM, PGM or GIF")
    parser.add_argument("template", metavar="TEMPLATE", help="no larger than the image")
    parser.add_argument(
        "--mask", metavar="FILE", help="an image of the template's size: the weights of its pixels, 0 for none"
    )
    add_frames(parser, "the image", "the template")
    options, query = SettingsFlags(parser, TemplateQuery()).parsed(arguments)

    from stereolag.io.results import left_out_in_words, search_figures

    mask = None if options.mask is None else read(sl.read_image, options.mask)
    if mask is not None and mask.ndim == 3:
        mask = mask[:, :, :3].max(axis=2)
    with ThreadPoolExecutor(1) as background:
        background.submit(import_module, "stereolag.templates.search")  # takes as long as decoding a large image
        (image, template), frames, lines = read_frames((options.image, options.template), options.frames)
    result = sl.match_template(image, template, mask=mask, **query.arguments, seed=0)
    figures = search_figures(result, query) | {"images": frames}
    sentences = filter(None, (*_result_lines(result, query), left_out_in_words(result), *lines))
    print_result(figures, "\n".join(sentences), as_json=options.json)
    return DONE if result.found else DOUBTFUL


def _result_lines(result: sl.TemplateSearch, query: TemplateQuery) -> list[str]:
    """Return a line for each place that can be relied on; if nothing was found, the reason."""
    if result.found:
        return [f"{_place(match)}{_remark(match)}" for match in result.matches[: result.clear]]
    if result.reason == "look_alikes":
        places = [_place(match) for match in result.look_alikes]
        return [f"Not found: {len(places)} places fit about equally well.", *places]
    if result.best is not None and result.reason in NOT_FOUND_BUT:
        return [f"Not found{NOT_FOUND_BUT[result.reason]}: {_place(result.best)}{_remark(result.best)}."]
    sentence = f"Not found: no place scores {query.min_score:g} or more."
    if result.best is not None:
        sentence += f" The best: {_place(result.best)}."
    one_pose = query.min_scale == query.max_scale and not query.max_rotation
    return [sentence, *(["Other sizes and angles: --min-scale, --max-scale, --max-rotation."] if one_pose else [])]


NOT_FOUND_BUT = {
    "other_colours": " in these colours, but in others",
    "mirrored": ", but its mirror image is there",
    "differs": ", but something similar is there",
    "not_there": "; the best place shows something else",
}


def _remark(match: sl.TemplateMatch) -> str:
    """Return how the image differs from the template at a place; "" if it does not."""
    if match.kind in ("lower_contrast", "higher_contrast") and match.contrast is not None:
        return f", {match.contrast:.2f} × its contrast"
    agreeing = [agrees for line in match.blocks for agrees in line]
    blocks = f", {agreeing.count(False)} of {len(agreeing)} blocks"
    return {
        "partly_covered": f"{blocks} covered or missing in the image",
        "differs": f"{blocks} differ",
        "not_there": f"{blocks} differ",
    }.get(match.kind or "", "")


def _place(match: sl.TemplateMatch) -> str:
    posed = (match.scale, match.rotation) != (1.0, 0.0)
    pose = f", size {match.scale:.2f}, turned {match.rotation:+.1f}°" if posed else ""
    return f"row {match.row}, column {match.col}, score {match.score:.3f}{pose}"
