"""Images held for a while."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock

from recon.texture.view import Image


class ImageCache:
    """The images asked for last, as many as fit. `load(i)` may be called from several threads."""

    def __init__(self, load: Callable[[int], Image | None], limit: int) -> None:
        """limit: bytes held; the last image is held whatever its size."""
        self._load, self._limit, self._lock = load, limit, Lock()
        self._held: OrderedDict[int, Image | None] = OrderedDict()
        self._bytes = 0

    def __call__(self, index: int) -> Image | None:
        """Image `index`, None where `load` gives none."""
        with self._lock:
            if index in self._held:
                self._held.move_to_end(index)
                return self._held[index]
        image = self._load(index)
        with self._lock:
            if index not in self._held:
                self._held[index] = image
                self._bytes += 0 if image is None else image.nbytes
            while self._bytes > self._limit and len(self._held) > 1:
                _, old = self._held.popitem(last=False)
                self._bytes -= 0 if old is None else old.nbytes
        return image
