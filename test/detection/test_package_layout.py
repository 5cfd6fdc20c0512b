"""The sub-packages of the detection: few modules at the top, imports in one direction."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import rover_obstacle_detection.detection as detection

PACKAGE = detection.__name__
ROOT = Path(detection.__file__).parent
IN_ORDER = (
    'network',
    'geometry',
    'images',
    'rectification',
    'stereo',
    'terrain',
    'rocks',
    'regions',
    'study',
    'result',
    'methods',
)
# Modules at the top that a sub-package may import. The parameters of all stages belong to the
# result, which carries them, and to the methods, which hand them out.
TOP_MODULES = {
    'frame': IN_ORDER,
    'config': ('result',),
    'parameters': ('result', 'methods'),
}
MAX_TOP_MODULES = 6
MODULES = sorted(ROOT.rglob('*.py'))
FILES = [module.relative_to(ROOT) for module in MODULES]


def imported(source):
    """First name after the package of everything that a module imports from it."""
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, 'imports are absolute'
            if node.module == PACKAGE:
                names += [f'{PACKAGE}.{each.name}' for each in node.names]
            else:
                names.append(node.module or '')
        elif isinstance(node, ast.Import):
            names += [each.name for each in node.names]
    return {name.split('.')[2] for name in names if name.startswith(f'{PACKAGE}.')}


def allowed(package):
    earlier = IN_ORDER[: IN_ORDER.index(package) + 1]
    return {*earlier, *(name for name, users in TOP_MODULES.items() if package in users)}


def test_imports_are_found():
    source = f"""
import numpy, {PACKAGE}.geometry.camera
from {PACKAGE}.images.edges import edge_strength
from {PACKAGE} import rocks
def f():
    from {PACKAGE}.methods import hybrid
"""
    assert imported(source) == {'geometry', 'images', 'rocks', 'methods'}


def test_sub_packages_are_the_known_ones():
    found = {each.parent.name for each in ROOT.glob('*/__init__.py')}
    assert found == set(IN_ORDER)


def test_few_modules_lie_directly_in_the_package():
    top = [each for each in ROOT.glob('*.py') if each.name != '__init__.py']
    assert 0 < len(top) <= MAX_TOP_MODULES


@pytest.mark.parametrize(
    'file', [each for each in FILES if len(each.parts) > 1], ids=lambda file: str(file)
)
def test_stage_imports_only_from_stages_before_it(file):
    found = imported((ROOT / file).read_text(encoding='utf-8'))
    assert found <= allowed(file.parts[0])


def test_imports_at_the_top_do_not_go_in_circles():
    top = {each.stem: imported(each.read_text(encoding='utf-8')) for each in ROOT.glob('*.py')}
    assert not top['config']
    assert top['frame'] <= {'geometry', 'images'}
    for stage in top['parameters'] - {'config'}:
        for file in (ROOT / stage).glob('*parameters.py'):
            inner = file.name != 'parameters.py'
            assert imported(file.read_text(encoding='utf-8')) <= (set() if inner else {stage})


@pytest.mark.parametrize('file', FILES, ids=lambda file: str(file))
def test_no_other_package_is_imported(file):
    tree = ast.parse((ROOT / file).read_text(encoding='utf-8'))
    names = [
        node.module or ''
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or '').startswith('rover_')
    ]
    allowed = ('.errors', '.wording')
    assert all(name.startswith(PACKAGE) or name.endswith(allowed) for name in names)
