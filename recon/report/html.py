"""Pieces of a page: sections, tables, pictures within it."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape

import cv2
import numpy as np
from numpy.typing import NDArray

STYLE = """
:root { color-scheme: light dark; --ink: #1c1e21; --paper: #fff; --soft: #5f656c; --line: #dfe2e6; --link: #1257c0; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8eaed; --paper: #17191c; --soft: #9aa0a6; --line: #34383d; --link: #8ab4f8; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 70rem; padding: 1rem; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin: 0.5rem 0; } h2 { font-size: 1.15rem; margin: 2rem 0 0.5rem; }
a { color: var(--link); }
img, svg { max-width: 100%; height: auto; }
.house, .sketch, .map, .sheet svg { display: block; background: #fff; border-radius: 6px; }
iframe { display: block; width: 100%; aspect-ratio: 8 / 5; border: 0; border-radius: 6px;
  background: #fff; }
summary { cursor: pointer; padding: 0.4rem 0; color: var(--link); }
.facts { display: flex; flex-wrap: wrap; gap: 0.5rem 2rem; margin: 1rem 0; padding: 0; list-style: none; }
.facts b { display: block; font-size: 1.3rem; }
.facts span, figcaption, .key, .along, .up { color: var(--soft); font-size: 0.9rem; }
.views { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(16rem, 100%), 1fr)); gap: 0.75rem; }
figure { margin: 0; } .wide { margin-bottom: 0.75rem; } .scroll { overflow: auto; max-height: 90vh; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
td, th { border-bottom: 1px solid var(--line); padding: 0.2rem 0.8rem 0.2rem 0; text-align: right; }
td:first-child, th:first-child { text-align: left; }
.full, .part { display: block; color: var(--soft); font-size: 0.9rem; margin: 0; padding: 0.2rem 0; }
.part { display: none; }
.sheet:has(input:checked) svg { max-width: none; }
.sketch { display: none; width: 100%; color: #1c1e21; font-family: system-ui, sans-serif; }
.sketch path { fill-rule: evenodd; vector-effect: non-scaling-stroke; stroke-width: 0.8; }
.sketch .floor { fill: #eef1f5; stroke: none; } .sketch .walls { fill: #2b3038; stroke: #2b3038; }
.sketch .unseen { fill: #a9b0b8; stroke: #a9b0b8; }
.sketch text { text-anchor: middle; } .sketch .name { font-weight: 600; }
.map, .map + .key { width: 100%; } .map { max-height: 90vh; }
.map path { fill: none; vector-effect: non-scaling-stroke; } .map .wall { stroke-width: 2.5; }
.map .way { stroke: #1f6feb; stroke-width: 1.2; } .map .start { fill: #1f6feb; }
.map .loops { stroke: #2e9e4f; stroke-width: 1; } .map path.ruler { stroke: #1c1e21; stroke-width: 1.5; }
.map text.ruler { font: 26px system-ui, sans-serif; fill: #1c1e21; }
.key { display: flex; flex-wrap: wrap; gap: 0.2rem 1.2rem; margin: 0.4rem 0; }
.key i { display: inline-block; width: 1.2rem; height: 3px; margin-right: 0.4rem; vertical-align: middle; }
.key .way { background: #1f6feb; } .key .loops { background: #2e9e4f; }
.key .inferred { border-top: 2px dashed #8a9199; }
.key .bar { width: 5rem; height: 0.6rem; margin: 0 0.3rem; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(20rem, 100%), 1fr)); gap: 1rem 1.5rem;
  align-items: end; }
.chart svg { flex: 1; min-width: 0; height: 7.5rem; border: solid var(--line); border-width: 0 0 1px 1px; }
.chart polyline, .chart path { fill: none; stroke-width: 1.4; vector-effect: non-scaling-stroke; }
.chart .level { stroke: var(--soft); stroke-dasharray: 4 3; } .field { display: flex; gap: 0.4rem; }
.up { display: flex; flex-direction: column; justify-content: space-between; text-align: right; min-width: 2.6rem; }
.along { display: flex; justify-content: space-between; padding-left: 3rem; }
@media (max-width: 45rem) { .sketch { display: block; } .part { display: block; }
  .sheet svg { max-width: none; } .full { display: none; }
  .scroll { max-height: 70vh; } }
@media print { details, h2:has(+ details), .full, .part { display: none; }
  .views, .charts { grid-template-columns: repeat(3, 1fr); gap: 0.5rem; }
  .scroll { max-height: none; overflow: visible; }
  .sketch { display: none; } .sheet svg { max-width: 100%; } figure, tr { break-inside: avoid; }
  h2 { break-after: avoid; } .key i { print-color-adjust: exact; } body { max-width: none; padding: 0; } }
"""
"""Light and dark as the reader's system has it; narrow screens without scrolling sideways but for tables."""
SCRIPT = """
const middle = () => document.querySelectorAll(".sheet .scroll").forEach(s => s.scrollTo(
  (s.scrollWidth - s.clientWidth) / 2, (s.scrollHeight - s.clientHeight) / 2));
document.querySelectorAll(".full input").forEach(box => box.addEventListener("change", middle));
middle();
"""
"""A sheet that is larger than its place shows its middle first."""


def page(title: str, parts: Sequence[str]) -> str:
    """A whole document; parts that are empty are left out."""
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)} - recon</title><style>{STYLE}</style></head>\n"
        f"<body>\n<h1>{escape(title)}</h1>\n{body}\n<script>{SCRIPT}</script>\n</body></html>\n"
    )


def section(title: str, content: str) -> str:
    """A heading and what is below it; nothing where that is empty."""
    return f"<h2>{escape(title)}</h2>\n{content}" if content else ""


def listing(items: Sequence[str]) -> str:
    """A list of plain texts, nothing where there are none."""
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>" if items else ""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Plain texts, the first column to the left; wide ones scroll by themselves."""
    cells = "".join(f"<th>{escape(c)}</th>" for c in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><tr>{cells}</tr>{body}</table></div>'


def folded(summary: str, content: str) -> str:
    """What is shown on demand."""
    return f"<details><summary>{escape(summary)}</summary>\n{content}</details>"


def figure(source: str, caption: str, kind: str = "") -> str:
    """A picture (a data address) with words below it."""
    text = escape(caption)
    return f'<figure class="{kind}"><img alt="{text}" src="{source}"><figcaption>{text}</figcaption></figure>'


def jpeg(rgb: NDArray[np.uint8], quality: int = 88) -> str:
    """Data address of a picture (H, W, 3) RGB."""
    data = cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    return data_address(data, "image/jpeg")


def data_address(content: bytes, kind: str) -> str:
    """Content within the page, of the media type `kind`."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
