"""Images in the report: beside what the model shows, and with every pixel's label."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2

from recon.errors import InputError
from recon.report.html import data_address, figure, section
from recon.results.photos import FOLDER, LIST
from recon.results.reader import read_json
from recon.results.record import Record

VIEWS = "views"
"""Where `recon eval --views` puts its pictures."""
WIDEST = 1440
"""Pixels of a row of three pictures."""


def frames(record: Record) -> str:
    """The images that the model shows worst, those left out of it on purpose, and every pixel's label on some."""
    folder = record.folder
    return _photos(folder) + _held_out(folder) + section("What every pixel shows", _overlays(folder))


def _photos(folder: Path) -> str:
    """Photo, model and difference, as the result folder holds them."""
    path = folder / FOLDER / LIST
    if not path.is_file():
        return ""
    content = read_json(path)
    try:
        count, rows = content["compared"], [(str(r["image"]), r["rank"], float(r["psnr"])) for r in content["photos"]]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon build wrote") from None
    shown = [
        _row(folder / FOLDER / f"{Path(name).stem}.jpg", f"{Path(name).name}, {rank}: {psnr:.1f} dB")
        for name, rank, psnr in rows
    ]
    words = (
        f"Photo, model, and twice their difference about grey, exposure fitted. Of {count} images, evenly over "
        "the drive, those that the model shows worst: people, furniture and what the layout does not hold stand out."
    )
    return section("Photos beside the model", f"<p>{words}</p>" + "".join(shown))


def _held_out(folder: Path) -> str:
    """What `recon eval --views` found, where it was asked."""
    path = folder / VIEWS / "scores.json"
    if not path.is_file():
        return ""
    content: dict[str, Any] = read_json(path)
    try:
        views = sorted(((float(view["psnr"]), str(view["image"])) for view in content["views"]), reverse=True)
        means = {name: float(content[name]) for name in ("psnr", "ssim", "sharpness", "coverage")}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon eval --views wrote") from None
    words = (
        f"{len(views)} images were left out of the textures and compared with what the model shows from there: "
        f"{means['psnr']:.1f} dB (PSNR), {means['ssim']:.3f} (SSIM), sharpness {means['sharpness']:.2f}, "
        f"{means['coverage']:.0%} of floor and walls covered. Photo, model and difference; white is not compared."
    )
    chosen = dict(
        zip(("best", "middling", "worst"), (views[:1] + views[len(views) // 2 :][:1] + views[-1:]), strict=False)
    )
    shown = [
        _row(folder / VIEWS / f"{Path(name).stem}.jpg", f"{Path(name).name}, {rank}: {psnr:.1f} dB")
        for rank, (psnr, name) in reversed(chosen.items())
    ]
    return section("Images left out", f"<p>{words}</p>" + "".join(shown))


def _row(path: Path, caption: str) -> str:
    """A picture of the result folder, made smaller where it is large; nothing where it is gone."""
    if not path.is_file():
        return ""
    content, picture = path.read_bytes(), cv2.imread(str(path))
    if picture is not None and picture.shape[1] > WIDEST:
        size = (WIDEST, round(WIDEST * picture.shape[0] / picture.shape[1]))
        content = cv2.imencode(".jpg", cv2.resize(picture, size, interpolation=cv2.INTER_AREA))[1].tobytes()
    return figure(data_address(content, "image/jpeg"), caption, "wide")


def _overlays(folder: Path) -> str:
    pictures = sorted((folder / "overlays").glob("*.jpg"))
    figures = [figure(data_address(path.read_bytes(), "image/jpeg"), path.stem) for path in pictures]
    return f'<div class="views">{"".join(figures)}</div>' if figures else ""
