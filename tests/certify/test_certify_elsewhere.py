"""The certificate as a processor of fewer features plays it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from care_sim.certify import published
from care_sim.certify.design import STREET, drawn
from care_sim.certify.playing import play_alone, write_drive
from care_sim.certify.trail import first_difference
from tests.helpers.places import ROOT
from tests.helpers.processor_features import reduced

NUMBERS = [n for n in range(150) if drawn(n).environment != STREET and drawn(n).keyframes <= 16][
    :60
]
ALIKE = 0.95
"""The share of episodes that nothing of a processor changes, at the least: a last bit still decides
where the edge of a picture lies on a border between columns, and Bullet's rays against round bodies
differ by more than last bits."""


def played(folder):
    source = write_drive(Path(folder))
    return {n: play_alone(drawn(n), source) for n in NUMBERS}


@pytest.mark.slow
def test_a_processor_of_fewer_features_plays_most_episodes_as_published(tmp_path, pytestconfig):
    """`test_certify.py` tests for 28 of them that this processor plays them as published; `care-sim
    certify` plays every episode of the list.
    """
    line = (
        "import json; from tests.certify import test_certify_elsewhere as t; "
        f"trails = t.played({str(tmp_path / 'there')!r}); "
        "print(json.dumps({n: trail.hex() for n, trail in trails.items()}))"
    )
    child = subprocess.run(
        [sys.executable, "-c", line],
        cwd=ROOT,
        # Its compiled code is kept from run to run, apart from that of this processor: of two
        # processes that add code of two processors to one folder, one may overwrite the other's.
        env=reduced(pytestconfig.cache.mkdir("compiled-elsewhere")),
        capture_output=True,
        text=True,
        check=True,
    )
    theirs = {
        int(n): bytes.fromhex(trail)
        for n, trail in json.loads(child.stdout.splitlines()[-1]).items()
    }
    known = published.read()
    apart = {
        n: (drawn(n).text, *first_difference(known[n], theirs[n]))
        for n in NUMBERS
        if known[n] != theirs[n]
    }
    assert len(apart) <= (1 - ALIKE) * len(NUMBERS), apart
