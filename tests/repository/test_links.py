"""The links at the top of a clone are for people: Python refuses to import them as packages."""

import subprocess
import sys

from tests.helpers.places import ROOT


def test_a_link_is_no_package_and_names_the_package():
    done = subprocess.run(
        [sys.executable, "-c", "import envs.closed_loop"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "ImportError: envs is a link and no package: import care_sim.envs instead"
    )
