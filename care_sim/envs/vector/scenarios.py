"""The vector environments of the closed loop by id: `DenseVectorEnv` is many of
`care_sim.envs.scenarios.DenseEnv`, and so on for every environment there.
"""

from care_sim.envs import scenarios
from care_sim.envs.vector.env import ClosedLoopVectorEnv

_ENDING = "VectorEnv"


# Gymnasium hands a vector entry point nothing but what its caller gives: of which environment it is
# to make many, its name alone can say.
def __getattr__(name: str) -> type[ClosedLoopVectorEnv]:
    single = getattr(scenarios, name.removesuffix(_ENDING) + "Env", None)
    if single is None or not name.endswith(_ENDING):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    about = f"`care_sim.envs.scenarios.{single.__name__}` many times."
    told = {"single": single, "__module__": __name__, "__doc__": about}
    # Kept, so that all who ask are given one class, also by the name in a pickle.
    made: type[ClosedLoopVectorEnv] = type(name, (ClosedLoopVectorEnv,), told)
    globals()[name] = made
    return made
