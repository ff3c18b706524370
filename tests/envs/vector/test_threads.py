"""Threads that work at the same time."""

import signal
import threading
import time

import pytest

from care_sim.envs.vector.env import Threads


@pytest.fixture
def interruptible():
    """Interrupts raise, also where whoever started the tests made them deaf."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def threads():
    made = Threads(3)
    yield made
    made.close()


def test_all_are_waited_for_when_one_fails(threads):
    done = []

    def works():
        time.sleep(0.1)
        done.append(True)

    def fails():
        raise MemoryError

    for tasks in ([fails, works, works], [works, fails, works]):
        done.clear()
        with pytest.raises(MemoryError):
            threads.all(tasks)
        assert len(done) == 2


@pytest.mark.usefixtures("interruptible")
def test_what_an_interrupt_left_at_work_is_waited_for_before_more_is_begun(threads):
    done = []

    def works():
        time.sleep(0.1)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        time.sleep(0.3)
        done.append(True)

    def nothing():
        pass

    with pytest.raises(KeyboardInterrupt):
        threads.all([nothing, works, nothing])
    assert not done
    assert threads.all([nothing, nothing, lambda: bool(done)])[2]
