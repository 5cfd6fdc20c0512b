"""Fuzz what reads from outside: images, recordings, YAML files and command lines.

    python scripts/fuzz.py compressed --minutes 10
    python scripts/fuzz.py --all --minutes 10

An input that raises anything but a known error, hangs for 20 s or takes 2 GB is a finding. It is
saved as ``finding-*`` in the working directory, and the exit status is 1. Copy it to
``test/fuzz/TARGET/``: the tests run the inputs there. Needs the extras `test` and `fuzz`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REGRESSIONS = ROOT / 'test' / 'fuzz'
TIMEOUT_S = 20
MEMORY_MB = 2048

sys.path.insert(0, str(ROOT / 'test' / 'support'))


def main() -> int:
    """Fuzz one target, or each in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('target', nargs='?', help='see TARGETS in test/support/fuzz_targets.py')
    parser.add_argument('--all', action='store_true', help='fuzz every target in turn')
    parser.add_argument('--minutes', type=float, default=10.0)
    options = parser.parse_args()
    if options.all == bool(options.target):
        parser.error('expected a target or --all')
    if options.target:
        _fuzz(options.target, round(60 * options.minutes))
    return _fuzz_all(options.minutes)


def _fuzz_all(minutes: float) -> int:
    from fuzz_targets import TARGETS

    status = 0
    for target in TARGETS:
        command = [sys.executable, __file__, target, '--minutes', str(minutes)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        done = [line for line in ended.stderr.splitlines() if line.startswith('Done')]
        if ended.returncode or not done:
            status = 1
            print(f'{target:14s} FINDING\n{ended.stderr[-3000:]}', flush=True)
        else:
            print(f'{target:14s} {done[-1]}', flush=True)
    return status


def _fuzz(target: str, seconds: int) -> None:
    """Fuzz a target; atheris ends the process."""
    import atheris

    with atheris.instrument_imports(include=['rover_obstacle_detection', 'rosbags', 'mcap']):
        import fuzz_targets
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder) / 'corpus'
        corpus.mkdir()
        (Path(folder) / 'made').mkdir()
        for number, seed in enumerate(fuzz_targets.seeds(target, Path(folder) / 'made')):
            (corpus / f'seed{number}').write_bytes(seed)
        known = REGRESSIONS / target
        arguments = [
            sys.argv[0],
            f'-max_total_time={seconds}',
            f'-timeout={TIMEOUT_S}',
            f'-rss_limit_mb={MEMORY_MB}',
            '-artifact_prefix=finding-',
            '-max_len=65536',
            str(corpus),
            *([str(known)] if known.is_dir() else []),
        ]
        atheris.Setup(arguments, lambda data: fuzz_targets.run(target, data))
        atheris.Fuzz()


if __name__ == '__main__':
    sys.exit(main())
