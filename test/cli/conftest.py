"""A recording and its replay, for the tests of ``replay`` that only read them."""

import subprocess

import pytest
from hand_made import write_stereo_bag
from replay_outputs import COMMAND


@pytest.fixture(scope='session')
def bag(tmp_path_factory):
    return write_stereo_bag(tmp_path_factory.mktemp('recorded') / 'drive', pairs=3)


@pytest.fixture(scope='session')
def replayed(bag, tmp_path_factory):
    output = tmp_path_factory.mktemp('replayed') / 'out'
    arguments = [str(bag), '--output', str(output), '--images']
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done, output
