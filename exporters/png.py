"""PNG: a preview of the plan, the page of the PDF as a picture."""

from __future__ import annotations

import io

from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.pdf import render_pdf
from recon.model import Model
from recon.plan.draw import draw_plan

LONGEST = 3000
"""Pixels of the longer side, at most."""
RESOLUTION = 200
"""Pixels an inch, at most."""


def write_png(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """The sheet as RGB pixels."""
    import pypdfium2

    drawing = draw_plan(model, options.drawing)
    scale = min(RESOLUTION / 72, LONGEST / (max(drawing.paper) / 25.4 * 72))
    document = pypdfium2.PdfDocument(render_pdf(drawing))
    try:
        picture = document[0].render(scale=scale).to_pil().convert("RGB")
    finally:
        document.close()
    stream = io.BytesIO()
    picture.save(stream, "PNG")
    return Output(stream.getvalue(), notes=drawing.missing_letters())
