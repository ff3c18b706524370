"""Optional dependencies, imported where they are used; a missing one is named in one line."""

import ctypes
from types import ModuleType

from care_sim.errors import MissingExtra

OPEN3D_PACKAGES = "libusb-1.0-0 libegl1 libgl1 libx11-6 libudev1 libidn2-0"
"""Debian packages with the system libraries that Open3D loads."""


def import_open3d() -> ModuleType:
    """Open3D. Raises MissingExtra with the extra, or the Debian packages, to install."""
    _load_libusb()
    try:
        import open3d
    except ModuleNotFoundError as error:
        raise MissingExtra(f"Open3D needs the extra 'open3d': pip install 'care-sim[open3d]' ({error})") from error
    except (ImportError, OSError) as error:
        raise MissingExtra(f"Open3D lacks a system library: apt-get install {OPEN3D_PACKAGES} ({error})") from error
    module: ModuleType = open3d
    return module


def import_torch() -> ModuleType:
    """PyTorch. Raises MissingExtra with the extra to install."""
    try:
        import torch
    except ImportError as error:
        raise MissingExtra(f"PyTorch needs the extra 'rl': pip install 'care-sim[rl]' ({error})") from error
    return torch


def import_mujoco() -> ModuleType:
    """MuJoCo. Raises MissingExtra with the extra to install."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingExtra(f"MuJoCo needs the extra 'bench': pip install 'care-sim[bench]' ({error})") from error
    module: ModuleType = mujoco
    return module


def import_panda_gym() -> ModuleType:
    """panda-gym, which registers its environments. Raises MissingExtra with the extra to install."""
    try:
        import panda_gym
    except ImportError as error:
        raise MissingExtra(f"panda-gym needs the extra 'bench': pip install 'care-sim[bench]' ({error})") from error
    module: ModuleType = panda_gym
    return module


def _load_libusb() -> None:
    """Give Open3D the libusb of the wheel `libusb-package`, for systems without their own."""
    try:
        import libusb_package
    except ImportError:
        return
    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
