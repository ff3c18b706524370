"""The entries of the benchmark that a command line names."""

from collections.abc import Callable, Sequence

from care_sim.base.errors import BrokenPolicy, InvalidInput
from care_sim.commands.options.results import Benchmark
from care_sim.commands.shared.selection import playable, policy_parameters
from care_sim.policies import tags_of
from care_sim.study.benchmark.suite import Entry
from care_sim.study.run_config import RunConfig, parameters_for


def entries_of(
    options: Benchmark, tasks: Callable[[Entry], Sequence[RunConfig]]
) -> tuple[list[Entry], list[str]]:
    """Return the entries, and a line for each policy that cannot begin the `tasks`.

    Raises InvalidInput for a --name of several entries or one that no table can hold, and where no
    policy is left.
    """
    given = policy_parameters(options.policy_parameters, options.policy)

    def entry(name: str) -> Entry:
        return Entry(name, parameters_for(name, given), options.cell_order, options.name)

    def tried(name: str) -> Sequence[RunConfig]:
        if {"privileged", "non-causal"} & {*tags_of(name)}:
            raise BrokenPolicy(f"policy {name} knows the truth, and the benchmark plays none")
        return tasks(entry(name))

    policies, left_out = playable(options.policy, tried)
    entries = [entry(name) for name in policies]
    if options.name and len(entries) > 1:
        raise InvalidInput("--name names one entry, and several policies are given")
    for each in entries:
        each.check()
    return entries, left_out
