"""`care-sim train ppo`, `sac` and `recurrent-ppo`, and `curves` of what they learned."""

import shlex
from collections.abc import Iterator
from dataclasses import fields

from care_sim.base.errors import InvalidInput, print_lines
from care_sim.base.files import describe_output
from care_sim.commands.options.learning import Curves, Learner
from care_sim.commands.shared.agent_play import AgentPlay
from care_sim.commands.shared.console import TableConsole
from care_sim.training.agents import Agent
from care_sim.training.config import AgentConfig
from care_sim.training.folder import (
    CHECKPOINT,
    CURVE,
    EPISODES,
    WEIGHTS,
    read_table,
    rule_scores,
)
from care_sim.training.hyperparameters import read_hyperparameters
from care_sim.training.run import train_agent

CHANCE = "random"
"""The rule that whoever has learned something is better than."""


def train(options: Learner) -> int:
    """Train an agent."""
    table = read_hyperparameters(options.kind, options.env, options.hyperparameters, options.drawn)
    config = options.kind(**{one.name: getattr(options, one.name) for one in fields(options.kind)})
    print_lines(table.told(config))
    train_agent(config)
    print_lines(*end_of_training(config))
    return 0


def end_of_training(config: AgentConfig) -> Iterator[str]:
    """The lines that end the training of a configuration, from what its folder holds."""
    out = config.out
    # The earliest of equals, whose weights are those that were kept.
    kept = max(read_table(out / CURVE), key=lambda row: row["return"])
    best, rules = kept["return"], rule_scores(read_table(out / EPISODES))
    beside = ", ".join(f"{name} {score.mean_return:.2f}" for name, score in rules.items())
    yield (
        f"best after {kept['steps']} steps: return {best:.2f} on {config.episodes} validation "
        f"episodes; {beside}"
    )
    if CHANCE in rules and best <= rules[CHANCE].mean_return:
        yield f"not better than {CHANCE}: nothing was learned yet"
    # Only the network of `ppo` has a twin outside of PyTorch.
    if not (out / WEIGHTS).exists():
        yield f"kept: the learner of the last step, {out / CHECKPOINT}; --resume goes on with it"
        return
    yield f"kept: the weights of that step, {out / WEIGHTS}"
    yield f"play it: {shlex.join(['care-sim', 'run', str(out)])}"
    yield f"beside care: {AgentPlay(Agent.of_run(config, out / WEIGHTS)).study_line()}"


def curves(options: Curves) -> int:
    """Draw learning curves, and print their table."""
    # Imported here because training draws nothing.
    from care_sim.reports.figures.styles import check_figure, save, stem_of
    from care_sim.training.curves import curves_table, grouped_runs, read_run
    from care_sim.training.curves_figure import curves_figure

    if not options.folders:
        raise InvalidInput(
            "curves needs the folder of a training run, the --out of `care-sim train`"
        )
    groups = grouped_runs(map(read_run, options.folders))
    stem = stem_of(options.out)
    check_figure(stem)
    told = describe_output(stem.with_name(f"{stem.name}.png"))
    save(curves_figure(groups), stem)
    TableConsole().print(curves_table(groups).rich())
    print_lines(f"Figure: {told}")
    return 0
