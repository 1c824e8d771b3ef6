"""Open3D, imported where it is used (about 3 s), also on machines without its USB library."""

from __future__ import annotations

import ctypes
from types import ModuleType

from recon.errors import MissingLibraryError

DEBIAN_PACKAGES = {
    "libusb-1.0": "libusb-1.0-0", "libGL.so": "libgl1", "libEGL": "libegl1", "libX11": "libx11-6",
    "libidn2": "libidn2-0", "libudev": "libudev1", "libgomp": "libgomp1",
}  # fmt: skip


def load_open3d() -> ModuleType:
    """The module `open3d`; libusb comes from PyPI's `libusb-package` where the system has none.

    Raises MissingLibraryError, naming the package to install, when another system library is missing.
    """
    try:
        ctypes.CDLL("libusb-1.0.so.0", mode=ctypes.RTLD_GLOBAL)
    except OSError:
        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    try:
        import open3d
    except OSError as error:
        missing = str(error).split(":")[0]
        package = next((p for lib, p in DEBIAN_PACKAGES.items() if lib in missing), None)
        remedy = f"apt-get install {package}" if package else "install the system package that holds it"
        raise MissingLibraryError(f"Open3D needs the system library {missing}: {remedy}") from error
    return open3d
