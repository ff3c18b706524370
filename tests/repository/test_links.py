"""The links at the top of a clone are for people: Python refuses to import them as packages."""

import subprocess
import sys

import pytest

from tests.helpers.places import ROOT


@pytest.mark.parametrize(
    ("line", "package"),
    [
        ("from policies.base import Policy", "policies"),
        ("import envs.closed_loop", "envs"),
        ("from scenarios import SCENARIOS", "scenarios"),
    ],
)
def test_a_link_is_no_package_and_names_the_package(line, package):
    done = subprocess.run(
        [sys.executable, "-c", line], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"ImportError: {package} is a link and no package: import care_sim.{package} instead"
    )
