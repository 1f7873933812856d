"""Results that show themselves in notebooks, drawn by a module of a higher layer that is imported on first use."""

from __future__ import annotations

import sys
from functools import singledispatch
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    from stereolag.core.inputs import Image

DRAWN_IN: list[str] = []
"""Names of the modules that register how to draw results."""

PAGE = """<!doctype html>
<html lang="en">
<head><meta charset="utf-8"><meta name="color-scheme" content="light dark"><title>{title}</title></head>
<body style="font-family: sans-serif; margin: 2em">{body}</body>
</html>
"""


class Drawing(NamedTuple):
    """A result as notebooks show it.

    Attributes
    ----------
    html
        The verdict, the numbers and the picture: a fragment that needs nothing else.
    png
        The picture alone; None if there is none to draw.
    """

    html: str
    png: bytes | None


class Shown:
    """A result that notebooks show: its verdict in words, and a picture."""

    def _repr_html_(self) -> str:
        return _draw(self).html

    def _repr_png_(self) -> bytes | None:
        return _draw(self).png


@singledispatch
def drawing(result: object, image: Image | None) -> Drawing:
    """Draw a result, with the image it was measured in if given; each type of result registers its own function."""
    kinds = ", ".join(kind.__name__ for kind in drawing.registry if kind is not object)
    raise ValueError(f"result is a {type(result).__name__}; what can be shown is a {kinds}.")


def _draw(result: object, image: Image | None = None) -> Drawing:
    for name in DRAWN_IN:
        import_module(name)
    return drawing(result, image)


def show(result: Shown, image: npt.ArrayLike | None = None) -> Path | None:
    """Show a result with its picture: in the running notebook, elsewhere in the browser.

    Parameters
    ----------
    result
        A :class:`~stereolag.SignalLag`, :class:`~stereolag.TemplateSearch` or :class:`~stereolag.DisparityMap`.
    image
        The image that was searched, to frame the places in it; or the left image, to see it beside the map.

    Returns
    -------
    Path or None
        The HTML file opened in the browser, which is kept; None in a notebook.

    Raises
    ------
    ValueError
        A result of another type, an image of another size than the map, or an image for two recordings.

    Notes
    -----
    As the last line of a cell, a result shows itself without this function, but also without the image.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> search = sl.match_template(image, image[40:60, 70:100])
    >>> sl.show(search, image)  # doctest: +SKIP
    """
    from stereolag.core.inputs import as_image

    body = _draw(result, None if image is None else as_image(image, "image")).html
    # A running notebook has imported IPython; its shell in a terminal cannot draw.
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is not None and "Terminal" not in type(shell).__name__:
        display = import_module("IPython.display")
        display.display(display.HTML(body))
        return None
    return _open_in_browser(PAGE.format(title=type(result).__name__, body=body))


def _open_in_browser(page: str) -> Path:
    """Write a page to a new file, open it in the browser, and return its path."""
    import tempfile
    import webbrowser
    from pathlib import Path

    with tempfile.NamedTemporaryFile("w", encoding="utf-8", prefix="stereolag_", suffix=".html", delete=False) as file:
        file.write(page)
    path = Path(file.name)
    webbrowser.open(path.as_uri())
    return path
