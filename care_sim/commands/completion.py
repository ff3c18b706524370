"""`care-sim completion`: a script by which a shell completes commands and options."""

from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from care_sim.commands.entries import COMMANDS
from care_sim.commands.shared.parsing import option_helps

_BASH = """_care_sim() {{
    local words=""
    case "$COMP_CWORD:${{COMP_WORDS[1]}} ${{COMP_WORDS[2]}} " in
        1:*) words="{commands}" ;;
{cases}
    esac
    COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _care_sim care-sim"""
_ZSH = "autoload -U +X compinit bashcompinit && compinit && bashcompinit\n"


@dataclass(frozen=True)
class Completion:
    """Print what completes commands and options in a shell.

    `docs/install.md` says where each shell looks for it. Values of options complete as names of
    files.
    """

    shell: Annotated[Literal["bash", "zsh", "fish"], tyro.conf.Positional]
    """Shell to print it for."""

    def __call__(self) -> int:
        """Print it."""
        print(_fish() if self.shell == "fish" else _ZSH * (self.shell == "zsh") + _bash())
        return 0


def _words() -> dict[str, list[str]]:
    """Return the words after each command: its options, or the commands below it with theirs."""
    words = {}
    for name, entry in COMMANDS.items():
        loaded = entry.loaded()
        below = loaded if isinstance(loaded, dict) else {}
        for learner, command in below.items():
            words[f"{name} {learner}"] = [*option_helps(command)]
        words[name] = [*below] or [*option_helps(loaded)]
    return words


def _bash() -> str:
    cases = "\n".join(
        f'        *:"{name} "*) words="{" ".join(after)}" ;;' for name, after in _words().items()
    )
    return _BASH.format(commands=" ".join(COMMANDS), cases=cases)


def _fish() -> str:
    lines = ["complete -c care-sim -n __fish_use_subcommand -f"]
    for name, after in _words().items():
        first, _, learner = name.partition(" ")
        if not learner:
            lines.append(f"complete -c care-sim -n __fish_use_subcommand -a {name}")
        given = f"__fish_seen_subcommand_from {first}"
        given += f"; and __fish_seen_subcommand_from {learner}" * bool(learner)
        lines += [
            f"complete -c care-sim -n '{given}' "
            + (f"-l {word[2:]}" if word.startswith("--") else f"-a {word}")
            for word in after
        ]
    return "\n".join(lines)
