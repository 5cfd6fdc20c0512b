"""Run the detector on random cameras, images and parameters; whatever is not a known error fails.

    python scripts/random_trial.py --cases 2000
    python scripts/random_trial.py --pairs

``--pairs`` instead sets every parameter, and every two parameters, to the ends of their ranges.
The cases run in child processes with a limit of memory, so that a crash is a failed case too.
Exit status 1 if any case failed. Needs the extra `test`.
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import resource
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'support'))

from any_input import Case, cases, ends, outcome, plain_case

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.detection.config import METHODS

BATCH = 100
# More than the largest images of the trial can need: the interpreter, the network and OpenCV.
MEMORY_BYTES = 4 << 30
_SHOWN = 20


def drawn(count: int, seed: int) -> list[Case]:
    """Draw cases with hypothesis."""
    from hypothesis import HealthCheck, Phase, given, settings
    from hypothesis import seed as seeded

    found: list[Case] = []

    @seeded(seed)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(cases())
    def draw(case: Case) -> None:
        found.append(case)

    draw()
    return found


def paired() -> Iterator[Case]:
    """Set each one and each two parameters to the ends of their ranges, for each method."""
    single = [
        {each.name: end}
        for each in DetectorConfig.parameters()
        if each.name != 'method'
        for end in ends(each)
    ]
    both = (one | other for one, other in itertools.combinations(single, 2) if {*one} != {*other})
    for config in [*single, *both]:
        for method in METHODS:
            yield plain_case({'method': method, **config})


def run(batch: list[Case]) -> tuple[Counter[str], list[tuple[str, Case]], int]:
    """Run cases in a child process: outcomes, failures, and the peak of memory in MB."""
    warnings.simplefilter('error')
    outcomes: Counter[str] = Counter()
    failures = []
    for case in batch:
        try:
            outcomes[outcome(case)] += 1
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            place = f'{Path(frame.filename).name}:{frame.lineno}'
            failures.append((f'{type(error).__name__} in {place}: {error}', case))
    return outcomes, failures, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def _limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))


def run_all(trial: Iterable[Case]) -> tuple[Counter[str], list[tuple[str, Case]], int]:
    """Run cases in batches of child processes; a batch that crashes is run case by case."""
    outcomes: Counter[str] = Counter()
    failures: list[tuple[str, Case]] = []
    peak_mb = 0
    remaining = iter(trial)
    pool: ProcessPoolExecutor | None = None
    while batch := list(itertools.islice(remaining, BATCH)):
        pool = pool or _pool()
        try:
            counted, failed, used_mb = pool.submit(run, batch).result()
        except BrokenProcessPool:
            pool = None
            crashed = next((case for case in batch if _crashes(case)), batch[-1])
            failures.append(('the process crashed', crashed))
            continue
        outcomes += counted
        failures += failed
        peak_mb = max(peak_mb, used_mb)
        print(f'\r{outcomes.total()} cases, {len(failures)} failed', end='', file=sys.stderr)
    if pool is not None:
        pool.shutdown()
    print(file=sys.stderr)
    return outcomes, failures, peak_mb


def _pool() -> ProcessPoolExecutor:
    # OpenCV's threads do not survive a fork.
    context = multiprocessing.get_context('spawn')
    return ProcessPoolExecutor(1, context, _limit_memory)


def _crashes(case: Case) -> bool:
    with _pool() as pool:
        try:
            pool.submit(run, [case]).result()
        except BrokenProcessPool:
            return True
    return False


def main() -> int:
    """Run the trial and print its outcomes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--cases', type=int, default=2000)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--pairs', action='store_true')
    arguments = parser.parse_args()
    trial = paired() if arguments.pairs else drawn(arguments.cases, arguments.seed)
    outcomes, failures, peak_mb = run_all(trial)
    for name, count in outcomes.most_common():
        print(f'{count:6d}  {name}')
    print(f'{len(failures):6d}  failed')
    print(f'peak of memory: {peak_mb} MB')
    shown = dict(reversed(failures))
    for what, case in list(shown.items())[:_SHOWN]:
        print(f'\n{what}\n    {case}')
    return int(bool(failures))


if __name__ == '__main__':
    sys.exit(main())
