"""What CI runs installs a browser where there is none, and asks nothing."""

import shutil
import subprocess

from tests.helpers.places import ROOT


def test_the_browser_is_installed_without_a_question(tmp_path):
    programs, told = tmp_path / "bin", tmp_path / "told"
    programs.mkdir()
    (programs / "dirname").symlink_to(shutil.which("dirname"))
    for name in ("apt-get", "make"):
        (programs / name).write_text(f'#!/bin/sh\necho "{name} $* $DEBIAN_FRONTEND" >>"{told}"\n')
        (programs / name).chmod(0o755)
    command = [shutil.which("bash"), str(ROOT / ".ci" / "run")]
    done = subprocess.run(
        command, env={"PATH": str(programs)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    update, install, *made = told.read_text().splitlines()
    assert update == "apt-get update -qq noninteractive"
    assert install.startswith("apt-get install")
    assert install.endswith("chromium noninteractive")
    assert [line.split()[1] for line in made] == ["test", "test-speed", "test-official", "lint"]
