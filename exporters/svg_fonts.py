"""Fonts in an SVG file: the letters that are used, and what joins and places them."""

from __future__ import annotations

import base64
import io
from typing import Any

from recon.plan.drawing import Drawing, Text
from recon.plan.fonts import Font, main_font
from recon.plan.shaping import FEATURES, is_plain, shape

FAMILY = "recon, 'DejaVu Sans', Verdana, sans-serif"


def family(text: Text) -> str:
    """The families of a text that needs more than one letter after the other, in the order of its runs."""
    fonts = dict.fromkeys(run.font for run in shape(text.text, text.bold))
    names = [_family(font) for font in fonts if font != main_font(text.bold)]
    return ", ".join(["recon", *dict.fromkeys(names), "'DejaVu Sans'", "sans-serif"])


def font_rules(drawing: Drawing) -> str:
    """CSS with the fonts; those of plain texts hold single glyphs, others all that their letters may turn into."""
    letters: dict[Font, set[str]] = {}
    shaped: set[Font] = set()
    for text in (element for element in drawing.elements() if isinstance(element, Text)):
        if is_plain(text.text, text.bold):
            letters.setdefault(main_font(text.bold), set()).update(text.text)
            continue
        for run in shape(text.text, text.bold):
            letters.setdefault(run.font, set()).update("".join(glyph.text for glyph in run.glyphs))
            shaped.add(run.font)
    rules = []
    for font, used in letters.items():
        data = base64.b64encode(_subset(font, "".join(sorted(used)), font in shaped)).decode("ascii")
        weight, source = "bold" if font.bold else "normal", f"src: url(data:font/woff;base64,{data})"
        rules.append(f"@font-face {{ font-family: {_family(font)}; font-weight: {weight}; {source} }}")
    return "\n".join(sorted(rules))


def _family(font: Font) -> str:
    return "recon" if font == main_font(font.bold) else f"recon-{font.name}"


def _subset(font: Font, letters: str, shaped: bool) -> bytes:
    """A WOFF file."""
    from fontTools import subset
    from fontTools.varLib import instancer

    default = [tag for tag in subset.Options().layout_features if FEATURES.get(tag, True)]
    options = subset.Options(
        flavor="woff",
        hinting=False,
        layout_features=default if shaped else [],
        notdef_outline=True,
        drop_tables=["FFTM"],
    )
    loaded: Any = subset.load_font(str(font.path), options, dontLoadGlyphNames=True)
    subsetter = subset.Subsetter(options)
    subsetter.populate(text=letters)
    subsetter.subset(loaded)
    if font.axes:
        loaded = instancer.instantiateVariableFont(loaded, font.axes)
    loaded.recalcTimestamp = False
    stream = io.BytesIO()
    subset.save_font(loaded, stream, options)
    return stream.getvalue()
