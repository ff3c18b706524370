"""A certificate that is killed: no process is left."""

import os
import signal
import sys

from tests.helpers.descendants import Marked, until

PLAY = """
from care_sim.certify import design, playing
from care_sim.certify.design import drawn

chosen = [n for n in range(1000) if drawn(n).environment in design.CLOSED]
playing.trails_of(chosen, 2)
"""
PROCESSES = 5
"""The command, the fork server, its resource tracker and two workers."""


def test_a_certificate_that_is_killed_leaves_no_process():
    with Marked([sys.executable, "-c", PLAY]) as started:
        assert until(lambda: len(started.alive()) >= PROCESSES, 60), started.alive()
        os.kill(started.process.pid, signal.SIGKILL)
        assert started.all_end_within(30)
