"""The packages lie in layers: imports go from applications to adapters to the core."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

import rover_obstacle_detection

PACKAGE = rover_obstacle_detection.__name__
ROOT = Path(rover_obstacle_detection.__file__).parent
# Within a layer, a package may import those before it.
LAYERS = {
    'everywhere': ('errors', 'wording'),
    'core': ('detection',),
    'adapters': (
        'pairing',
        'partial_folder',
        'pictures',
        'rover_mask',
        'swapped_images',
        'warning_kinds',
        'yaml_file',
        'parameter_file',
        'messages',
        'calibration_files',
        'bags',
        'simulation',
        'evaluation',
        'report',
    ),
    'applications': ('node', 'offline', 'tuning', 'cli'),
}
IN_ORDER = tuple(package for layer in LAYERS.values() for package in layer)
# ONNX Runtime is optional.
CORE_LIBRARIES = {'numpy', 'cv2', 'onnxruntime'}
FILES = sorted(each.relative_to(ROOT) for each in ROOT.rglob('*.py'))
ENTRY_POINTS = {'__init__': {'detection'}, '__main__': {'program'}, 'program': set()}


def package_of(file: Path) -> str:
    return file.parts[0].removesuffix('.py')


def imported(source: str) -> set[str]:
    """Full names of the modules that a source imports."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, 'imports are absolute'
            assert node.module
            names |= {f'{node.module}.{each.name}' for each in node.names}
    return names


def imports_of(file: Path) -> set[str]:
    return imported((ROOT / file).read_text(encoding='utf-8'))


def own_packages(names: set[str]) -> set[str]:
    """Packages and modules directly below this package."""
    own = {name.split('.')[1] for name in names if name.startswith(f'{PACKAGE}.')}
    return own - {'__version__'}


def libraries(names: set[str]) -> set[str]:
    return {name.split('.')[0] for name in names} - {*sys.stdlib_module_names, PACKAGE}


def test_imports_are_found() -> None:
    source = f"""
import os.path, numpy as np
from {PACKAGE} import __version__, pairing
if TYPE_CHECKING:
    from {PACKAGE}.bags.reader import open_bag
def f():
    import rclpy.node
"""
    assert own_packages(imported(source)) == {'pairing', 'bags'}
    assert libraries(imported(source)) == {'numpy', 'rclpy'}


def test_every_package_has_a_layer() -> None:
    assert {package_of(file) for file in FILES} == {*IN_ORDER, *ENTRY_POINTS}


@pytest.mark.parametrize('package', [*IN_ORDER, *ENTRY_POINTS])
def test_package_imports_only_from_those_below_it(package: str) -> None:
    if package in ENTRY_POINTS:
        allowed = ENTRY_POINTS[package]
    else:
        allowed = {*IN_ORDER[: IN_ORDER.index(package) + 1]}
    for file in FILES:
        if package_of(file) == package:
            assert own_packages(imports_of(file)) <= allowed, file


def test_only_the_command_line_imports_the_node() -> None:
    importing = {package_of(file) for file in FILES if 'node' in own_packages(imports_of(file))}
    assert importing == {'node', 'cli'}


def test_only_the_node_imports_ros() -> None:
    importing = {
        package_of(file)
        for file in FILES
        for library in libraries(imports_of(file))
        if library in {'rclpy', 'tf2_ros'} or library.endswith(('_msgs', '_interfaces'))
    }
    assert importing == {'node'}


def test_core_imports_only_numpy_opencv_and_onnx_runtime() -> None:
    core = [file for file in FILES if package_of(file) == 'detection']
    assert set().union(*(libraries(imports_of(file)) for file in core)) == CORE_LIBRARIES
