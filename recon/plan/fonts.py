"""Fonts of drawings: DejaVu Sans, and Noto fonts of other scripts where the extra `fonts` is installed."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

PACKS = ("justmytype_intl_cjk", "justmytype_intl_sea", "justmytype_intl_south_asia", "justmytype_intl_africa")
"""Packages of the extra: Noto Sans, each with variable TrueType fonts."""
BOLD, REGULAR, NORMAL_WIDTH = 700, 400, 100
Han = Literal["SC", "TC", "JP", "KR"]
_NAMED = 20  # letters at most that a note lists


@dataclass(frozen=True)
class Font:
    """A font file. bold: its weight, by which variable fonts are set."""

    path: Path
    bold: bool

    @property
    def name(self) -> str:
        """`DejaVuSans-Bold`, `NotoSansThai`."""
        return self.path.stem.partition("[")[0]

    @cached_property
    def axes(self) -> dict[str, float]:
        """Where a variable font stands on its axes; empty for others."""
        known = {"wght": float(BOLD if self.bold else REGULAR), "wdth": float(NORMAL_WIDTH)}
        return {axis: value for axis, value in known.items() if axis in self.path.stem}

    @cached_property
    def shaper(self) -> Any:
        """HarfBuzz's font."""
        import uharfbuzz

        font = uharfbuzz.Font(uharfbuzz.Face(uharfbuzz.Blob.from_file_path(str(self.path))))
        if self.axes:
            font.set_variations(self.axes)
        return font

    @cached_property
    def letters(self) -> frozenset[int]:
        """Code points that it has."""
        return frozenset(self.shaper.face.unicodes)


@cache
def main_font(bold: bool) -> Font:
    """DejaVu Sans, which comes with matplotlib."""
    import matplotlib

    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return Font(folder / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"), bold)


@cache
def more_fonts(bold: bool) -> tuple[Font, ...]:
    """Of other scripts, as far as their packages are installed."""
    found = []
    for pack in PACKS:
        spec = find_spec(pack)
        if spec is not None and spec.origin is not None:
            folder = Path(spec.origin).parent / "fonts" / "ofl"
            found += [Font(path, bold) for path in sorted(folder.glob("*/*.ttf"))]
    return tuple(found)


def fonts_for(text: str, bold: bool) -> list[Font]:
    """All fonts, in the order in which they are asked for the letters of a text."""
    order = ("SC", "JP", "KR", "TC") if (own := han(text)) is None else (own, "SC", "JP", "KR", "TC")
    rank = {f"NotoSans{kind}": place for place, kind in reversed(list(enumerate(order)))}
    return [main_font(bold), *sorted(more_fonts(bold), key=lambda font: rank.get(font.name, len(order)))]


def han(text: str) -> Han | None:
    """Of whom a text has letters: the Japanese where it has kana, Koreans where hangul, else Chinese; None: of none."""
    names = [unicodedata.name(c, "").split(" ")[0] for c in text if ord(c) >= 0x1100]
    if any(name in ("HIRAGANA", "KATAKANA") for name in names):
        return "JP"
    return "KR" if "HANGUL" in names else "SC" if "CJK" in names else None


def missing(texts: dict[str, bool]) -> tuple[str, ...]:
    """A line that names the letters which no font has, and what brings them; texts: whether each is bold."""
    lacking: dict[str, None] = {}
    for text, bold in texts.items():
        if any(ord(c) not in main_font(bold).letters for c in text):
            fonts = fonts_for(text, bold)
            lacking |= dict.fromkeys(c for c in text if not any(ord(c) in font.letters for font in fonts))
    if not lacking:
        return ()
    shown = "".join(list(lacking)[:_NAMED]) + ("…" if len(lacking) > _NAMED else "")
    line = f"no font has the letters {shown!r}, boxes stand for them"
    absent = any(find_spec(pack) is None for pack in PACKS)
    return (line + ("; fonts of more scripts come with: pip install 'recon[fonts]'" if absent else ""),)
