"""The example of docs/testing.md passes as users run it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from live_graph import ROOT, own_domain

EXAMPLE = ROOT / 'docs' / 'examples' / 'test_obstacle_detection.py'
# Longer than the example waits before it fails and says why.
PATIENCE_S = 200.0


def test_example_passes_without_the_settings_of_this_repository(tmp_path: Path) -> None:
    settings = tmp_path / 'pytest.ini'
    settings.write_text('[pytest]\n')
    options = ['-c', str(settings), '--rootdir', str(tmp_path), '-p', 'no:cacheprovider']
    with own_domain() as domain:
        run = subprocess.run(
            [sys.executable, '-m', 'pytest', *options, str(EXAMPLE)],
            cwd=tmp_path,
            env=os.environ | {'TEST_ROS_DOMAIN_ID': str(domain)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
    assert run.returncode == 0, run.stdout
    assert '1 passed' in run.stdout
