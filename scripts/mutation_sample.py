"""Change the detection code at random and see whether its tests notice.

    python scripts/mutation_sample.py --count 60
    python scripts/mutation_sample.py --count 60 --wider
    python scripts/mutation_sample.py --count 0 --jobs 2 --module terrain/

Draws mutants from modules with a test file of the same name and runs only this file on each, in a
copy of the working tree: `test/detection/x/test_y.py` for `detection/x/y.py`. With `--wider`,
survivors then face all tests of the detector, which takes minutes for each. Prints the share of
mutants that the tests find, and the survivors as diffs. A survivor is a missing test, or a change
that makes no difference.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import math
import multiprocessing
import multiprocessing.pool
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

# Imported once here: each run of the tests is a fork of this process.
import cv2  # noqa: F401
import hypothesis  # noqa: F401
import numpy as np  # noqa: F401
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path('rover_obstacle_detection')
COPIED = (
    'rover_obstacle_detection', 'test', 'scripts', 'config', 'docs', 'bags', 'pyproject.toml',
)  # fmt: skip
# Its numbers are compared with config/obstacle_detector.yaml by test/test_config_files.py.
DECLARATIONS = PACKAGE / 'detection' / 'config.py'
DETECTOR_TESTS = Path('test') / 'detection'
# A mutant can loop for ever; this is far more than any of the test files, or all, need.
TIMEOUT_S, WIDER_TIMEOUT_S = 300.0, 3000.0
SWAPPED = {
    '<': '<=', '<=': '<', '>': '>=', '>=': '>', '==': '!=', '!=': '==', '+': '-', '-': '+',
    'and': 'or', 'or': 'and', 'is': 'is not', 'is not': 'is', 'in': 'not in', 'not in': 'in',
}  # fmt: skip
OPERATORS = re.compile(r'not in|is not|<=|>=|==|!=|[<>+-]|\b(?:and|or|is|in)\b')

_copy: Path
"""The copy of the working tree that belongs to this process."""


@dataclass(frozen=True)
class Mutant:
    """One change of one module.

    Parameters
    ----------
    module, test : Path
        Relative to the repository.
    start, end : int
        The characters that are replaced.
    replacement : str
    """

    module: Path
    test: Path
    start: int
    end: int
    replacement: str

    def apply(self, source: str) -> str:
        """Return the changed source."""
        return source[: self.start] + self.replacement + source[self.end :]


def main() -> int:
    """Run the sample; print the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=60, help='number of mutants; 0: all')
    parser.add_argument('--seed', type=int, default=1, help='of the random choice')
    parser.add_argument('--module', default='', help='only modules whose path contains this')
    parser.add_argument('--jobs', type=int, default=1, help='processes')
    parser.add_argument(
        '--wider', action='store_true', help='give survivors to all tests of the detector'
    )
    arguments = parser.parse_args()
    mutants = [each for each in all_mutants(ROOT) if arguments.module in str(each.module)]
    if not mutants:
        parser.error(f'--module {arguments.module}: no module with a test file is named so')
    count = min(max(arguments.count, 0) or len(mutants), len(mutants))
    sample = random.Random(arguments.seed).sample(mutants, count)
    print(f'{count} of {len(mutants)} mutants, seed {arguments.seed}', flush=True)
    wider = [DETECTOR_TESTS] if arguments.wider else []
    with tempfile.TemporaryDirectory() as folder, _pool(arguments.jobs, Path(folder)) as pool:
        unchanged = sorted({each.test for each in sample}) + wider
        for tests, passed in zip(unchanged, pool.imap(_passes_unchanged, unchanged), strict=True):
            if not passed:
                print(f'{tests} fails without a mutant', file=sys.stderr)
                return 1
        survivors = sorted(sample, key=lambda each: (each.module, each.start))
        for folder_of_all in (None, *wider):
            judgements = [(mutant, folder_of_all) for mutant in survivors]
            survivors = [mutant for mutant in pool.imap(_judged, judgements) if mutant]
            killed = count - len(survivors)
            by = f'it or {folder_of_all}' if folder_of_all else 'the test file of the same name'
            print(f'\n{killed} of {count} killed ({killed / count:.0%}) by {by}\n')
        for mutant in survivors:
            print(diff(mutant, ROOT))
    return 0


def _pool(jobs: int, folder: Path) -> multiprocessing.pool.Pool:
    """Return processes with a copy of the working tree each."""
    return multiprocessing.get_context('fork').Pool(jobs, _copy_for_this_process, [folder])


def _copy_for_this_process(folder: Path) -> None:
    global _copy
    _copy = folder / str(os.getpid())
    copy_tree(ROOT, _copy)


def _passes_unchanged(tests: Path) -> bool:
    return passes(_copy, tests, WIDER_TIMEOUT_S)


def _judged(judgement: tuple[Mutant, Path | None]) -> Mutant | None:
    """Print whether a mutant survives; return it if it does."""
    mutant, tests = judgement
    survived = survives(mutant, _copy, tests)
    print(f'{"SURVIVED" if survived else "killed"} {describe(mutant, _copy)}', flush=True)
    return mutant if survived else None


def all_mutants(root: Path) -> Iterator[Mutant]:
    """Yield every mutant of the modules that have a test file of the same name."""
    modules = [PACKAGE / 'pairing.py']
    modules += sorted(
        path.relative_to(root) for path in (root / PACKAGE / 'detection').rglob('*.py')
    )
    for module in modules:
        if module == DECLARATIONS:
            continue
        test = Path('test') / module.relative_to(PACKAGE).with_name(f'test_{module.name}')
        if (root / test).exists():
            for start, end, replacement in changes((root / module).read_text(encoding='utf-8')):
                yield Mutant(module, test, start, end, replacement)


def changes(source: str) -> Iterator[tuple[int, int, str]]:
    """Yield the changes of a source: start and end of the replaced characters, and the new ones.

    Comparisons, `+`, `-`, `and` and `or` are swapped, `not` is removed, and numbers are changed.
    """
    place = _Places(source)
    tree = ast.parse(source)
    ignored = {id(each) for node in ast.walk(tree) for each in _annotations(node)}
    for node in _walk(tree, ignored):
        gaps: list[tuple[ast.expr, ast.expr]] = []
        if isinstance(node, ast.Compare):
            gaps = list(zip([node.left, *node.comparators], node.comparators, strict=False))
        elif isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            gaps = [(node.left, node.right)]
        elif isinstance(node, ast.BoolOp):
            gaps = list(zip(node.values, node.values[1:], strict=False))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            # Not the parenthesis that may follow.
            yield place.start(node), place.start(node) + len('not '), ''
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            changed = node.value + 1 if isinstance(node.value, int) else 2 * node.value or 1.0
            yield place.start(node), place.end(node), repr(changed)
        for left, right in gaps:
            start, end = place.end(left), place.start(right)
            found = OPERATORS.search(source, start, end)
            if found is not None:
                yield found.start(), found.end(), SWAPPED[found[0]]


def _annotations(node: ast.AST) -> Iterator[ast.AST]:
    for name in ('annotation', 'returns'):
        if isinstance(annotation := getattr(node, name, None), ast.AST):
            yield annotation


def _walk(node: ast.AST, ignored: set[int]) -> Iterator[ast.AST]:
    if id(node) not in ignored:
        yield node
        for child in ast.iter_child_nodes(node):
            yield from _walk(child, ignored)


class _Places:
    """Character positions of the nodes of a source."""

    def __init__(self, source: str) -> None:
        self._lines = source.splitlines(keepends=True)
        self._starts = [0]
        for line in self._lines:
            self._starts.append(self._starts[-1] + len(line))

    def start(self, node: ast.expr) -> int:
        return self._position(node.lineno, node.col_offset)

    def end(self, node: ast.expr) -> int:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._position(node.end_lineno, node.end_col_offset)

    def _position(self, line: int, byte: int) -> int:
        # The columns of ast count bytes.
        return self._starts[line - 1] + len(self._lines[line - 1].encode()[:byte].decode())


def copy_tree(root: Path, folder: Path) -> None:
    """Copy what the tests need."""
    for name in COPIED:
        source = root / name
        if source.is_dir():
            ignore = shutil.ignore_patterns('__pycache__')
            shutil.copytree(source, folder / name, ignore=ignore)
        else:
            shutil.copy(source, folder / name)


def passes(folder: Path, tests: Path, timeout_s: float = TIMEOUT_S) -> bool:
    """Run a test file or folder in the copy, in a process of its own."""
    child = os.fork()
    if not child:
        # Ends the tests even if this process is killed.
        signal.alarm(math.ceil(timeout_s))
        _run_tests(folder, tests)
    end_s = time.monotonic() + timeout_s
    ended = 0, 0
    try:
        while not ended[0] and time.monotonic() < end_s:
            time.sleep(0.01)
            ended = os.waitpid(child, os.WNOHANG)
    finally:
        if not ended[0]:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
    return ended[0] != 0 and ended[1] == 0


def _run_tests(folder: Path, tests: Path) -> NoReturn:
    """Run tests in a forked process and end it."""
    status = 1
    try:
        os.setpgid(0, 0)
        os.chdir(folder)
        os.environ |= {'PYTHONPATH': str(folder), 'PYTHONDONTWRITEBYTECODE': '1'}
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(folder))
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        # hypothesis is imported already.
        options = ['-x', '-q', '-p', 'no:cacheprovider', '-W', 'ignore:Module already imported']
        status = pytest.main([*options, str(tests)])
    finally:
        os._exit(status)


def survives(mutant: Mutant, folder: Path, tests: Path | None = None) -> bool:
    """Whether the tests pass with the mutant, by default those of its own file."""
    path = folder / mutant.module
    source = path.read_text(encoding='utf-8')
    path.write_text(mutant.apply(source), encoding='utf-8')
    try:
        if tests is None:
            return passes(folder, mutant.test)
        return passes(folder, tests, WIDER_TIMEOUT_S)
    finally:
        path.write_text(source, encoding='utf-8')


def describe(mutant: Mutant, folder: Path) -> str:
    """Return module, line and change of a mutant, on one line."""
    source = (folder / mutant.module).read_text(encoding='utf-8')
    line = source.count('\n', 0, mutant.start) + 1
    old = source[mutant.start : mutant.end].strip()
    return f'{mutant.module}:{line}: {old} -> {mutant.replacement or "(removed)"}'


def diff(mutant: Mutant, folder: Path) -> str:
    """Return the change as a unified diff."""
    source = (folder / mutant.module).read_text(encoding='utf-8')
    lines = (text.splitlines(keepends=True) for text in (source, mutant.apply(source)))
    return ''.join(difflib.unified_diff(*lines, str(mutant.module), 'mutant', n=2))


if __name__ == '__main__':
    sys.exit(main())
