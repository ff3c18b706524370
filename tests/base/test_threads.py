"""Threads that work at the same time."""

import pickle
import signal
import threading
import time

import numpy as np
import pytest

from care_sim.base.threads import Threads

WORLDS = np.arange(13) % 5 != 0


@pytest.fixture
def threads():
    made = Threads(2)
    yield made
    made.close()


def is_here():
    return threading.current_thread() is threading.main_thread()


@pytest.mark.parametrize("count", [1, 2, 3, 40])
@pytest.mark.parametrize("live", [WORLDS, ~WORLDS, WORLDS & False])
def test_every_live_world_is_worked_on_once(count, live):
    threads, done = Threads(count), np.zeros((2, len(live)), int)

    def works(part, *rows):
        for row in rows:
            row += part

    for copy in (threads, pickle.loads(pickle.dumps(threads)), threads):
        copy.share(works, live, *done)
        copy.close()
    assert (done == 3 * live).all()


def test_threads_work_at_the_same_time(threads):
    both = threading.Barrier(2)
    threads.share(lambda _part: both.wait(10), WORLDS)


@pytest.mark.parametrize("fails_here", [True, False])
def test_all_are_waited_for_when_one_fails(threads, fails_here):
    done = []

    def works(_part):
        if is_here() == fails_here:
            raise MemoryError
        time.sleep(0.1)
        done.append(True)

    with pytest.raises(MemoryError):
        threads.share(works, WORLDS)
    assert done


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("worlds", [WORLDS, np.arange(13) == 4])
def test_what_an_interrupt_left_at_work_is_waited_for_before_more_is_begun(threads, worlds):
    done, seen = [], []

    def works(_part):
        if not is_here():
            time.sleep(0.1)
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
            time.sleep(0.3)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        threads.share(works, WORLDS)
    assert not done
    threads.share(lambda _part: seen.append(bool(done)), worlds)
    assert seen == [True] * min(2, worlds.sum())
