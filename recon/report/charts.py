"""Charts over time: lines in a picture that stretches, words beside it that do not."""

from __future__ import annotations

from html import escape

import numpy as np

from recon.geometry import Array

WIDTH, HEIGHT = 600.0, 120.0
"""Units of the picture."""
MOST = 400
"""Points of a line: of more, root mean squares of as many stretches are drawn."""
COLOURS = ("var(--link)", "#c62828", "#2e9e4f", "#c77700")


def chart(title: str, times: Array, lines: dict[str, Array], expected: float | None = None) -> str:
    """Lines (N,) by name over times (N,) s, from 0 up; nan: no point there. expected: a level to compare with."""
    drawn = {name: thinned(times, values) for name, values in lines.items()}
    top = max((float(y.max()) for _, y in drawn.values() if len(y)), default=0.0)
    top = max(top, 1.25 * (expected or 0.0), 1e-9)
    last = max(float(times[-1]), 1e-9) if len(times) else 1.0
    paths = []
    for colour, (x, y) in zip(COLOURS, drawn.values(), strict=False):
        points = " ".join(f"{WIDTH * a / last:.1f},{HEIGHT * (1 - b / top):.1f}" for a, b in zip(x, y, strict=True))
        paths.append(f'<polyline stroke="{colour}" points="{points}"/>')
    if expected is not None:
        level = HEIGHT * (1 - expected / top)
        paths.append(f'<path class="level" d="M0,{level:.1f}h{WIDTH:.0f}"/>')
    words = f"{escape(title)}: up to {top:.3g} over {last:.0f} s"
    picture = f'<svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" preserveAspectRatio="none" role="img" aria-label="{words}">'
    key = "".join(
        f'<span><i style="background: {colour}"></i>{escape(name)}</span>'
        for colour, name in zip(COLOURS, lines, strict=False)
        if name
    )
    scale = f'<span class="up"><span>{top:.3g}</span><span>0</span></span>'
    return (
        f'<figure class="chart"><figcaption>{escape(title)}<span class="key">{key}</span></figcaption>'
        f'<div class="field">{scale}{picture}{"".join(paths)}</svg></div>'
        f'<div class="along"><span>0 s</span><span>{last:.0f} s</span></div></figure>'
    )


def thinned(times: Array, values: Array) -> tuple[Array, Array]:
    """Times and values (M,) of those (N,) that are known, at most MOST: the root mean square of each stretch."""
    known = np.isfinite(values)
    x, y = times[known], values[known]
    if len(x) <= MOST:
        return x, y
    starts = np.linspace(0, len(x), MOST, endpoint=False).astype(int)
    counts = np.diff(np.append(starts, len(x)))
    return np.add.reduceat(x, starts) / counts, np.sqrt(np.add.reduceat(y**2, starts) / counts)
