"""What the entry point checks before ROS starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.node.main import check_parameter_files, full_name, main


@pytest.mark.parametrize(
    ('arguments', 'name'),
    [
        ([], '/obstacle_detector'),
        (['-r', '__ns:=/stereo'], '/stereo/obstacle_detector'),
        (['--remap', 'obstacle_detector:__ns:=/a/b'], '/a/b/obstacle_detector'),
        (['-r', '__node:=front', '-r', '__ns:=/'], '/front'),
        (['-r', 'left/image_rect:=/cam/left', '-p', 'base_frame:=__ns:=/x'], '/obstacle_detector'),
    ],
)
def test_full_name_follows_the_ros_arguments(arguments: list[str], name: str) -> None:
    assert full_name(arguments) == name


def test_parameter_file_for_another_namespace_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'own.yaml'
    path.write_text('obstacle_detector: {ros__parameters: {max_step: 0.2}}')
    check_parameter_files(['--params-file', str(path)])

    with pytest.raises(ConfigurationError, match=r'expected /\*\* or /stereo/obstacle_detector'):
        check_parameter_files(['-r', '__ns:=/stereo', '--params-file', str(path)])


def test_executable_refuses_a_missing_parameter_file_on_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(['--ros-args', '--params-file', 'none.yaml']) == 1

    assert capsys.readouterr().err == (
        'obstacle_detector: error: none.yaml: no such parameter file\n'
    )
