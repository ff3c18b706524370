"""The versions of Python and of PyBullet's fork are the same wherever they are named."""

import re
import tomllib

from tests.helpers.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def named_in(file, pattern):
    """The words that the one match of a pattern captures in a file."""
    (found,) = re.findall(pattern, (ROOT / file).read_text())
    return found.split()


def test_the_same_pythons_are_promised_chosen_and_tested():
    versions = ["3.11", "3.12", "3.13"]
    python = "Programming Language :: Python :: 3."
    assert [each[-4:] for each in PROJECT["classifiers"] if each.startswith(python)] == versions
    assert PROJECT["requires-python"] == ">=3.11,<3.14"
    newest = named_in("Makefile", r"PYTHON \?= \$\(call newest,(.*)\)")
    assert newest == [f"python{version}" for version in reversed(versions)]
    assert named_in(".ci/run", "for version in (.*);") == versions[1:]


def test_the_file_of_hashes_pins_the_fork_as_the_constraints_do():
    pin = r"(?m)^(pybullet-arm64==[\d.]+)"
    assert named_in("requirements-pybullet.txt", pin) == named_in("constraints.txt", pin)
