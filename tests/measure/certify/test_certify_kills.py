"""A certificate that is killed: no process of any mode is left."""

import os
import signal
import sys

import pytest

from tests.helpers.descendants import Marked, until

PLAY = """
import sys
from care_sim.measure.certify import design, playing
from care_sim.measure.certify.design import drawn

mode = sys.argv[1]
chosen = [n for n in range(1000) if drawn(n).mode == mode and drawn(n).environment in design.CLOSED]
playing.trails_of(chosen, 1)
"""
OTHERS = {"async": 4, "subprocess": 4, "hash-seed": 1}
"""Processes of a mode beside the command, the fork server, its resource tracker and the worker."""
THOSE = 4


@pytest.mark.parametrize("mode", OTHERS)
def test_a_certificate_that_is_killed_leaves_no_process(mode):
    with Marked([sys.executable, "-c", PLAY, mode]) as started:
        assert until(lambda: len(started.alive()) >= THOSE + OTHERS[mode], 60), started.alive()
        os.kill(started.process.pid, signal.SIGKILL)
        assert started.all_end_within(30)
