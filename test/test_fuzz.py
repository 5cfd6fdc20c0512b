"""Inputs that fuzzing starts from are accepted; those it found are refused by a known error."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz_targets import TARGETS, run, seeds

FOUND = Path(__file__).with_name('fuzz')


@pytest.mark.parametrize('target', TARGETS)
def test_seeds_are_accepted(target: str, tmp_path: Path) -> None:
    for seed in seeds(target, tmp_path):
        assert run(target, seed)
        run(target, seed[: len(seed) // 2])
        run(target, b'')


@pytest.mark.parametrize('path', sorted(FOUND.glob('*/*')), ids=lambda path: path.name)
def test_findings_stay_fixed(path: Path) -> None:
    run(path.parent.name, path.read_bytes())
