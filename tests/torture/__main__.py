"""The long form: every campaign in turn, for so many seconds or so many cases, or one case alone.

python -m tests.torture --seconds 600 --seed 1                 all campaigns, each for its share
python -m tests.torture --campaigns commands calls --cases 100000
python -m tests.torture --case commands:1:37
"""

import argparse
import json
import sys
import time
from itertools import islice
from pathlib import Path

from tests.torture.case import CAMPAIGNS, Name
from tests.torture.field import Field, names


def main():
    options = _options()
    if options.case:
        with Field(1) as field:
            tally = field.play([Name.of(options.case)])
        print(*tally.failures, tally, sep="\n")
        return int(bool(tally.failures))
    failures = []
    shares = sum(CAMPAIGNS[name] for name in options.campaigns)
    with Field(options.servers) as field:
        for name in options.campaigns:
            seconds = (options.seconds or float("inf")) * CAMPAIGNS[name] / shares
            drawn = islice(names(name, options.seed, options.first), options.cases or None)
            tally = field.play(drawn, time.monotonic() + seconds)
            failures += tally.failures
            print(f"{name}: {tally}", flush=True)
            firsts = {failure.key: failure for failure in reversed(tally.failures)}
            for failure in firsts.values():
                print(f"  {failure.name}: {failure.kind} at {failure.place or '?'}", flush=True)
            _write(options.failures, failures)
    if failures:
        print(f"Every failure is in {options.failures}; make torture CASE=NAME plays one alone.")
    return int(bool(failures))


def _options():
    parser = argparse.ArgumentParser(prog="make torture", description=__doc__.partition("\n")[0])
    parser.add_argument("--campaigns", nargs="+", choices=CAMPAIGNS, default=[*CAMPAIGNS])
    parser.add_argument("--seconds", type=float, default=0, help="for all of them together")
    parser.add_argument("--cases", type=int, default=0, help="of each, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--servers", type=int, default=2)
    parser.add_argument("--case", help="CAMPAIGN:SEED:NUMBER, alone")
    parser.add_argument("--failures", type=Path, default=Path("build/torture/failures.jsonl"))
    options = parser.parse_args()
    if not (options.seconds or options.cases or options.case):
        parser.error("say how long (--seconds), how many (--cases) or which (--case)")
    return options


def _write(path, failures):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(failure.__dict__) + "\n" for failure in failures))


if __name__ == "__main__":
    sys.exit(main())
