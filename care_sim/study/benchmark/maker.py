"""The maker of a result: code, libraries and machine, in its file and here."""

from collections.abc import Mapping
from typing import Any

from care_sim.base.errors import printable
from care_sim.study.benchmark.suite import Entry
from care_sim.study.provenance import code_digest, machine, policy_digest, versions
from care_sim.study.rows.parameters import Parameters
from care_sim.study.run_config import files_in

MadeBy = Mapping[str, Any]


def made_by(entry: Entry, of_detector: Parameters = ()) -> dict[str, Any]:
    """Return what makes the results of an entry here, under a detector with these parameters."""
    files = files_in(of_detector)
    return {
        "versions": versions(),
        **_own_code(entry),
        **({"detector_files": files} if files else {}),
        "machine": machine(),
    }


def detector_files(maker: MadeBy) -> str:
    """Return the hashes of the detector's files that a result names, as one text."""
    return str(maker.get("detector_files", []))


def own_code_of(maker: MadeBy) -> str:
    """Return the hashes of the policy's code and files that a result names, as one text."""
    return f"{maker.get('policy_code', '')} {maker.get('parameter_files', [])}"


def elsewhere(entry: Entry, maker: MadeBy, of_detector: Parameters = ()) -> str:
    """Return in words what made a result of the entry, and an empty text if all of it is here."""
    here = made_by(entry, of_detector)
    if maker == here:
        return ""
    if detector_files(maker) != detector_files(here):
        return "with other files of the detector than here"
    versions_there, there = (maker.get(name) for name in ("versions", "machine"))
    code = versions_there.get("code") if isinstance(versions_there, dict) else ""
    processor = printable(str(there.get("processor", ""))) if isinstance(there, dict) else ""
    is_of_this_code = code == code_digest() and all(
        maker.get(name) == value for name, value in _own_code(entry).items()
    )
    by = "other libraries or another system" if is_of_this_code else "other code"
    on = f", on {processor}" if processor not in ("", machine()["processor"]) else ""
    return f"by {by} than here{on}"


def _own_code(entry: Entry) -> dict[str, Any]:
    """Return hashes of the policy's own code, empty for a built-in one, and of the files that its
    parameters name.
    """
    files = files_in(entry.parameters)
    return {
        "policy_code": policy_digest(entry.policy) or "",
        **({"parameter_files": files} if files else {}),
    }
