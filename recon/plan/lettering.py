"""Lettering: how wide texts are. DejaVu Sans, as narrow as its condensed cut, which is about as wide as Arial."""

from __future__ import annotations

import unicodedata
from functools import cache, lru_cache
from typing import Any

from recon.plan.fonts import main_font
from recon.plan.shaping import is_plain, shape

CONDENSED = 0.9
"""Horizontal scale: DejaVu Sans Condensed is DejaVu Sans drawn this narrow."""
CAP_HEIGHT = 1493 / 2048
"""Height of capital letters in em; texts are sized by it, as ISO 3098 does."""
DESCENT = 0.33
"""Of the cap height, below the base line."""
LINE = 1.7
"""Of the cap height, from line to line."""
JOINERS = "\u200c\u200d"
"""They say whether letters join, and are no letters themselves."""


def text_width(text: str, height: float, bold: bool = False) -> float:
    """Width of a line of text whose capitals are `height` high, in the same unit."""
    return _em(text, bold) * CONDENSED / CAP_HEIGHT * height


def shortened(text: str, height: float, width: float, bold: bool = False) -> str:
    """The text, or as much of it as fits into `width`, with an ellipsis."""
    if text_width(text, height, bold) <= width:
        return text
    low, high = 0, len(text)  # of so many characters it fits, of so many it does not
    while high - low > 1:
        middle = (low + high) // 2
        fits = text_width(text[:middle].rstrip() + "…", height, bold) <= width
        low, high = (middle, high) if fits else (low, middle)
    return text[:low].rstrip() + "…" if low else ""


def wrapped(text: str, height: float, width: float, bold: bool = False) -> list[str]:
    """The text in lines that fit into `width`, broken between words, and in long words where it must be."""
    lines: list[str] = []
    for word in text.split():
        joined = f"{lines[-1]} {word}" if lines else word
        if lines and text_width(joined, height, bold) <= width:
            lines[-1] = joined
            continue
        while text_width(word, height, bold) > width and len(word) > 1:
            fitting = next((n for n in range(len(word) - 1, 1, -1) if text_width(word[:n], height, bold) <= width), 1)
            lines.append(word[:fitting])
            word = word[fitting:]
        lines.append(word)
    return lines


def clean(text: str) -> str:
    """The text in one line, without control characters, which no format can hold; joiners of letters stay."""
    return " ".join("".join(map(_printable, text)).split())


def _printable(letter: str) -> str:
    if letter.isprintable() or letter.isspace() or letter in JOINERS:
        return letter
    return "" if unicodedata.category(letter) == "Cf" else "\ufffd"


@lru_cache(maxsize=65536)
def _em(text: str, bold: bool) -> float:
    """Width of a line of text, em."""
    if is_plain(text, bold):
        widths = _widths(bold)
        return sum(widths[ord(c)] for c in text)
    return sum(glyph.advance for run in shape(text, bold) for glyph in run.glyphs)


@cache
def _widths(bold: bool) -> dict[int, float]:
    from fontTools.ttLib import TTFont

    font: Any = TTFont(main_font(bold).path, lazy=True)
    em, metrics = font["head"].unitsPerEm, font["hmtx"].metrics
    return {code: metrics[glyph][0] / em for code, glyph in font.getBestCmap().items()}
