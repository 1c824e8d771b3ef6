"""Shaping: which glyphs a line of text is drawn with, and where; joined and from the right where its script is so."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from typing import Any

from recon.plan.fonts import Font, fonts_for, main_font

FEATURES = {"kern": False, "liga": False}
"""Letters stand as far apart as `text_width` says of plain texts, which are not shaped."""
_DEPENDENT = ("Mn", "Mc", "Me", "Cf")  # categories of what has no place without the letter before it


@dataclass(frozen=True)
class Glyph:
    """index: in the font. text: letters that it stands for, none where an earlier glyph does.

    advance, right, up: em; the way to the next glyph, and the shift of this one.
    """

    index: int
    text: str
    advance: float
    right: float
    up: float


@dataclass(frozen=True)
class Run:
    """Glyphs of one font, from left to right, and whether they are read from the right."""

    font: Font
    leftwards: bool
    glyphs: tuple[Glyph, ...]


@lru_cache(maxsize=65536)
def is_plain(text: str, bold: bool) -> bool:
    """Whether a text is one glyph of the main font a letter, from left to right."""
    if text.isascii():
        return text.isprintable()
    letters = main_font(bold).letters
    return all(ord(c) in letters and not _needs_shaping(c) for c in text)


@lru_cache(maxsize=4096)
def shape(text: str, bold: bool) -> tuple[Run, ...]:
    """The runs of a line of text, from left to right: Unicode's bidirectional algorithm (UAX 9), then HarfBuzz."""
    levels, fonts = _levels(text), _fonts(text, bold)
    items = []
    for (level, font), group in groupby(range(len(text)), key=lambda i: (levels[i], fonts[i])):
        letters = list(group)
        items.append((level, font, text[letters[0] : letters[-1] + 1]))
    ordered = [(level % 2 == 1, font, part) for level, font, part in _visual(items)]
    return tuple(Run(font, odd, tuple(_glyphs(part, font, odd))) for odd, font, part in ordered)


def from_right(text: str) -> bool:
    """Whether a line of text as a whole runs from right to left, by its first strong letter (UAX 9, P2 and P3)."""
    return next((kind != "L" for c in text if (kind := unicodedata.bidirectional(c)) in ("L", "R", "AL")), False)


def _needs_shaping(letter: str) -> bool:
    return unicodedata.bidirectional(letter) in ("R", "AL", "AN") or unicodedata.category(letter) in _DEPENDENT


def _levels(text: str) -> list[int]:
    """The embedding level of every letter: odd from right to left."""
    from bidi import algorithm

    storage = algorithm.get_empty_storage()
    base = int(from_right(text))
    storage["base_level"], storage["base_dir"] = base, ("L", "R")[base]
    algorithm.get_embedding_levels(text, storage)
    for index, letter in enumerate(storage["chars"]):
        letter["index"] = index
    algorithm.explicit_embed_and_overrides(storage)
    algorithm.resolve_weak_types(storage)
    algorithm.resolve_neutral_types(storage, False)
    algorithm.resolve_implicit_levels(storage, False)
    known = {letter["index"]: int(letter["level"]) for letter in storage["chars"]}
    levels: list[int] = []
    for index in range(len(text)):  # joiners are left out by the algorithm
        levels.append(known.get(index, levels[-1] if levels else base))
    return levels


def _fonts(text: str, bold: bool) -> list[Font]:
    """The font of every letter; marks and spaces stay with what is before them, where that can."""
    asked = fonts_for(text, bold)
    out: list[Font] = []
    for letter in text:
        stays = unicodedata.category(letter) in (*_DEPENDENT, "Zs")
        if stays and out and ord(letter) in out[-1].letters:
            out.append(out[-1])
        else:
            out.append(next((font for font in asked if ord(letter) in font.letters), asked[0]))
    return out


def _visual(items: list[tuple[int, Font, str]]) -> list[tuple[int, Font, str]]:
    """Items as they stand from left to right (UAX 9, L2)."""
    for level in range(max((item[0] for item in items), default=0), 0, -1):
        turned: list[tuple[int, Font, str]] = []
        for deep, group in groupby(items, key=lambda item: item[0] >= level):
            part = list(group)
            turned += part[::-1] if deep else part
        items = turned
    return items


def _glyphs(text: str, font: Font, leftwards: bool) -> Iterator[Glyph]:
    import uharfbuzz

    buffer: Any = uharfbuzz.Buffer()
    buffer.cluster_level = uharfbuzz.BufferClusterLevel.MONOTONE_CHARACTERS
    buffer.add_str(text)
    buffer.guess_segment_properties()
    buffer.direction = "rtl" if leftwards else "ltr"
    uharfbuzz.shape(font.shaper, buffer, FEATURES)
    em = font.shaper.face.upem
    starts = sorted({info.cluster for info in buffer.glyph_infos})
    ends = dict(zip(starts, [*starts[1:], len(text)], strict=True))
    for info, place in zip(buffer.glyph_infos, buffer.glyph_positions, strict=True):
        letters = text[info.cluster : ends.pop(info.cluster)] if info.cluster in ends else ""
        yield Glyph(info.codepoint, letters, place.x_advance / em, place.x_offset / em, place.y_offset / em)
