"""Build the package with colcon and start the node from the installed tree."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
if shutil.which('colcon') is None:
    pytest.skip('needs colcon', allow_module_level=True)

from live_graph import ROOT, Process, live_graph

PACKAGE = 'rover_obstacle_detection'


def test_node_starts_from_the_installed_tree(tmp_path: Path) -> None:
    source = tmp_path / 'src' / PACKAGE
    listed = subprocess.run(
        ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip('needs a git clone')
    # Bags, tests and docs are not installed.
    for name in listed.stdout.split('\0'):
        if name and not name.startswith(('bags/', 'test/', 'docs/')) and (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, source / name)

    kind = subprocess.run(
        ['colcon', 'list'], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert kind.stdout.split() == [PACKAGE, f'src/{PACKAGE}', '(ros.ament_python)']
    subprocess.run(['colcon', 'build'], cwd=tmp_path, capture_output=True, check=True)

    installed = tmp_path / 'install' / PACKAGE
    version = f'python{sys.version_info.major}.{sys.version_info.minor}'
    packages = installed / 'lib' / version / 'site-packages'
    share = installed / 'share' / PACKAGE
    assert {each.name for each in (share / 'config').iterdir()} >= {
        'fastdds_profile.xml',
        'nav2_costmap.yaml',
        'obstacle_detector.yaml',
    }
    assert (share / 'launch' / 'obstacle_detector.launch.py').is_file()
    with live_graph(tmp_path) as graph:
        environment = graph.environment | {'PYTHONPATH': str(packages)}
        parameters = str(share / 'config' / 'obstacle_detector.yaml')
        executable = str(installed / 'lib' / PACKAGE / 'obstacle_detector')
        node = Process(
            [executable, '--ros-args', '--params-file', parameters, '-r', '__ns:=/installed'],
            tmp_path / 'node.log',
            environment,
        )
        try:
            graph.wait_for(lambda: graph.node.count_publishers('/installed/obstacle_mask'), node)
            where = subprocess.run(
                [sys.executable, '-c', f'import {PACKAGE}; print({PACKAGE}.__file__)'],
                env=environment,
                cwd=os.sep,
                capture_output=True,
                text=True,
                check=True,
            )
            assert where.stdout.startswith(str(packages))
        finally:
            assert node.stop() == 0, node.output
