"""``stereolag find``: where in an image a smaller one is."""

from __future__ import annotations

from collections.abc import Sequence

import stereolag as sl
from stereolag.commands.flags import SettingsFlags
from stereolag.commands.parsing import DONE, NOT_FOUND, CommandParser, add_output, read, tell
from stereolag.searches import TemplateQuery


def run(arguments: Sequence[str]) -> int:
    """Search as the arguments ask, print what is found, and return the code to exit with."""
    parser = CommandParser(
        "find",
        "Tell where in an image a template is: row and column of its top-left pixel, best first. Transparent pixels of "
        "the template do not count.",
        "IMAGE TEMPLATE [--min-score 0..1] [--max-matches N] [--json] [further settings]",
        f"; {NOT_FOUND} nothing is found",
    )
    parser.add_argument("image", metavar="IMAGE", help="PNG, JPEG, WEBP, BMP, TIFF, PPM, PGM or GIF")
    parser.add_argument("template", metavar="TEMPLATE", help="no larger than the image")
    parser.add_argument("--mask", metavar="FILE", help="an image of the template's size: its pixels above 0 count")
    add_output(parser)
    flags = SettingsFlags(parser, TemplateQuery())
    options, query = flags.parsed(arguments)

    from stereolag.export import search_figures

    mask = None if options.mask is None else read(sl.read_image, options.mask)
    if mask is not None and mask.ndim == 3:
        mask = mask[:, :, :3].max(axis=2)
    image, template = read(sl.read_image, options.image), read(sl.read_image, options.template)
    result = sl.match_template(image, template, mask=mask, **query.model_dump(), seed=0)
    lines = [f"row {one.row}, column {one.col}, score {one.score:.3f}" for one in result.matches]
    lines = lines or [f"Not found: no place scores {query.min_score:g} or more."]
    tell(search_figures(result, query), "\n".join(lines), as_json=options.json)
    return DONE if result.found else NOT_FOUND
