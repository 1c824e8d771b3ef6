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
img, svg { max-width: 100%; height: auto; } .plan, .house { background: #fff; border-radius: 6px; }
.plan { display: block; } .plan svg { display: block; }
iframe { display: block; width: 100%; aspect-ratio: 8 / 5; border: 0; border-radius: 6px; background: #fff; }
summary { cursor: pointer; padding: 0.4rem 0; color: var(--link); }
.facts { display: flex; flex-wrap: wrap; gap: 0.5rem 2rem; margin: 1rem 0; padding: 0; list-style: none; }
.facts b { display: block; font-size: 1.3rem; } .facts span, figcaption { color: var(--soft); font-size: 0.9rem; }
.views { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(16rem, 100%), 1fr)); gap: 0.75rem; }
figure { margin: 0; } .wide { margin-bottom: 0.75rem; } .scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
td, th { border-bottom: 1px solid var(--line); padding: 0.2rem 0.8rem 0.2rem 0; text-align: right; }
td:first-child, th:first-child { text-align: left; }
"""
"""Light and dark as the reader's system has it; narrow screens without scrolling sideways but for tables."""


def page(title: str, parts: Sequence[str]) -> str:
    """A whole document; parts that are empty are left out."""
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)} - recon</title><style>{STYLE}</style></head>\n"
        f"<body>\n<h1>{escape(title)}</h1>\n{body}\n</body></html>\n"
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
