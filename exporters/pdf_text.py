"""Lines of text in a PDF: plain ones in DejaVu Sans, others as shaped glyphs of fonts made for the file."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from recon.plan.drawing import Text
from recon.plan.fonts import Font, main_font
from recon.plan.lettering import CAP_HEIGHT, CONDENSED
from recon.plan.shaping import Glyph, Run, is_plain, shape

PLAIN = "DejaVuSans"
"""Name of the font that is always there."""
POINT = 72 / 25.4
"""Points in a millimetre."""
FIRST = 0xE000
"""Code point of the first glyph in fonts made for a file: of private use."""
_STILL = 1e-6  # em

Piece = tuple[str, str, tuple[float, float]]  # font, characters, and their place, em along the line and up


class Letters:
    """Writes the texts of one drawing; fonts are registered with what the texts need of them."""

    def __init__(self, texts: Iterable[Text]) -> None:
        from reportlab.pdfbase import pdfmetrics

        _register_plain(False)
        self._names: dict[tuple[Font, int], tuple[str, str]] = {}
        glyphs: dict[Font, dict[int, str]] = {}
        for text in texts:
            if is_plain(text.text, text.bold):
                _register_plain(text.bold)
                continue
            for run in shape(text.text, text.bold):
                known = glyphs.setdefault(run.font, {})
                for glyph in run.glyphs:
                    known[glyph.index] = known.get(glyph.index) or glyph.text
        for font, used in glyphs.items():
            name = f"{font.name}-{'shaped-bold' if font.bold else 'shaped'}"
            pdfmetrics.registerFont(_shaped_font(name, font, used))
            for number, index in enumerate(used):
                self._names[font, index] = name, chr(FIRST + number)

    def write(self, canvas: Any, text: Text) -> None:
        """A line of text; its width is what `recon.plan.lettering` says."""
        left = {"start": 0.0, "middle": 0.5, "end": 1.0}[text.anchor] * text.width
        along = np.array([np.cos(text.angle), np.sin(text.angle)])
        up = np.array([-along[1], along[0]])
        size, at = text.height / CAP_HEIGHT, text.at - left * along
        line = canvas.beginText()
        line.setHorizScale(100 * CONDENSED)
        line.setFillColorRGB(*(c / 255 for c in text.layer.rgb))
        for said, pieces in self._spans(text):
            if said:  # what stands there, in its own order, whatever the glyphs are
                line._code.append(f"/Span <</ActualText <FEFF{_utf16(said)}>>> BDC")
            for name, letters, place in pieces:
                x, y = (at + size * (place[0] * along + place[1] * up)) * POINT
                line.setFont(name, size * POINT)
                line.setTextTransform(along[0], along[1], up[0], up[1], float(x), float(y))
                line.textOut(letters)
            if said:
                line._code.append("EMC")
        canvas.drawText(line)

    def _spans(self, text: Text) -> Iterator[tuple[str, list[Piece]]]:
        """Pieces of a text with what they say where their letters do not, one by one.

        Readers turn text from right to left themselves, by its glyphs, and would turn what is said for it again.
        """
        if is_plain(text.text, text.bold):
            yield "", [(_plain(text.bold), text.text, (0.0, 0.0))]
            return
        x = 0.0
        for run in shape(text.text, text.bold):
            single = all(len(glyph.text) == 1 for glyph in run.glyphs)
            said = "" if run.leftwards or single else "".join(glyph.text for glyph in run.glyphs)
            yield said, list(self._pieces(run, x))
            x += sum(glyph.advance for glyph in run.glyphs) * CONDENSED

    def _pieces(self, run: Run, x: float) -> Iterator[Piece]:
        """Glyphs of a run that starts at x, em, that are written one after the other."""
        name, letters, start, pen = "", "", (x, 0.0), x
        for glyph in run.glyphs:
            place = x + glyph.right * CONDENSED, glyph.up
            if letters and max(abs(place[0] - pen), abs(place[1] - start[1])) > _STILL:
                yield name, letters, start
                letters = ""
            if not letters:
                start = place
            name, letter = self._names[run.font, glyph.index]
            letters, pen = letters + letter, place[0] + _width(run.font, glyph) * CONDENSED
            x += glyph.advance * CONDENSED
        if letters:
            yield name, letters, start


def _plain(bold: bool) -> str:
    return main_font(bold).name


def _register_plain(bold: bool) -> None:
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    if _plain(bold) not in pdfmetrics.getRegisteredFontNames():
        pdfmetrics.registerFont(TTFont(_plain(bold), str(main_font(bold).path)))


def _width(font: Font, glyph: Glyph) -> float:
    """The glyph's own advance, em; shaping may have given it another."""
    return float(font.shaper.get_glyph_h_advance(glyph.index)) / float(font.shaper.face.upem)


def _shaped_font(name: str, font: Font, used: dict[int, str]) -> Any:
    """A font of the glyphs `used`, each under a code point of its own, that says which letters they stand for."""
    from reportlab.pdfbase.ttfonts import freshTTFont

    texts = list(used.values())
    packed: Any = freshTTFont(name, io.BytesIO(_packed(name, font, list(used))), asciiReadable=False)
    write = packed.addObjects

    def said(match: re.Match[str]) -> str:
        letters = texts[int(match[1], 16) - FIRST]
        return f"> <{_utf16(letters) or '200B'}>"  # a glyph that belongs to the one before says nothing

    def write_with_letters(document: Any) -> None:
        """ReportLab says code points, which are of private use here; readers want letters."""
        write(document)
        for key, item in document.idToObject.items():
            if key.startswith("toUnicodeCMap:") and packed.face.name.decode() in key:
                item.content = re.sub(r"> <(E[0-9A-F]{3}|F[0-8][0-9A-F]{2})>", said, item.content)

    packed.addObjects = write_with_letters
    return packed


def _packed(name: str, font: Font, glyphs: list[int]) -> bytes:
    """A TrueType file with these glyphs only, from code point FIRST on."""
    from fontTools import subset
    from fontTools.fontBuilder import FontBuilder
    from fontTools.varLib import instancer

    options = subset.Options(hinting=False, layout_features=[], notdef_outline=True, drop_tables=["FFTM"])
    loaded: Any = subset.load_font(str(font.path), options, dontLoadGlyphNames=True)
    names = [loaded.getGlyphName(index) for index in glyphs]
    subsetter = subset.Subsetter(options)
    subsetter.populate(gids=glyphs)
    subsetter.subset(loaded)
    if font.axes:
        loaded = instancer.instantiateVariableFont(loaded, font.axes)
    builder = FontBuilder(font=loaded)
    builder.setupCharacterMap({FIRST + number: glyph for number, glyph in enumerate(names)})
    builder.setupNameTable({"psName": name, "familyName": name, "styleName": "Regular"})
    loaded.recalcTimestamp = False
    stream = io.BytesIO()
    loaded.save(stream)
    return stream.getvalue()


def _utf16(text: str) -> str:
    return text.encode("utf-16-be", "replace").hex().upper()
