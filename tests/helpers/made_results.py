"""Results of the benchmark that nobody played."""

from care_sim.policies import BUILT_IN, tags_of
from care_sim.study.benchmark.result import BenchmarkResult, ResultRow
from care_sim.study.benchmark.suite import CAMERAS, PARTS, Entry, published_worlds


def made_result(policy="mine", share=0.5, tags=None, worlds=None, **given):
    """One that reaches everything in the first `share` of the worlds of every part, and nothing in
    the others.
    """
    if tags is None:
        tags = tags_of(policy) if policy in BUILT_IN else ("causal",)
    rows = []
    for part in PARTS:
        own = [world for world in worlds or published_worlds() if world.part == part]
        for camera in CAMERAS:
            rows += [
                ResultRow(
                    part,
                    camera,
                    world.number,
                    world.reachable if n < share * len(own) else 0,
                    world.reachable,
                    f"{n:016x}",
                )
                for n, world in enumerate(own)
            ]
    of = {"quick": False, "sealed": None, "made_by": {}} | given
    return BenchmarkResult(Entry(policy), tags, tuple(rows), **of)
