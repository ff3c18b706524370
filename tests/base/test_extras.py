import re
import sys

import pytest

from care_sim.base import extras
from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_open3d, install_command


def test_a_missing_system_library_names_the_debian_packages(tmp_path, monkeypatch):
    """An open3d that fails as the real one does where libGL is not installed."""
    monkeypatch.delitem(sys.modules, "open3d", raising=False)
    (tmp_path / "open3d.py").write_text(
        "raise ImportError('libGL.so.1: cannot open shared object file')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(
        MissingExtra, match=r"apt-get install libusb-1.0-0 libegl1 .*libGL\.so\.1"
    ) as error:
        import_open3d()
    assert "\n" not in str(error.value)


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    told = f"needs the extra 'open3d': {install_command('open3d')} ("
    with pytest.raises(MissingExtra, match=re.escape(told)):
        import_open3d()


def test_an_installed_wheel_needs_no_clone(tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "_HOME", tmp_path)
    assert install_command("video") == "pip install 'care-sim[video]'"
