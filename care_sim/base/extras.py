"""Libraries of others: optional ones, imported where they are used, with one line that names the
extra where one is missing; and silence for those that print from C.
"""

import ctypes
import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from types import ModuleType

from care_sim.base.errors import MissingExtra

OPEN3D_PACKAGES = "libusb-1.0-0 libegl1 libgl1 libx11-6 libudev1 libidn2-0"
"""Debian packages with the system libraries that Open3D loads."""
_HOME = Path(__file__).parents[2]
"""The clone, or the folder of all installed packages."""
STANDARD_ERROR = 2


def missing_extra(what: str, extra: str, error: ImportError | None = None) -> MissingExtra:
    """The error for what a user knows as `what` and an `extra` would bring."""
    told = f"{what} needs the extra '{extra}': {install_command(extra)}"
    return MissingExtra(f"{told} ({error})" if error else told)


def install_command(extra: str) -> str:
    """The documented command that brings an extra: in a clone, or to an installed wheel, whose
    metadata tell pip what the extra needs.
    """
    if (_HOME / "constraints.txt").is_file():
        return f"pip install -c constraints.txt -e '.[{extra}]' in the clone"
    return f"pip install 'care-sim[{extra}]'"


@contextmanager
def package_alone(name: str) -> Iterator[None]:
    """Import modules of a package within, without what the package itself imports.

    A later import of the package runs all of it and keeps these modules. `from` finds them there;
    the package has no attributes of their names.
    """
    spec = None if name in sys.modules else find_spec(name)
    if spec is None:
        yield
        return
    sys.modules[name] = module_from_spec(spec)
    try:
        yield
    finally:
        del sys.modules[name]


def import_open3d() -> ModuleType:
    """Open3D. Raises MissingExtra with the extra, or the Debian packages, to install."""
    _load_libusb()
    try:
        import open3d
    except ModuleNotFoundError as error:
        raise missing_extra("Open3D", "open3d", error) from error
    except (ImportError, OSError) as error:
        raise MissingExtra(
            f"Open3D lacks a system library: apt-get install {OPEN3D_PACKAGES} ({error})"
        ) from error
    module: ModuleType = open3d
    return module


def import_torch() -> ModuleType:
    """PyTorch. Raises MissingExtra with the extra to install."""
    return import_extra("torch", "PyTorch", "rl")


def import_rerun() -> ModuleType:
    """Rerun. Raises MissingExtra with the extra to install."""
    return import_extra("rerun", "Rerun", "viewer")


def import_extra(module: str, name: str, extra: str) -> ModuleType:
    """A module, which a user knows as `name`. Raises MissingExtra with the `extra` to install."""
    try:
        return import_module(module)
    except ImportError as error:
        raise missing_extra(name, extra, error) from error


def _load_libusb() -> None:
    """Give Open3D the libusb of the wheel `libusb-package`, for systems without their own."""
    # A library that is loaded already is the one that others get who need one of its name.
    try:
        import libusb_package
    except ImportError:
        return
    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


@contextmanager
def silence_output(descriptor: int) -> Iterator[None]:
    """Nothing that is written to a file descriptor comes through while this lasts."""
    # C keeps a buffer of its own. Flush earlier text while the descriptor still leads out, and text
    # printed meanwhile before the descriptor leads out again.
    c_library = ctypes.CDLL(None)
    c_library.fflush(None)
    try:
        kept = os.dup(descriptor)
    except OSError as error:
        if error.errno != errno.EBADF:
            raise
        # The process was started without this descriptor, so that nothing comes through anyway.
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    try:
        yield
    finally:
        c_library.fflush(None)
        os.dup2(kept, descriptor)
        os.close(kept)
        os.close(nowhere)
