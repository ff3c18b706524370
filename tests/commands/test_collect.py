import numpy as np
import pytest

from care_sim.base.seeds import training_seeds
from tests.helpers.commands import run

minari = pytest.importorskip("minari")
DATASET = "care-sim/dense/care-v0"
SHORT = ("--scenario-parameters", "duration_s=0.5", "gap_m=0.8,1.2")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    return tmp_path / "datasets"


def collect(capsys, *options, dataset=DATASET):
    """Exit code, output and error lines of the command."""
    line = ["export", "minari", "dense", "--dataset", dataset, "--episodes", 2, *SHORT]
    return run(capsys, *line, *options)


@pytest.mark.parametrize(("policy", "budget"), [("care", 0.03), ("full", 1.0)])
def test_minari_reads_what_the_same_actions_give_again_in_the_recovered_environment(
    capsys, policy, budget
):
    code, out, err = collect(capsys, "--policy", policy, "--budget", "0.03")
    assert (code, err) == (0, "")
    dataset = minari.load_dataset(DATASET)
    assert out.startswith(f"{dataset.total_episodes} episodes, {dataset.total_steps} steps, ")
    with dataset.recover_environment() as env:
        assert env.unwrapped.rig.budget == round(budget * 512 * 32)
        assert dataset.action_space == env.action_space
        assert dataset.observation_space == env.observation_space
        metadata = [*dataset.storage.get_episode_metadata(range(2))]
        assert [one["seed"] for one in metadata] == [*training_seeds(2)]
        for episode, one in zip(dataset.iterate_episodes(), metadata, strict=True):
            replayed = [(env.reset(seed=one["seed"])[0], 0.0, False, False)]
            replayed += [env.step(action)[:4] for action in episode.actions]
            observations, *told = zip(*replayed, strict=True)
            for key, stored in episode.observations.items():
                np.testing.assert_array_equal(stored, [each[key] for each in observations])
            for kept, again in zip(
                (episode.rewards, episode.terminations, episode.truncations), told, strict=True
            ):
                np.testing.assert_array_equal(kept, again[1:])
            assert episode.terminations[-1] or episode.truncations[-1]


@pytest.mark.parametrize(
    ("dataset", "options", "line"),
    [
        ("care-sim/dense/care", (), "must be NAMESPACE/NAME-vNUMBER"),
        ("c/care-v0", (), "the namespace of at least two characters"),
    ],
)
def test_what_cannot_be_collected_is_refused_before_anything_is_written(
    capsys, folder, dataset, options, line
):
    code, out, err = collect(capsys, *options, dataset=dataset)
    assert (code, out) == (2, "")
    assert line in err
    assert err.count("\n") == 1
    assert not [*folder.rglob("*.json")]


def test_a_dataset_is_not_written_over(capsys):
    assert collect(capsys)[0] == 0
    code, _, err = collect(capsys)
    assert code == 2
    assert "is there already" in err
    assert minari.load_dataset(DATASET).total_episodes == 2


BROKEN = """
import care_sim

class Broken(care_sim.Policy):
    def demand(self, belief):
        Broken.keyframes += 1
        if Broken.keyframes > 7:
            raise ValueError("in the second episode")
        return care_sim.Demand()

    keyframes = 0
"""


def test_a_policy_that_breaks_leaves_no_part_of_a_dataset(capsys, folder, tmp_path, monkeypatch):
    (tmp_path / "breaks_late.py").write_text(BROKEN)
    monkeypatch.chdir(tmp_path)
    code, _, err = collect(capsys, "--policy", "breaks_late:Broken")
    assert code == 1
    assert "in the second episode" in err
    assert not [*folder.rglob("*.parquet")]
    with pytest.raises(FileNotFoundError):
        minari.load_dataset(DATASET)
