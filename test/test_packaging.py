"""Version, dependencies and entry points agree between all packaging files."""

from __future__ import annotations

import re
import runpy
import xml.etree.ElementTree
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

import rover_obstacle_detection
from rover_obstacle_detection.cli.main import PIP_PACKAGES

ROOT = Path(__file__).parents[1]
NAME = 'rover_obstacle_detection'


@pytest.fixture(scope='module')
def manifest() -> xml.etree.ElementTree.Element:
    return xml.etree.ElementTree.parse(ROOT / 'package.xml').getroot()


def test_the_version_is_the_same_everywhere(manifest: xml.etree.ElementTree.Element) -> None:
    assert manifest.findtext('version') == rover_obstacle_detection.__version__
    assert metadata.version(NAME) == rover_obstacle_detection.__version__
    changelog = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    assert re.search(r'^## (\d\S+?),? ', changelog, re.MULTILINE)[1] == (
        rover_obstacle_detection.__version__
    )


def test_ros_tools_can_find_the_package(manifest: xml.etree.ElementTree.Element) -> None:
    assert manifest.get('format') == '3'
    assert manifest.findtext('name') == NAME
    assert manifest.findtext('export/build_type') == 'ament_python'
    assert (ROOT / 'resource' / NAME).is_file()


def test_imported_ros_packages_are_declared(manifest: xml.etree.ElementTree.Element) -> None:
    declared = {each.text for each in manifest.iter('exec_depend')}
    imported = set()
    for path in (ROOT / NAME).rglob('*.py'):
        imported |= set(
            re.findall(
                r'^\s*(?:from|import) (rclpy|\w+_(?:msgs|interfaces))\b',
                path.read_text(encoding='utf-8'),
                re.MULTILINE,
            )
        )
    assert 'rclpy' in imported
    assert imported <= declared


def test_packages_of_published_types_are_declared(manifest: xml.etree.ElementTree.Element) -> None:
    from rover_obstacle_detection.messages.outputs import OUTPUTS

    declared = {each.text for each in manifest.iter('exec_depend')}
    assert {output.type_name.split('/')[0] for output in OUTPUTS.values()} <= declared


def test_console_scripts_are_installed() -> None:
    scripts = metadata.entry_points(group='console_scripts')
    ours = {each.name: each.value for each in scripts if each.value.startswith(f'{NAME}.')}
    assert set(ours) == {'obstacle_detector', 'rover-obstacles'}
    for script in scripts:
        if script.name in ours:
            assert callable(script.load())


@pytest.fixture(scope='module')
def requirements() -> dict[str, dict[str, str]]:
    """Minimum version of each package that setup.py requires, per extra and without one ('')."""
    given: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr('setuptools.setup', lambda **arguments: given.update(arguments))
        runpy.run_path('setup.py')
    groups = {'': given['install_requires'], **given['extras_require']}
    return {
        extra: dict(re.match(r'([\w.-]+)(?:[>=]=(.*))?', each).groups('') for each in group)
        for extra, group in groups.items()
    }


def test_lower_bounds_are_the_same_for_pip_rosdep_and_ci(
    manifest: xml.etree.ElementTree.Element, requirements: dict[str, dict[str, str]]
) -> None:
    numpy, opencv = (requirements[''][each] for each in ('numpy', 'opencv-python-headless'))
    bounds = {each.text: each.get('version_gte') for each in manifest.iter('exec_depend')}
    assert (bounds['python3-numpy'], bounds['python3-opencv']) == (numpy, opencv)
    tested = (ROOT / '.ci' / 'run').read_text(encoding='utf-8')
    assert f"'numpy=={numpy}.0 opencv-python-headless=={opencv}.0.66'" in tested
    guide = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    assert f'NumPy {numpy} to 2, OpenCV {opencv} to 5' in guide


def test_what_to_install_beside_apt_is_all_but_numpy_and_opencv(
    requirements: dict[str, dict[str, str]],
) -> None:
    expected = set(requirements['']) - {'numpy', 'opencv-python-headless'}
    assert set(PIP_PACKAGES) == expected
    for page in ('README.md', 'docs/node.md'):
        text = (ROOT / page).read_text(encoding='utf-8')
        assert f'pip install {" ".join(PIP_PACKAGES)}' in text, page


def test_the_table_of_extras_names_their_packages(
    requirements: dict[str, dict[str, str]],
) -> None:
    text = (ROOT / 'docs' / 'getting_started.md').read_text(encoding='utf-8')
    rows = re.findall(r'^\| `(\w+)` \|.*\| `pip install ([^`]+)`', text, re.MULTILINE)
    assert {extra for extra, _ in rows} >= {'sim', 'report', 'peers', 'tune'}
    for extra, packages in rows:
        named = set(re.findall(r"(?:^|[ '])([\w-]+)", packages))
        assert named == set(requirements[extra]), extra


def test_documents_install_from_the_source_and_not_from_pypi() -> None:
    pages = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *(ROOT / 'docs').glob('*.md')]
    modules = (ROOT / NAME).rglob('*.py')
    for path in (*pages, *modules):
        assert not re.search(rf"pip install '?{NAME}", path.read_text(encoding='utf-8')), path


def test_supported_python_versions_agree() -> None:
    about = metadata.metadata(NAME)
    assert about['Requires-Python'] == '>=3.10'
    versions = re.search(r"supported='([\d. ]+)'", (ROOT / '.ci' / 'run').read_text())[1].split()
    classifiers = about.get_all('Classifier')
    assert [f'Programming Language :: Python :: {each}' for each in versions] == [
        each for each in classifiers if each.startswith('Programming Language')
    ]
