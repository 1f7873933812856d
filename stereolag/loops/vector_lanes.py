"""The processor's vector registers as a type for compiled loops: sixteen neighbours at once.

Numba relies on LLVM to vectorise plain loops. The loops of the window correlation use too many arrays for LLVM to prove
that none overlap, and it gives up. So these loops are vectorised explicitly. A
value of type ``Lanes`` is sixteen numbers side by side. LLVM maps it to the registers of the machine: one of AVX-512,
two of AVX2, four of SSE or NEON. Inside compiled code ``+ - * & | ^ >>`` work on it lane by lane, the last one on
unsigned bits. Indices count elements from the start of the array, whatever its shape, and are not checked.

Loops name the instructions without loading Numba, which is only needed to compile them.
"""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from stereolag.loops.compilation import BEFORE_COMPILING, Deferred
from stereolag.loops.numba_inside import LANES as LANES

if TYPE_CHECKING:
    from stereolag.loops.instructions import *  # noqa: F403
else:

    def __getattr__(name: str) -> Any:
        """Return an instruction, for loops to name."""
        if name.startswith("_"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return Deferred(lambda: getattr(import_module("stereolag.loops.instructions"), name))


def lanes_for(count: int) -> int:
    """Return `count` rounded up to a multiple of sixteen lanes."""
    return -(-count // LANES) * LANES


BEFORE_COMPILING.append(partial(import_module, "stereolag.loops.instructions"))  # its operators
