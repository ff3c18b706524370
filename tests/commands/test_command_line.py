"""A command tells the line that runs it: parsed again it is the same command."""

import shlex
from pathlib import Path

import pytest

from care_sim.cli import parsed_command
from care_sim.commands.shared.command_line import command_line


@pytest.mark.parametrize(
    "line",
    [
        "sweep",
        "sweep --seeds 7 7 --scenarios dense --no-floor --out 'my runs/x y' --workers 1",
        "sweep --false-negative-rates 0.1 0.2 --scenario-parameters vehicles=7 gap_m=0.8,1.2",
        "sweep --camera-latency-s 0.12 --firing tiles:4x8 --lidar-dead-rows 3 4 --force",
        "study validate dense --budgets 0.1 --factors mirrored=drawn ego_speed_mps=12.2,12.8",
        "study ablate --source streets --scenes 3 --budgets 0.03",
        "reproduce --also",
        "study ncap --tests CPNCO-50 --step-kph 5 --lidar-stated-range-m 40 --visibility-m 50",
        "protocol --source nuscenes:data --split val --sweeps 2 --camera-detections boxes.json",
        "study realism --tables dense-3 --seeds 2",
    ],
)
def test_the_line_of_a_command_is_the_command(line):
    command = parsed_command(shlex.split(line))[1]
    told = shlex.split(command_line(command))
    assert told[0] == "care-sim"
    assert parsed_command(told[1:])[1] == command
    assert len(told) == 1 + len(shlex.split(line))


@pytest.mark.parametrize(("given", "told"), [("--sweeps 0", ["sweeps"]), ("--no-empty-boxes", [])])
def test_an_option_of_a_source_counts_as_given_if_it_is_a_number(given, told):
    """0 is equal to False, which a switch is that nobody turned on."""
    command = parsed_command(shlex.split(f"protocol --source nuscenes:data {given}"))[1]
    assert command.source_options() == told


def test_a_home_folder_is_expanded_wherever_a_path_begins(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    command = parsed_command(
        ["run", "argoverse2:~/logs", "--picture=~/x.png", "--policy-parameters", "path=~/w.npz"]
    )[1]
    assert f"argoverse2:{tmp_path}/logs" in command_line(command)
    assert command.picture == tmp_path / "x.png"
    assert f"path={tmp_path}/w.npz" in command_line(command)
    assert parsed_command(["study", "crowding", "--out", "a~/b"])[1].out == Path("a~/b")
