"""An installed package whose policies do not behave."""

THIRD_PARTY = """
import os, signal
from pathlib import Path
from care_sim.policies.paper.history import History

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
"""
ENTRY_POINTS = """
[care_sim.policies]
dies = misbehaving:Dies
killed-once = misbehaving:KilledOnce
raises = misbehaving:Raises
raises-oddly = misbehaving:RaisesOddly
exits = misbehaving:Exits
"""
