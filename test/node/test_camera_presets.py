"""Presets of camera drivers, and what takes precedence over them."""

from __future__ import annotations

import re
from argparse import Namespace
from pathlib import Path

import pytest

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.cli.run_command import ros_arguments
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.messages.raw_images import are_raw
from rover_obstacle_detection.node.camera_presets import (
    PRESETS,
    camera_preset,
    parameter_arguments,
    remapping_arguments,
)
from rover_obstacle_detection.node.settings import Settings

DOCS = Path(__file__).parents[2] / 'docs' / 'getting_started.md'


def test_realsense_calls_its_sides_otherwise() -> None:
    assert camera_preset('realsense').topics == {
        'left/image_rect': '/camera/camera/infra1/image_rect_raw',
        'right/image_rect': '/camera/camera/infra2/image_rect_raw',
        'left/camera_info': '/camera/camera/infra1/camera_info',
        'right/camera_info': '/camera/camera/infra2/camera_info',
    }


def test_help_names_every_preset(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(['run', '--help'])
    text = ' '.join(capsys.readouterr().out.split())
    found = re.search(r'topics to subscribe to: (.+?);', text)
    assert found is not None
    assert re.split(', | or ', found[1]) == list(PRESETS)


@pytest.mark.parametrize('name', PRESETS)
def test_preset_is_valid_and_documented(name: str) -> None:
    preset = PRESETS[name]
    left, right, *infos = preset.topics.values()
    assert len({left, right, *infos}) == 4
    settings = Settings.from_values(preset.parameters)
    # Only these drivers publish raw images.
    assert are_raw(left, right, settings.rectify) == (name in ('gazebo', 'raw'))
    (row,) = re.findall(rf'^\| `{name}` .*$', DOCS.read_text(), re.MULTILINE)
    assert f'`{left}`' in row
    assert f'`{infos[0]}`' in row
    for parameter in preset.parameters:
        assert f'`{parameter}' in row


def test_typing_error_lists_the_presets() -> None:
    with pytest.raises(ConfigurationError) as refusal:
        camera_preset('realsens')

    assert str(refusal.value) == (
        "camera is 'realsens': expected one of zed, zed4, realsense, oak, oak2, multisense, "
        'gazebo, raw; did you mean realsense?'
    )


def test_command_refuses_an_unknown_camera(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['run', '--camera', 'webcam']) == 1

    assert "camera is 'webcam': expected one of zed, " in capsys.readouterr().err


def test_arguments_are_in_the_order_of_precedence() -> None:
    user = ['-r', 'left/image_rect:=/mine', '-p', 'approximate_sync:=false']
    options = Namespace(
        camera='oak', params=Path('own.yaml'), namespace='stereo', ros_args=list(user)
    )
    preset = camera_preset('oak')

    assert ros_arguments(options) == [
        *parameter_arguments(preset),
        '--params-file',
        'own.yaml',
        '-r',
        '__ns:=/stereo',
        *user,
        *remapping_arguments(preset),
    ]
    assert parameter_arguments(preset)[:2] == ['-p', 'approximate_sync:=true']
    assert remapping_arguments(preset)[:2] == ['-r', 'left/image_rect:=/oak/left/image_rect']
