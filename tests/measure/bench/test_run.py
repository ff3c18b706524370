import os
import threading
from pathlib import Path

import pytest

from care_sim.measure.bench.run import one_core


@pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="only Linux keeps threads on a core"
)
def test_all_threads_run_on_one_core_and_then_on_all_again():
    allowed, wait, held = os.sched_getaffinity(0), threading.Event(), []

    def work():
        wait.wait()
        held.append(os.sched_getaffinity(0))

    thread = threading.Thread(target=work)
    thread.start()
    with one_core():
        assert len(os.sched_getaffinity(0)) == 1
        wait.set()
        thread.join()
    assert [len(cores) for cores in held] == [1]
    assert os.sched_getaffinity(0) == allowed
