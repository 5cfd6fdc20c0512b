"""The mutants that the script draws, and how it judges them."""

from __future__ import annotations

import ast
from pathlib import Path

import mutation_sample
import pytest
from mutation_sample import Mutant, all_mutants, changes

ROOT = Path(__file__).parents[2]


def mutants_of(source: str) -> list[str]:
    return [source[:start] + new + source[end:] for start, end, new in changes(source)]


@pytest.mark.parametrize(
    ('source', 'expected'),
    [
        ('a < b', ['a <= b']),
        ('a <= b < c', ['a < b < c', 'a <= b <= c']),
        ('a is not b', ['a is b']),
        ('a not in b', ['a in b']),
        ('a + b - c', ['a + b + c', 'a - b - c']),
        ('a and b and c', ['a or b and c', 'a and b or c']),
        ('(a) == (b)', ['(a) != (b)']),
        ('not a', ['a']),
        ('7', ['8']),
        ('2.5', ['5.0']),
        ('0.0', ['1.0']),
        ("'1' + True", ["'1' - True"]),
        ('x: tuple[Literal[1], 2] = y', []),
        ('"é"; a < b', ['"é"; a <= b']),
        ('not (a)', ['(a)']),
    ],
)
def test_changes(source: str, expected: list[str]) -> None:
    assert mutants_of(source) == expected


def test_every_mutant_of_the_detection_is_another_valid_program() -> None:
    mutants = list(all_mutants(ROOT))

    assert len({each.module for each in mutants}) > 50
    for mutant in mutants[::60]:
        source = (ROOT / mutant.module).read_text(encoding='utf-8')
        changed = mutant.apply(source)
        assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source))


def test_a_mutant_survives_if_the_tests_do_not_look(tmp_path: Path) -> None:
    source = 'def grown(a):\n    return a + a\n\n\ndef unseen(a):\n    return a > a\n'
    (tmp_path / 'sums.py').write_text(source)
    (tmp_path / 'test_sums.py').write_text(
        'from sums import grown\n\n\ndef test_it():\n    assert grown(1) == 2\n'
    )
    results = {}
    for start, end, new in changes(source):
        mutant = Mutant(Path('sums.py'), Path('test_sums.py'), start, end, new)
        survived = mutation_sample.survives(mutant, tmp_path)
        results[mutation_sample.describe(mutant, tmp_path)] = survived
        diff = mutation_sample.diff(mutant, tmp_path)

    assert results == {
        'sums.py:2: + -> -': False,
        'sums.py:6: > -> >=': True,
    }
    assert (tmp_path / 'sums.py').read_text() == source
    assert '-    return a > a\n+    return a >= a\n' in diff
