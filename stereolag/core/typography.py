"""Typesetting of numbers: a true minus sign, and no line break between a number and its unit."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Sequence
from typing import ParamSpec

MINUS = "\N{MINUS SIGN}"
NO_BREAK = "\N{NO-BREAK SPACE}"

UNITS = "px·m|px|km/h|m/s|ms|mm|cm|m|s|kB|MB|GB|kHz|Hz|dB|ppm|%|σ"
"""Symbols separated from their number by a space; words such as "samples" may begin a line, and ° has no space."""

_CODE = re.compile(r"(`[^`]*`)")
_HYPHEN = re.compile(r"(?<![\w.,)\]`=“'-])-(?=\.?\d)")
_NEGATIVE_ZERO = re.compile(r"(?<![\w.,)\]`=“'-])-(?=0(?:\.0+)?(?![\d.]))")
_GAP = re.compile(rf"(?<=\d)(\*\*)? (?=(?:{UNITS})(?!\w))")
_PLUS_MINUS = re.compile(r"± (?=\d)")


@functools.lru_cache(maxsize=2048)  # a page has the same sentences in every run
def typeset(text: str) -> str:
    """Return a text typeset for display: "-3 px" gets a minus sign and a no-break space; code and quotations stay.

    For text that people read; files, flags and typed input keep the hyphen.
    """
    parts = _CODE.split(text)
    parts[::2] = (_typeset_part(part) for part in parts[::2])
    return "".join(parts)


def four_digits(number: float) -> str:
    """Return a number of 0 or more with four significant digits; a large one in full, not as a power of ten: 30,000."""
    return f"{number:,.4g}" if number < 9999.5 else f"{number:,.0f}"


def duration(seconds: float) -> str:
    """Return a duration with a suitable unit."""
    return typeset(f"{seconds * 1e3:.0f} ms" if seconds < 1 else f"{seconds:,.2f} s")


def percent(share: float) -> str:
    """Return a share, 0..1, as a percentage."""
    return typeset(f"{share * 100:.0f} %")


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: "1 sample", "1,024 samples"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def enumeration(words: Sequence[str]) -> str:
    """Return words as they are listed in a sentence: "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


P = ParamSpec("P")


def typesets(words: Callable[P, str]) -> Callable[P, str]:
    """Decorate a function so that the text it returns is typeset for readers."""

    @functools.wraps(words)
    def readable(*args: P.args, **kwargs: P.kwargs) -> str:
        return typeset(words(*args, **kwargs))

    return readable


def _typeset_part(text: str) -> str:
    text = _HYPHEN.sub(MINUS, _NEGATIVE_ZERO.sub("", text))
    text = _GAP.sub(lambda found: (found[1] or "") + NO_BREAK, text)
    return _PLUS_MINUS.sub("±" + NO_BREAK, text)
