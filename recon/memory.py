"""Memory that is free, given back to the system."""

from __future__ import annotations

import ctypes
import sys


def give_back() -> None:
    """What the C library keeps of memory that was freed goes back to the system, where it can (glibc's malloc_trim).

    Graphs and trees are millions of small pieces; without this every stage adds to the largest of those before it.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # not in musl
        if trim is not None:
            trim(0)
