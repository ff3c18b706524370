"""What made a result: versions, machine, and hashes of the code and the files of its policy."""

from typing import Any

from care_sim.base.errors import printable
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
    """The processor that a result names, on one line; empty where it names none."""
    told = result.made_by.get("machine")
    named = told.get("processor") if isinstance(told, dict) else None
    return printable(named) if isinstance(named, str) else ""


def is_made_alike(result: BenchmarkResult) -> bool:
    """Whether all that a result names as its maker is here: code, policy, libraries and machine."""
    return result.made_by == made_by(result.entry)


def elsewhere(result: BenchmarkResult) -> str:
    """What made a result where that is not what is here, in words; empty where all is."""
    if is_made_alike(result):
        return ""
    by = "other libraries or another system" if is_of_this_code(result) else "other code"
    on = processor_of(result)
    return f"by {by} than here{f', on {on}' if on and on != machine()['processor'] else ''}"


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


def _own_code(entry: Entry) -> dict[str, Any]:
    """Hashes of the policy's own code, empty for a built-in one, and of the files that its
    parameters name.
    """
    files = files_in(entry.parameters)
    return {
        "policy_code": policy_digest(entry.policy) or "",
        **({"parameter_files": files} if files else {}),
    }
