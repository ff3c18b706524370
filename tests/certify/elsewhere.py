"""The certificate on a processor without AVX-512."""

import pickle
import subprocess
import sys

from care_sim.certify.playing import trails_of
from tests.helpers.places import ROOT
from tests.helpers.processor_features import without_avx512


def trails_elsewhere(numbers, workers, code):
    """Return what `trails_of` returns on such a processor; `code` is a folder for its code."""
    child = subprocess.run(
        [sys.executable, "-m", "tests.certify.elsewhere", str(workers)],
        cwd=ROOT,
        env=without_avx512(code),
        input=pickle.dumps(numbers),
        stdout=subprocess.PIPE,
        check=True,
    )
    return pickle.loads(child.stdout)


if __name__ == "__main__":
    numbers, workers = pickle.load(sys.stdin.buffer), int(sys.argv[1])
    pickle.dump(trails_of(numbers, workers), sys.stdout.buffer)
