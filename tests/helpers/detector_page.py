"""The files of an owner of nuScenes who types the commands of the page "Your detector"."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import yaml

from tests.helpers.nuscenes_movers import write_movers
from tests.helpers.pcdet_standin import CONFIG
from tests.helpers.places import EXAMPLES, ROOT

PAGE = ROOT / "docs" / "write" / "your-detector.md"


def commands(title):
    """The commands below a title of the page, each in one line."""
    part = re.search(rf"^## {title}\n(.*?)^## ", PAGE.read_text(), re.S | re.M)[1]
    # Blocks of a language are no commands.
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", part, re.S | re.M)
    typed = "".join(text for language, text in blocks if not language)
    return re.sub(r"\\\n\s*", "", typed).splitlines()


def write_belongings(folder, scenes):
    """Data of so many scenes, weights, the adapter, camera boxes, a clone."""
    write_movers(folder, scenes)
    shutil.copy(EXAMPLES / "openpcdet_detector.py", folder)
    (folder / "pcdet").mkdir()
    shutil.copy(ROOT / "tests" / "helpers" / "pcdet_standin.py", folder / "pcdet" / "__init__.py")
    (folder / "net.yaml").write_text(yaml.safe_dump(CONFIG))
    (folder / "net.pth").touch()
    for name in ("Makefile", ".venv-official", "constraints-official.txt"):
        (folder / name).symlink_to(ROOT / name)


def typed(command, folder):
    """The output of a command, typed in a folder. The command must succeed."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command, shell=True, cwd=folder, env=os.environ | {"PATH": path}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout
