"""Images, read when asked for: memory does not grow with their number."""

from __future__ import annotations

import io
import logging
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path, PurePath

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.sequence.camera import Camera
from recon.sequence.sequence import ImageList
from recon.sequence.table import check_increasing, content_lines

Image = NDArray[np.uint8]

log = logging.getLogger(__name__)


def read_image_list(path: Path) -> ImageList:
    """images.txt: `timestamp path`, one image a line, paths relative to its folder.

    Raises InputError for a missing or damaged list, no image at all, time stamps that do not increase, a path that is
    absolute or leads out of the folder, and an image that is not there.
    """
    folder, stamps, paths, names = path.parent, [], [], []
    for number, text in content_lines(path):
        stamp, _, name = text.partition(" ") if " " in text else text.partition("\t")
        name = name.strip()
        try:
            stamps.append(float(stamp))
        except ValueError:
            raise InputError(f"{path}:{number}: {text[:60]!r}, expected a time stamp and a path") from None
        if not name:
            raise InputError(f"{path}:{number}: {text[:60]!r} names no image, expected a time stamp and a path")
        if _leads_out(name):
            raise InputError(f"{path}:{number}: image {name!r} is outside the sequence folder")
        if not (folder / name).is_file():
            raise InputError(f"{path}:{number}: image {name} is missing")
        paths.append((folder / name).absolute())
        names.append(name)
    if not names:
        raise InputError(f"{path}: lists no image (remove images.txt and camera.yaml to use the LiDAR only)")
    check_increasing(path, stamps, "image")
    return ImageList(np.array(stamps), tuple(paths), tuple(names))


def _leads_out(name: str) -> bool:
    """Whether a relative path steps out of its folder on the way (links inside the folder are the user's own)."""
    depth = 0
    for part in PurePath(name).parts:
        depth += {"..": -1, ".": 0}.get(part, 1)
        if depth < 0:
            return True
    return PurePath(name).is_absolute()


def check_image_sizes(images: ImageList, camera: Camera) -> None:
    """Looks at every image's header. Raises InputError for a size other than camera.yaml's, or if none is readable."""
    from PIL import Image as PillowImage

    readable = 0
    for path in images.paths:
        try:
            with PillowImage.open(path) as image:
                size = image.size
        except (OSError, ValueError, SyntaxError, PillowImage.DecompressionBombError):
            continue
        readable += 1
        _check_size(path, size[0], size[1], camera)
    if readable == 0:
        raise InputError(f"{images.paths[0].parent}: none of {len(images)} images can be read, expected JPEG or PNG")


def load_image(
    images: ImageList, index: int, camera: Camera, grey: bool = False, warnings: list[str] | None = None
) -> Image | None:
    """Image `index` as uint8 BGR (H, W, 3), or (H, W) with `grey`; None when it is corrupt.

    A corrupt or truncated image adds one line to `warnings` (the log when None is given), not twice the same. Raises
    InputError for an image that is gone or has another size than camera.yaml says.
    """
    path = images.place(index)
    try:
        data = images.read(index)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    image, reason = _decode(data, grey) if isinstance(data, bytes) else (_converted(data, grey), "")
    if image is None:
        message = f"{images.names[index]}: skipped, the image is corrupt ({reason})"
        if warnings is None:
            log.warning("%s", message)
        elif message not in warnings:
            warnings.append(message)
        return None
    _check_size(path, image.shape[1], image.shape[0], camera)
    return image


def iterate_images(
    images: ImageList,
    camera: Camera,
    grey: bool = False,
    warnings: list[str] | None = None,
    indices: Sequence[int] | None = None,
    ahead: int = 2,
) -> Iterator[tuple[int, Image | None]]:
    """(index, image) in order, the next `ahead` images being decoded by one worker thread meanwhile; as `load_image`.

    `indices`: only these, in this order.
    """
    wanted = iter(range(len(images)) if indices is None else indices)
    pending: deque[tuple[int, Future[Image | None]]] = deque()
    with ThreadPoolExecutor(max_workers=1) as worker:
        try:
            for index in wanted:
                pending.append((index, worker.submit(load_image, images, index, camera, grey, warnings)))
                if len(pending) > ahead:
                    ready, future = pending.popleft()
                    yield ready, future.result()
            while pending:
                ready, future = pending.popleft()
                yield ready, future.result()
        finally:
            for _, future in pending:
                future.cancel()


def _decode(data: bytes, grey: bool) -> tuple[Image | None, str]:
    """The picture, or None and why not. Silent, unlike cv2.imdecode, and strict: half a picture is none."""
    if data[:2] == b"\xff\xd8":
        return _decode_jpeg(data, grey)
    from PIL import Image as PillowImage

    try:
        with PillowImage.open(io.BytesIO(data)) as image:
            if image.mode.startswith("I"):  # 16 bits a pixel
                pixels = (np.asarray(image).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8)
            else:
                pixels = np.asarray(image.convert("RGB"))[:, :, ::-1]
    except (OSError, ValueError, SyntaxError, PillowImage.DecompressionBombError) as error:
        return None, str(error).split(" <")[0] or "damaged"
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    picture = np.ascontiguousarray(pixels)
    return (np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8) if grey else picture), ""


def _converted(pixels: Image, grey: bool) -> Image:
    """Pixels, BGR or grey, as BGR, or grey."""
    if (pixels.ndim == 2) == grey:
        return pixels
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY if grey else cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def _decode_jpeg(data: bytes, grey: bool) -> tuple[Image | None, str]:
    import simplejpeg

    space = "Gray" if grey else "BGR"
    try:
        image = simplejpeg.decode_jpeg(data, space, strict=True)
    except ValueError as error:
        if "extraneous bytes" not in str(error):  # padding between frames of cheap cameras: the picture is whole
            return None, str(error)
        image = simplejpeg.decode_jpeg(data, space, strict=False)
    return (image[:, :, 0] if grey else image), ""


def _check_size(path: Path, width: int, height: int, camera: Camera) -> None:
    if (width, height) != (camera.width, camera.height):
        raise InputError(f"{path}: is {width} x {height} pixels, camera.yaml says {camera.width} x {camera.height}")
