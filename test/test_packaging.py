"""Version, dependencies and entry points agree between all packaging files."""

from __future__ import annotations

import re
import xml.etree.ElementTree
from importlib import metadata
from pathlib import Path

import pytest

import rover_obstacle_detection

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


def test_supported_python_versions_agree() -> None:
    about = metadata.metadata(NAME)
    assert about['Requires-Python'] == '>=3.10'
    versions = re.search(r"supported='([\d. ]+)'", (ROOT / '.ci' / 'run').read_text())[1].split()
    classifiers = about.get_all('Classifier')
    assert [f'Programming Language :: Python :: {each}' for each in versions] == [
        each for each in classifiers if each.startswith('Programming Language')
    ]
