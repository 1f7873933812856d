"""How many bits are set: one machine instruction that neither Python nor Numba has a word for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from numba.core import types
from numba.extending import intrinsic


def _popcount(typing: Any, word: Any) -> Any:
    """Return the number of ones in an unsigned integer, in its own type. For compiled code only."""
    if not isinstance(word, types.Integer):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return word(word), generate


popcount = cast(Callable[[Any], Any], intrinsic(_popcount))
