"""An installed package whose policies do not behave."""

import re

THIRD_PARTY = """
import os, signal, threading, time
from pathlib import Path
import numpy as np
from care_sim.core.types import Demand
from care_sim.policies.paper.tracks import History

class Dies(History):
    def demand(self, belief):
        os._exit(3)

class KilledOnce(History):
    def demand(self, belief):
        mark = Path(__file__).parent.with_name("killed")
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().demand(belief)

class Raises(History):
    def demand(self, belief):
        raise RuntimeError("no idea," + chr(10) + " at all")

class Odd(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} {two}")

class RaisesOddly(History):
    def demand(self, belief):
        raise Odd("hard to", "unpickle")

class Exits(History):
    def demand(self, belief):
        raise SystemExit(4)

class RaisesInTheBrake(History):
    def demand(self, belief):
        if belief.ego.acceleration < 0:
            raise RuntimeError("not in the brake")
        return super().demand(belief)

class DiesInTheBrake(History):
    def demand(self, belief):
        if belief.ego.acceleration < 0:
            os._exit(3)
        return super().demand(belief)

class Narrow(History):
    def __call__(self, observation):
        return super().__call__(observation)[:1]

class Keeps(History):
    # Fires again what it fired before, by the observation that it kept, and writes into that.
    kept = None

    def reset(self):
        self.kept = None

    def __call__(self, observation):
        kept, self.kept = self.kept, observation
        if kept is None:
            return super().__call__(observation)
        action = (kept["ranges"] > 0) * kept["ranges"] / 100
        kept["ranges"][:] = 1.0
        observation["tracks"][:] = 0.0
        return action

class DrawsInCommon(History):
    # Seeds the one generator that the whole process has.
    def reset(self):
        np.random.seed(5)

    def remember(self, belief):
        self.drawn = np.random.permutation(self.rig.grid.size)

    def demand(self, belief):
        return Demand(layers=[[self.drawn]])

def unpicklable():
    class Own(BaseException):
        pass
    return Own("its own")

class RaisesItsOwn(History):
    def demand(self, belief):
        raise unpicklable()

class Unreadable(BaseException):
    def __str__(self):
        raise Unreadable

class RaisesWithoutText(History):
    def demand(self, belief):
        raise Unreadable

class RaisesAtLength(History):
    def demand(self, belief):
        raise RuntimeError("x" * 1_000_000)

class FailsAtStart(History):
    def __init__(self, rig):
        raise unpicklable()

class StartsThread(History):
    def reset(self):
        print("reset")
        threading.Thread(target=time.sleep, args=[600]).start()

class Forks(History):
    def reset(self):
        print("reset")
        if os.fork() == 0:
            time.sleep(600)
            os._exit(0)
"""
CLASSES = re.findall(r"^class (\w+)\(History\)", THIRD_PARTY, re.M)
ENTRY_POINTS = "[care_sim.policies]\n" + "".join(
    f"{re.sub('(?<!^)(?=[A-Z])', '-', name).lower()} = misbehaving:{name}\n" for name in CLASSES
)
