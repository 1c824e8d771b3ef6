"""Lengths and areas as drawings write them."""

from __future__ import annotations

import numpy as np

from recon.plan.options import Units

INCH = 0.0254
FOOT = 12 * INCH
_EIGHTHS = 8
_UNIT = {"m": " m", "mm": "", "ft": ""}


def length_text(metres: float, units: Units, unit: bool = False) -> str:
    """`4.213`, `4213` or `13'-9 7/8"`; with `unit` metres are named."""
    if units == "m":
        return f"{metres:.3f}" + (_UNIT[units] if unit else "")
    return f"{metres * 1000:.0f}" if units == "mm" else _feet(metres)


def length_with_sigma(metres: float, sigma: float, units: Units, unit: bool = False) -> str:
    """`4.213 ± 0.006`: the length and one standard deviation, rounded up."""
    return f"{length_text(metres, units)} ± {_sigma(sigma, units)}" + (_UNIT[units] if unit else "")


def area_text(square_metres: float, units: Units) -> str:
    """`18.00 m²`, or square feet."""
    return f"{square_metres / FOOT**2:.1f} ft²" if units == "ft" else f"{square_metres:.2f} m²"


def _sigma(sigma: float, units: Units) -> str:
    if units == "ft":
        return f'{np.ceil(sigma / INCH * 100 - 1e-6) / 100:.2f}"'
    millimetres = int(np.ceil(sigma * 1000 - 1e-6))
    return f"{millimetres}" if units == "mm" else f"{millimetres / 1000:.3f}"


def _feet(metres: float) -> str:
    """Feet and inches to the eighth of an inch."""
    eighths = round(abs(metres) / INCH * _EIGHTHS)
    feet, rest = divmod(eighths, 12 * _EIGHTHS)
    inches, part = divmod(rest, _EIGHTHS)
    divisor = int(np.gcd(part, _EIGHTHS))
    fraction = f" {part // divisor}/{_EIGHTHS // divisor}" if part else ""
    sign = "-" if metres < 0 and eighths else ""
    return f"{sign}{feet}'-{inches}{fraction}\""
