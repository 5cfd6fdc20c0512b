"""The detector flags the rock of a recording, and not the ground in front of it."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import Image

from rover_obstacle_detection.node.transport import use_large_message_profile

BAG = Path(__file__).parents[2] / 'bags' / 'mars_yard'
STAMP_NS = 1_700_000_000_000_000_000  # Of the first pair in the bag.
ROCK = np.s_[185:245, 760:840]  # Rows and columns of the left image.
GROUND = np.s_[400:700, 250:900]
INPUTS = ('/stereo/left/image_rect', '/stereo/right/image_rect')
OUTPUTS = ('/stereo/obstacle_mask', '/stereo/debug/known')
PATIENCE_S = 60.0


@contextmanager
def running(*arguments):
    """Run a command of the package as a process of its own until the block ends."""
    process = subprocess.Popen([sys.executable, '-m', 'rover_obstacle_detection', *arguments])
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(timeout=20)
        finally:
            process.kill()


def wait_for(condition, node, *processes):
    """Receive messages until something is true."""
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert all(process.poll() is None for process in processes), 'a process ended'
        assert time.monotonic() < end_s, 'waited in vain'
        rclpy.spin_once(node, timeout_sec=0.1)


@pytest.fixture
def received(monkeypatch):
    """Return the outputs for the first pair, by topic."""
    # A domain that no robot and no other test uses, on this machine only.
    monkeypatch.setenv('ROS_DOMAIN_ID', os.environ.get('TEST_ROS_DOMAIN_ID', '101'))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    use_large_message_profile()  # Without it, large images are lost.
    messages = {}

    def keep(topic, message):
        stamp = message.header.stamp
        if stamp.sec * 1_000_000_000 + stamp.nanosec == STAMP_NS:
            messages[topic] = message

    rclpy.init()
    node = rclpy.create_node('test')
    for topic in OUTPUTS:
        node.create_subscription(Image, topic, partial(keep, topic), 10)
    try:
        with running('run', '--namespace', 'stereo') as detector:
            # It is there when it subscribes to the images; then the bag may begin.
            wait_for(lambda: all(map(node.count_subscribers, INPUTS)), node, detector)
            # In a loop, because a busy machine may miss the first round.
            with running('play', str(BAG), '--loop') as player:
                wait_for(lambda: len(messages) == len(OUTPUTS), node, detector, player)
    finally:
        node.destroy_node()
        rclpy.shutdown()
    return messages


def test_rock_is_flagged_and_ground_is_free(received):
    """Free is what is judged and not flagged; unknown pixels are not flagged either."""
    mask, known = (
        np.frombuffer(received[topic].data, np.uint8).reshape(768, 1024) for topic in OUTPUTS
    )
    assert received['/stereo/obstacle_mask'].header.frame_id == 'stereo_left_optical_frame'
    assert (mask[ROCK] == 255).mean() > 0.8
    assert (mask[GROUND] == 255).mean() == 0
    assert (known[GROUND] == 255).mean() > 0.9
