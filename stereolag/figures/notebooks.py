"""Results in notebooks: the verdict in words, the numbers with their units, and one embedded picture."""

from __future__ import annotations

import html
import io
import math
import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go
from PIL import Image as PillowImage
from PIL import ImageDraw, ImageFont

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image
from stereolag.core.showing import Drawing, drawing
from stereolag.core.typography import typeset
from stereolag.figures.legends import INK, LEGEND_TITLE, PAPER, round_values, searched_range, with_legend
from stereolag.figures.pictures import CORRELATION, VIRIDIS, coloured, data_url, fitted
from stereolag.figures.recordings import correlation_curve
from stereolag.figures.templates import framed, score_map_picture
from stereolag.figures.verdicts import (
    blanks_in_words,
    curve_in_words,
    doubtful,
    framed_in_words,
    headline,
    place,
    remark_on,
    verdict_explained,
    verdict_in_words,
)
from stereolag.signals import SignalLag
from stereolag.stereo.matcher import DisparityMap
from stereolag.templates import TemplateSearch

MAX_PIXELS = 260_000
"""Pixels above which a picture is reduced: noise of this size in 256 colours is a PNG of 260 kB, or 350 kB as text."""

MAX_PLACES = 5
"""Largest number of places listed."""

CHART_SIZE_PX = 1280, 560
"""Width and height of a chart, px: twice the size at which it is shown, so that its lines are smooth."""

LEFT, RIGHT, TOP, BOTTOM = 110, 60, 60, 100
"""Margins of a chart, px."""

TEXT_PX = 26
CHANCE_COLOUR, GRID_COLOUR, DRIFT_COLOUR = (228, 228, 228), (200, 200, 200), (248, 214, 224)


@drawing.register
def _lag(result: SignalLag, image: Image | None) -> Drawing:
    if image is not None:
        raise ValueError("image is given for a SignalLag; two recordings have none.")
    judgement, sure = result.judgement, result.verdict == "sure"
    numbers = [f"score {result.score:.3f}" if sure else f"the highest point scores {result.score:.3f}"]
    if not math.isnan(judgement.evidence):
        numbers.append(f"evidence {judgement.evidence:.1f} σ, {judgement.needed:.1f} σ are needed")
    numbers.append(f"{result.sampling_rate:,.10g} samples a second")
    if sure and not (judgement.over_time and judgement.over_time.changes):
        numbers.append(f"{result.speed:,.10g} m/s")
    curve = correlation_curve(result, "votes" if result.lags is None else "correlation")
    note = "Grey: the range of chance." if any(trace.name == "chance" for trace in curve.data) else ""
    sentences = [verdict_in_words(result), *verdict_explained(result), _numbers_sentence(numbers, result.elapsed_s)]
    return _drawing(sentences, _chart_picture(curve, labelled=sure), curve_in_words(result), note, zoom=2)


@drawing.register
def _search(result: TemplateSearch, image: Image | None) -> Drawing:
    found, unsure = result.matches[: result.clear], doubtful(result)
    sentences = [f"**{headline(result)}.**"]
    if len(found) > 1:
        sentences.append(_capitalised("; ".join(map(place, found[:MAX_PLACES])) + "."))
    if found:
        sentences += filter(None, [remark_on(found[0])])
    elif unsure:
        why = "None of these places has a clear lead: " if result.look_alikes else "The best place does not show it: "
        sentences.append(why + "; ".join(map(place, unsure[:MAX_PLACES])) + f". {remark_on(unsure[0])}".rstrip())
    numbers = [f"score {found[0].score:.3f}"] if found else []
    if found and result.rivals:
        numbers.append(f"the best rival has {result.rivals[0].score:.3f}")
    sentences.append(_numbers_sentence([*numbers, f"{result.candidates:,} places scored"], result.elapsed_s))
    if image is not None:
        return _drawing(sentences, framed(image, found, unsure, width=_width(image.shape)), framed_in_words(result))
    if result.score_map is None:
        return _drawing([*sentences, "To see where: sl.show(result, image)."])
    factor = math.ceil(result.score_map.shape[1] / _width(result.score_map.shape))
    picture = score_map_picture(result.score_map, found or unsure, factor)
    note = (
        "Score of the template with its top-left corner at each place: dark at 0 and below, yellow at 1; flat places "
        "are grey, and the places named above are ringed. To see them in the image: sl.show(result, image)."
    )
    return _drawing(sentences, picture, f"Scores of {result.candidates:,} places. {headline(result)}.", note)


@drawing.register
def _map(result: DisparityMap, image: Image | None) -> Drawing:
    rows, cols = result.disparity.shape
    if image is not None and image.shape[:2] != (rows, cols):
        raise ValueError(f"image is {image.shape[1]} × {image.shape[0]} pixels and the map {cols} × {rows}.")
    known = result.disparity[result.valid]
    shares = {"filled in": float(result.filled.mean()), "blank": float(1 - result.valid.mean())}
    others = "".join(f", {100 * share:.1f} % {what}" for what, share in shares.items() if share)
    sentences = [f"**{100 * result.coverage:.1f} % of the pixels measured**{others}."]
    if not known.size:
        sentences = ["**No pixel has a disparity.**"]
    if shares["blank"] and result.settings.gives_reasons:
        sentences.append(_capitalised(f"{blanks_in_words(result.reason)}."))
    numbers = [f"{cols} × {rows} px", f"by {type(result.settings).__name__}"]
    if known.size:
        least, median, most = np.percentile(known, (1, 50, 99))
        numbers.append(f"disparities {least:.1f} to {most:.1f} px (98 % of them), median {median:.1f} px")
    sentences.append(_numbers_sentence(numbers, result.elapsed_s))
    low, high = searched_range([result])
    width = _width((rows, cols))
    picture = coloured(_thinned(result.disparity, width), low, high)
    if image is not None:
        picture = np.hstack((fitted(image, width)[: len(picture)], picture))
    alternative = f"Disparity map, from {low:g} px (dark) to {high:g} px (bright). {sentences[0]}"
    return _drawing(sentences, with_legend(picture, low, high, VIRIDIS, LEGEND_TITLE), alternative)


def _numbers_sentence(numbers: Sequence[str], seconds: float) -> str:
    """Return numbers as a sentence that ends with the computation time."""
    return _capitalised("; ".join([*numbers, f"computed in {seconds:.3g} s."]))


def _capitalised(text: str) -> str:
    """Return a text that begins with a capital letter."""
    return f"{text[:1].upper()}{text[1:]}"


def _drawing(
    sentences: Sequence[str], picture: Rgb | None = None, alternative: str = "", note: str = "", *, zoom: int = 1
) -> Drawing:
    """Return sentences, the verdict first, above a picture with a note.

    `**` marks bold text. The picture is shown at 1 / `zoom` of its size, on white; the text has the colours of the
    notebook, light or dark.
    """
    verdict, *others = map(_bold, sentences)
    lines = f'<p style="font-size: 1.15em">{verdict}</p>' + "".join(f"<p>{one}</p>" for one in others)
    if picture is None:
        return Drawing(f"<div>{lines}</div>", None)
    png = _png(picture)
    shown = (
        f'<img src="{data_url(png)}" alt="{html.escape(typeset(alternative.replace("**", "")))}"'
        f' width="{picture.shape[1] // zoom}" style="max-width: 100%; height: auto">'
    )
    return Drawing(f"<div>{lines}{shown}{f'<p><small>{_bold(note)}</small></p>' if note else ''}</div>", png)


def _bold(text: str) -> str:
    return re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", html.escape(typeset(text), quote=False))


def _png(picture: Rgb) -> bytes:
    """Return a picture in 256 colours, which suffice for nearly all of a map, as a small PNG."""
    file = io.BytesIO()
    PillowImage.fromarray(picture).quantize(256).save(file, "PNG", optimize=True)
    return file.getvalue()


def _width(shape: Sequence[int]) -> int:
    """Return the width to which a picture of shape (rows, cols) is reduced."""
    return min(shape[1], max(1, math.isqrt(MAX_PIXELS * shape[1] // shape[0])))


def _thinned(values: FloatMap, width: int) -> FloatMap:
    """Return evenly spaced rows and columns: an average would be a value that no pixel has."""
    height = max(1, round(values.shape[0] * width / values.shape[1]))
    rows, cols = (np.arange(new) * old // new for new, old in zip((height, width), values.shape, strict=True))
    return values[np.ix_(rows, cols)]


def _chart_picture(figure: go.Figure, *, labelled: bool) -> Rgb:
    """Return a Plotly chart of lines, bars, bands and rings as a picture; `labelled`: with the labels of the rings."""
    traces = [(trace, np.array(trace.x, np.float64), np.array(trace.y, np.float64)) for trace in figure.data]
    heights = np.concatenate([[0.0], *(y for _, _, y in traces)])
    margin = 0.08 * float(np.ptp(heights)) or 1.0
    low, high = heights.min() - margin * bool(heights.min()), heights.max() + margin
    ends = figure.layout.xaxis.range or np.concatenate([x for _, x, _ in traces])
    first, last = min(ends), max(max(ends), min(ends) + 1)

    def points(x: npt.ArrayLike, y: npt.ArrayLike) -> list[tuple[float, float]]:
        cols = LEFT + (np.array(x) - first) / (last - first) * (CHART_SIZE_PX[0] - LEFT - RIGHT)
        rows = TOP + (high - np.array(y)) / (high - low) * (CHART_SIZE_PX[1] - TOP - BOTTOM)
        return list(zip(cols.tolist(), rows.tolist(), strict=True))

    canvas = PillowImage.new("RGB", CHART_SIZE_PX, PAPER)
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(TEXT_PX)
    for band in figure.layout.shapes:
        draw.rectangle([*points([band.x0, band.x1], [high, low])], DRIFT_COLOUR)
    for trace, x, y in traces:
        if trace.name == "chance":
            draw.polygon(points(x, y), CHANCE_COLOUR)
    for value in round_values(low, high, 5):
        (start, end) = points([first, last], [value, value])
        draw.line([start, end], GRID_COLOUR, 2)
        draw.text((LEFT - 12, start[1]), f"{value:g}", INK, font, anchor="rm")
    for value in round_values(first, last, 6):
        ((across, down),) = points([value], [low])
        draw.line([(across, down), (across, down + 8)], INK, 2)
        draw.text((across, down + 14), f"{value:,.10g}", INK, font, anchor="mt")
    draw.text((LEFT, TOP - 14), figure.layout.yaxis.title.text, INK, font, anchor="lb")
    middle = (LEFT + CHART_SIZE_PX[0] - RIGHT) / 2
    draw.text((middle, CHART_SIZE_PX[1] - 12), figure.layout.xaxis.title.text, INK, font, anchor="mb")
    for trace, x, y in traces:
        if trace.type == "bar":
            for bar in zip(points(x, y), points(x, [0] * x.size), strict=True):
                draw.line(bar, CORRELATION, 4)
        elif trace.mode != "lines":
            _draw_rings(draw, points(x, y), trace, font if labelled else None)
        elif trace.name != "chance":
            draw.line(points(x, y), CORRELATION, 3, joint="curve")
    return np.asarray(canvas)


def _draw_rings(
    draw: ImageDraw.ImageDraw,
    centres: Sequence[tuple[float, float]],
    trace: go.Scatter,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont | None,
) -> None:
    radius, colour = trace.marker.size, trace.marker.color
    for across, down in centres:
        draw.ellipse((across - radius, down - radius, across + radius, down + radius), None, colour, 5)
    if font is not None and trace.text:
        (across, down), left = centres[0], trace.textposition == "middle left"
        draw.text((across + radius * (-1 if left else 1), down), trace.text[0], colour, font, "rm" if left else "lm")
