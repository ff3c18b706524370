"""What made a result: versions, machine, and hashes of the code and the files of its policy."""

from typing import Any

from care_sim.study.benchmark.result import BenchmarkResult
from care_sim.study.benchmark.tasks import Entry
from care_sim.study.provenance import code_digest, machine, policy_digest, versions
from care_sim.study.run_config import files_in


def made_by(entry: Entry) -> dict[str, Any]:
    """What makes the results of an entry here."""
    return {"versions": versions(), **_own_code(entry), "machine": machine()}


def code_of(result: BenchmarkResult) -> str:
    """The hash of CARE-Sim's code that a result names; empty where it names none."""
    told = result.made_by.get("versions")
    return str(told.get("code", "")) if isinstance(told, dict) else ""


def processor_of(result: BenchmarkResult) -> str:
    """The processor that a result names; empty where it names none."""
    told = result.made_by.get("machine")
    return str(told.get("processor", "")) if isinstance(told, dict) else ""


def own_code_of(result: BenchmarkResult) -> str:
    """The hashes of the policy's code and files that a result names, as one text."""
    told = result.made_by
    return f"{told.get('policy_code', '')} {told.get('parameter_files', [])}"


def is_of_this_code(result: BenchmarkResult) -> bool:
    """Whether CARE-Sim and the policy, with its files, are here what made the result."""
    here = _own_code(result.entry)
    return code_of(result) == code_digest() and all(
        result.made_by.get(name) == value for name, value in here.items()
    )


def is_of_this_processor(result: BenchmarkResult) -> bool:
    """Whether a result was made by a processor of the kind that is here."""
    return processor_of(result) == machine()["processor"]


def _own_code(entry: Entry) -> dict[str, Any]:
    """Hashes of the policy's own code, empty for a built-in one, and of the files that its
    parameters name.
    """
    files = files_in(entry.parameters)
    return {
        "policy_code": policy_digest(entry.policy) or "",
        **({"parameter_files": files} if files else {}),
    }
