"""All that loops take from the inside of Numba: what registers hold, and how machine code is kept and loaded.

Numba documents none of it: instructions for vector registers are written with its code generator, and a kept loop is
loaded by a cache of our own, without all that a compiler needs.
"""

from __future__ import annotations

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.caching import FunctionCache
from numba.core.runtime.nrt import rtsys

__all__ = ["FunctionCache", "cgutils", "ir", "rtsys", "types"]
