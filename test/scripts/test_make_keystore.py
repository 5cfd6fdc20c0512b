"""What scripts/make_keystore.sh passes to `ros2 security`, which is not on PyPI."""

from __future__ import annotations

import os
import stat
import subprocess
import xml.etree.ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# Keeps the policy that it is given, and makes the keystore.
FAKE_ROS2 = """#!/bin/sh
echo "$@" >> calls
case "$2" in
    --help) exit ${FAKE_HELP:-0} ;;
    generate_artifacts) mkdir "$4"; cp "$6" policy.xml ;;
esac
"""


@pytest.fixture
def ros2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    fake = tmp_path / 'bin' / 'ros2'
    fake.parent.mkdir()
    fake.write_text(FAKE_ROS2)
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv('PATH', f'{fake.parent}:{os.environ["PATH"]}')
    return fake


def make_keystore(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = ['bash', str(ROOT / 'scripts' / 'make_keystore.sh'), *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize('namespace', ['/stereo', '/rover1/rear'])
def test_keystore_for_a_namespace(ros2: Path, namespace: str, tmp_path: Path) -> None:
    run = make_keystore(tmp_path, 'keys', *([] if namespace == '/stereo' else [namespace]))

    assert run.returncode == 0, run.stderr
    assert 'security generate_artifacts -k keys -p ' in (tmp_path / 'calls').read_text()
    policy = xml.etree.ElementTree.parse(tmp_path / 'policy.xml')
    (context,), (profile,) = policy.iter('context'), policy.iter('profile')
    assert context.get('path') == f'{namespace}/obstacle_detector'
    assert profile.get('ns') == namespace
    assert f'ROS_SECURITY_KEYSTORE={tmp_path}/keys\n' in run.stdout
    assert (
        f'run --namespace {namespace[1:]} --ros-args --enclave {namespace}/obstacle_detector\n'
    ) in run.stdout


@pytest.mark.parametrize(
    ('arguments', 'problem'),
    [
        ((), '0 arguments: expected KEYSTORE [NAMESPACE]'),
        (('keys', 'stereo'), "namespace is 'stereo': expected a full name such as /stereo"),
        (('keys', '/a"/><b'), 'namespace is '),
    ],
)
def test_wrong_arguments(
    ros2: Path, arguments: tuple[str, ...], problem: str, tmp_path: Path
) -> None:
    run = make_keystore(tmp_path, *arguments)

    assert run.returncode == 1
    assert f'make_keystore.sh: error: {problem}' in run.stderr
    assert not (tmp_path / 'keys').exists()


def test_missing_sros2_is_named(
    ros2: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv('FAKE_HELP', '1')
    run = make_keystore(tmp_path, 'keys')

    assert run.returncode == 1
    assert "'ros2 security' is not found: sudo apt-get install ros-jazzy-sros2" in run.stderr
