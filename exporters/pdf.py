"""PDF: the plan to scale on paper, lines and texts as such, fonts embedded."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.pdf_text import PLAIN, POINT, Letters
from recon.model import Model
from recon.plan.draw import draw_plan
from recon.plan.drawing import Drawing, Fill, Polyline, Text
from recon.plan.lettering import clean

if TYPE_CHECKING:
    from recon.geometry import Array

DASH, GAP = 1.6, 1.0
"""mm."""


def write_pdf(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """One page of the size of the paper."""
    drawing = draw_plan(model, options.drawing)
    return Output(render_pdf(drawing), notes=drawing.missing_letters())


def render_pdf(drawing: Drawing) -> bytes:
    """The drawing as a PDF file of one page."""
    from reportlab.pdfgen.canvas import Canvas

    elements = list(drawing.elements())
    letters = Letters(element for element in elements if isinstance(element, Text))
    stream = io.BytesIO()
    size = tuple(side * POINT for side in drawing.paper)
    canvas = Canvas(stream, size, pageCompression=1, invariant=1, initialFontName=PLAIN)  # invariant: no time stamps
    canvas.setTitle(clean(drawing.title))
    canvas.setSubject(f"Floor plan, scale 1:{drawing.scale}")
    canvas.setCreator("recon")
    canvas.setLineJoin(1)
    for element in elements:
        if isinstance(element, Fill):
            canvas.setFillColorRGB(*(c / 255 for c in element.rgb))
            _trace(canvas, element.rings, True)
        elif isinstance(element, Text):
            letters.write(canvas, element)
        elif element.layer.plotted:
            _stroke(canvas, element)
    canvas.showPage()
    canvas.save()
    return stream.getvalue()


def _stroke(canvas: Any, line: Polyline) -> None:
    canvas.setLineWidth(line.pen * POINT)
    canvas.setStrokeColorRGB(*(c / 255 for c in line.layer.rgb))
    canvas.setDash([DASH * POINT, GAP * POINT] if line.layer.dashed else [])
    canvas.setLineCap(0 if line.layer.dashed else 2)
    _trace(canvas, (line.points,), False, line.closed)


def _trace(canvas: Any, rings: tuple[Array, ...], filled: bool, closed: bool = True) -> None:
    path = canvas.beginPath()
    for ring in rings:
        points = np.asarray(ring) * POINT
        path.moveTo(*points[0].tolist())
        for point in points[1:].tolist():
            path.lineTo(*point)
        if closed:
            path.close()
    canvas.drawPath(path, stroke=int(not filled), fill=int(filled), fillMode=0)
