"""Policies of others in processes of their own: the same actions, no way to the environment, and
one line for every failure.
"""

import sys
from contextlib import suppress
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import BrokenPolicy, InvalidInput, MissingExtra
from care_sim.policies import tags_of
from care_sim.policies.isolation import isolated_policies, policy_process
from care_sim.study.provenance import policy_digest
from tests.helpers.descendants import until

POLICIES = [
    "care_sim.policies.paper.reserves:Care",
    "care_sim.policies.controls.rehearsed:HistoryLearnedPlace",
]
"""The first uses the camera, and the second is told a scenario."""
SPY = """
import gc, inspect, os, sys, threading, time
import gymnasium
import numpy as np
import care_sim

class Spy(care_sim.Policy):
    def demand(self, belief):
        print("spying")
        # Cell 7 says that nothing was found.
        seen = [*gc.get_objects(), *(v for f in inspect.stack() for v in f.frame.f_locals.values())]
        found = any(isinstance(each, gymnasium.Env) for each in seen)
        return care_sim.Demand(layers=[[np.array([3 if found else 7])]])

class Raises(Spy):
    def demand(self, belief):
        raise RuntimeError("no idea")

class ForksAndExits(Spy):
    def demand(self, belief):
        if os.fork() == 0:
            time.sleep(600)
        os._exit(3)

class Lingers(Spy):
    def reset(self):
        threading.Thread(target=time.sleep, args=[600]).start()
        if os.fork() == 0:
            time.sleep(600)

class Narrow(Spy):
    def __call__(self, observation):
        return super().__call__(observation)[:1]

class Lacks(Spy):
    def __init__(self, rig):
        raise care_sim.base.errors.MissingExtra("give it wings")

class Refuses(Spy):
    def __init__(self, rig, wings=2):
        raise care_sim.InvalidInput("wings must be 3")

class Babbles(Spy):
    def __init__(self, rig, answer=""):
        from care_sim.policies import isolation
        isolation._answer = lambda request: answer.encode()

class Privileged(care_sim.PrivilegedPolicy, Spy):
    tags = ("privileged",)
"""


@pytest.fixture
def env():
    with gymnasium.make("CARE-Dense-v0", budget=0.05) as made:
        yield made


@pytest.fixture
def spy(tmp_path, monkeypatch):
    """A module with policies that do not behave, which this process does not load by itself."""
    (tmp_path / "spy.py").write_text(SPY)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("spy", None)


def actions(name, env, keyframes=12):
    """The actions of a policy, and the exploitation that it demanded."""
    policy = care_sim.make_policy(name, env)
    observation, _ = env.reset(seed=3)
    policy.reset()
    asked = []
    for _ in range(keyframes):
        asked.append(np.array(policy(observation)))
        observation, *_ = env.step(asked[-1])
    return asked, [cells.tolist() for cells in policy.demanded.exploitation]


@pytest.mark.parametrize("name", POLICIES)
def test_actions_are_the_same_to_the_last_bit(name, env):
    here, demanded = actions(name, env)
    with isolated_policies():
        apart, demanded_apart = actions(name, env)
        assert policy_digest(name) == policy_digest(name)
    assert [each.tobytes() for each in apart] == [each.tobytes() for each in here]
    assert {each.dtype for each in apart} == {each.dtype for each in here}
    assert demanded_apart == demanded


def test_neither_frames_nor_memory_lead_to_the_environment(env, spy, capfd):
    observation, _ = env.reset(seed=0)
    with isolated_policies():
        assert tags_of("spy:Spy") == ("causal",)
        apart = care_sim.make_policy("spy:Spy", env)(observation)
        digest = policy_digest("spy:Spy")
        assert "spy" not in sys.modules
    assert capfd.readouterr().out == "spying\n"
    here = care_sim.make_policy("spy:Spy", env)(observation)
    assert (np.flatnonzero(here), np.flatnonzero(apart)) == ([3], [7])
    assert policy_digest("spy:Spy") == digest


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("Raises", r"^RuntimeError: no idea \(spy.py, line 17\)$"),
        ("ForksAndExits", r"^the process of policy spy:ForksAndExits died$"),
        ("Narrow", r"^action must have shape \(32, 512\) \(rows, columns\), got \(1, 512\)$"),
    ],
)
def test_a_failure_is_one_line_and_the_next_object_plays(env, spy, name, line):
    observation, _ = env.reset(seed=0)
    with isolated_policies():
        for _ in range(2):
            policy = care_sim.make_policy(f"spy:{name}", env)
            policy.reset()
            with pytest.raises(InvalidInput, match=line):
                env.step(policy(observation))


def test_a_policy_that_cannot_be_made_is_named(env, spy):
    with isolated_policies():
        for name, kind, line, given in (
            ("Lacks", MissingExtra, "^give it wings$", {}),
            ("Refuses", InvalidInput, "^wings must be 3$", {}),
            (
                "Refuses",
                InvalidInput,
                "unknown parameter of policy spy:Refuses 'legs'",
                {"legs": 1},
            ),
            ("Privileged", BrokenPolicy, "^policy spy:Privileged needs the truth", {}),
        ):
            with pytest.raises(kind, match=line):
                care_sim.make_policy(f"spy:{name}", env, **given)


def test_its_process_ends_with_what_the_policy_has_started(env, spy):
    observation, _ = env.reset(seed=0)
    with isolated_policies():
        policy = care_sim.make_policy("spy:Lingers", env)
        policy.reset()
        policy(observation)
        group = policy_process("spy:Lingers")._process.pid
        assert len(members(group)) == 2
    assert until(lambda: not members(group), 5)


def members(group):
    """The running processes of a group."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, of, *_ = stat.read_text().rpartition(")")[2].split()
            found += [stat.parent.name] * (int(of) == group and state not in "ZX")
    return found


@pytest.mark.parametrize("answer", ["-1", "-[1, 2, 3]", "+null"])
def test_an_answer_of_another_form_is_one_line(answer, env, spy):
    with isolated_policies():
        care_sim.make_policy("spy:Babbles", env, answer=answer)
        with pytest.raises(InvalidInput, match="policy spy:Babbles answers with no action: "):
            care_sim.make_policy("spy:Babbles", env)
