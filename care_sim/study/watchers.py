"""The wrappers that the options --record and --export put around an environment."""

from pathlib import Path

from care_sim.policies.base import Policy
from care_sim.study.episode import Environment


def watched(env: Environment, policy: Policy, record: Path | None, export: Path | None) -> Environment:
    """`env`, recorded into the file `record` and its scans written into the folder `export`, if they are given."""
    if record is not None:
        from care_sim.viewer.wrapper import RecordRerun

        env = RecordRerun(env, record, policy)
    if export is not None:
        from care_sim.envs.export_scans import ExportScans

        env = ExportScans(env, export, policy)
    return env
