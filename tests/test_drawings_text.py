"""Letters of all scripts on plans: shaped, embedded, and read back by others."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
import pypdf
import pypdfium2
import pytest
import uharfbuzz
from hypothesis import given, settings
from hypothesis import strategies as st
from two_rooms import two_rooms

from recon.exporters import export
from recon.model import Layout, Model, Room, Wall
from recon.plan import fonts
from recon.plan.fonts import PACKS, more_fonts
from recon.plan.lettering import clean, text_width
from recon.plan.shaping import shape

SVG = "{http://www.w3.org/2000/svg}"
ARABIC = ("قاعة كبيرة", "غرفة 12", "חדר ישיבות 3")
ASIAN = ("会議室 ミーティング", "회의실 12", "会议室 Room")
OTHERS = ("ห้องประชุมที่ ๒", "İstanbul Ω Ж")

needs_fonts = pytest.mark.skipif(len(more_fonts(True)) < 8, reason="the extra 'fonts' is not installed")


def named(*names: str, title: str = "plan") -> Model:
    """A row of square rooms."""
    rooms, walls = [], list[Wall]()
    for k, name in enumerate(names):
        polygon = np.array([6.0 * k, 0.0]) + np.array([[0.0, 0.0], [5.5, 0.0], [5.5, 5.0], [0.0, 5.0]])
        rooms.append(Room(k, name, polygon))
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            walls.append(Wall(len(walls), a, b, 0.004, 0.001, "lidar", 5))
    return Model(title, Layout(tuple(walls), tuple(rooms)), ())


def read_by_pypdf(path: Path) -> str:
    return pypdf.PdfReader(path).pages[0].extract_text()


def read_by_pdfium(path: Path) -> str:
    return str(pypdfium2.PdfDocument(path)[0].get_textpage().get_text_bounded())


def picture(path: Path) -> np.ndarray:
    return np.asarray(pypdfium2.PdfDocument(path)[0].render(scale=2).to_pil().convert("L"))


@needs_fonts
def test_names_of_any_script_are_read_back_from_pdf(tmp_path: Path) -> None:
    names = (*ARABIC, *ASIAN, *OTHERS, "सम्मेलन कक्ष")
    assert export(named(*names), tmp_path / "plan.pdf") == ()
    said = read_by_pdfium(tmp_path / "plan.pdf")
    assert [name for name in names if name not in said] == []
    said = read_by_pypdf(tmp_path / "plan.pdf")
    assert [name for name in (ARABIC[0], *ASIAN, *OTHERS) if name not in said] == []
    for page in pypdf.PdfReader(tmp_path / "plan.pdf").pages:
        for font in page["/Resources"]["/Font"].values():  # type: ignore[index]
            assert "/FontFile2" in font.get_object()["/FontDescriptor"]


def test_arabic_letters_join_and_run_from_the_right() -> None:
    (run,) = shape("كتب", False)
    assert run.leftwards
    assert [glyph.text for glyph in run.glyphs] == ["ب", "ت", "ك"]
    apart = sum(text_width(c, 1.0) for c in "كتب")
    assert text_width("كتب", 1.0) < 0.9 * apart  # joined forms are narrower than those that stand alone
    visual = "".join(g.text for r in shape("abc אבג 12", False) for g in r.glyphs)
    assert visual == "abc 12 גבא"


@given(st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12), st.booleans())
@settings(deadline=None, max_examples=60)
def test_every_letter_is_shaped_once(text: str, bold: bool) -> None:
    said = clean(text)
    shown = "".join(glyph.text for run in shape(said, bold) for glyph in run.glyphs)
    assert sorted(shown) == sorted(said)
    assert text_width(said, 2.0, bold) == pytest.approx(2 * text_width(said, 1.0, bold))


@needs_fonts
def test_svg_has_fonts_that_shape_its_texts(tmp_path: Path) -> None:
    export(named(ARABIC[0], ASIAN[0]), tmp_path / "plan.svg")
    root = ET.parse(tmp_path / "plan.svg").getroot()
    style = str(next(root.iter(f"{SVG}style")).text)
    assert "recon-NotoSansJP" in style
    arabic = next(e for e in root.iter(f"{SVG}text") if e.text == ARABIC[0])
    assert arabic.get("direction") == "rtl"
    import base64
    import re

    from fontTools.ttLib import TTFont

    rule = next(r for r in style.splitlines() if "font-family: recon;" in r and "bold" in r)
    data = base64.b64decode(str(re.search(r"base64,([^)]+)\)", rule)[1]))  # type: ignore[index]
    stream = io.BytesIO()
    font = TTFont(io.BytesIO(data))
    font.flavor = None
    font.save(stream)
    shaper = uharfbuzz.Font(uharfbuzz.Face(stream.getvalue()))
    buffer = uharfbuzz.Buffer()
    buffer.add_str(ARABIC[0])
    buffer.guess_segment_properties()
    uharfbuzz.shape(shaper, buffer, {"kern": False, "liga": False})
    assert all(info.codepoint for info in buffer.glyph_infos)
    width = sum(place.x_advance for place in buffer.glyph_positions) / shaper.face.upem
    assert width == pytest.approx(sum(g.advance for r in shape(ARABIC[0], True) for g in r.glyphs), rel=1e-3)


def test_letters_without_a_font_are_named_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(fonts, "PACKS", ("justmytype_not_there",))
    more_fonts.cache_clear()
    shape.cache_clear()
    try:
        for suffix in (".pdf", ".svg", ".png"):
            (note,) = export(named("会議", "議会 Ω"), tmp_path / f"plan{suffix}")
            assert "'会議'" in note and "pip install 'recon[fonts]'" in note and "\n" not in note
    finally:
        monkeypatch.undo()
        more_fonts.cache_clear()
        shape.cache_clear()
    assert PACKS == fonts.PACKS


def test_dxf_keeps_names_and_has_styles_for_them(tmp_path: Path) -> None:
    export(named(*ARABIC, *ASIAN, *OTHERS), tmp_path / "plan.dxf")
    document = ezdxf.readfile(tmp_path / "plan.dxf")
    styles = {e.dxf.text: e.dxf.style for e in document.modelspace().query("TEXT")}
    assert {*ARABIC, *ASIAN, *OTHERS} <= set(styles)
    assert [styles[name] for name in ASIAN] == ["RECON_JP", "RECON_KR", "RECON_SC"]
    assert all(style in document.styles for style in styles.values())


def test_controls_of_direction_cannot_turn_a_plan_around(tmp_path: Path) -> None:
    model = dataclasses.replace(two_rooms(), name="left\u202eright\u2066x\u200d")
    assert clean(model.name) == "leftrightx\u200d"
    export(model, tmp_path / "plan.pdf")
    assert "leftright" in read_by_pypdf(tmp_path / "plan.pdf")
