"""The README's Python runs as it stands, and its commands exist."""

import pathlib
import re
import subprocess
import sys

import pytest

README = (pathlib.Path(__file__).parents[1] / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.S)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_a_block_runs_on_its_own(number):
    done = subprocess.run([sys.executable, "-c", BLOCKS[number]], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_the_policy_has_twenty_lines_at_most():
    (policy,) = (block for block in BLOCKS if "class Corridor" in block)
    body = policy[policy.index("class Corridor") : policy.index("env = ")]
    assert len([line for line in body.splitlines() if line.strip()]) <= 20


@pytest.mark.parametrize("page", ["README.md", "results/README.md"])
def test_links_lead_somewhere(page):
    here = pathlib.Path(__file__).parents[1] / page
    targets = re.findall(r"\]\((?!http)([^)#]+)", here.read_text())
    assert targets
    for target in targets:
        assert (here.parent / target).exists(), target
