"""The shipped configuration and launch files match the software."""

from __future__ import annotations

import json
import math
import os
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from ruamel.yaml import YAML

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.messages.cloud import FIELDS
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.node import transport
from rover_obstacle_detection.node.settings import (
    NODE_PARAMETERS,
    READ_ONLY,
    Settings,
    all_parameters,
)
from rover_obstacle_detection.node.transport import PROFILE, PROFILE_VARIABLES
from rover_obstacle_detection.offline.bag_messages import DIAGNOSTICS
from rover_obstacle_detection.parameter_file import NODE_PARAMETER_NAMES, load_config

ROOT = Path(__file__).parent.parent
CONFIG = ROOT / 'config'
OUTPUT_TOPICS = {f'/stereo/{name}' for name in OUTPUTS}


def read_yaml(path: Path) -> Any:
    return YAML(typ='safe').load(path.read_text())


def test_parameter_file_lists_every_parameter_with_its_default() -> None:
    values = read_yaml(CONFIG / 'obstacle_detector.yaml')['/**']['ros__parameters']

    assert values == {each.name: each.default for each in all_parameters()}
    for parameter in all_parameters():
        assert type(values[parameter.name]) is type(parameter.default)


def test_parameter_file_is_up_to_date() -> None:
    script = runpy.run_path(str(ROOT / 'scripts' / 'make_parameter_file.py'))

    assert (CONFIG / 'obstacle_detector.yaml').read_text() == script['parameter_file']()


def test_parameter_file_gives_node_and_replay_the_defaults() -> None:
    values = read_yaml(CONFIG / 'obstacle_detector.yaml')['/**']['ros__parameters']

    assert Settings.from_values(values).config == DetectorConfig()
    assert load_config(CONFIG / 'obstacle_detector.yaml') == DetectorConfig()


def test_replay_accepts_the_parameters_of_the_node() -> None:
    assert {each.name for each in NODE_PARAMETERS} <= NODE_PARAMETER_NAMES
    assert {each.name for each in NODE_PARAMETERS} >= READ_ONLY


def test_costmap_overrides_harmful_nav2_defaults() -> None:
    content = read_yaml(CONFIG / 'nav2_costmap.yaml')
    layer = content['local_costmap']['local_costmap']['ros__parameters']['obstacle_layer']
    sources = {name: layer[name] for name in layer['observation_sources'].split()}
    marking = [each for each in sources.values() if each['marking']]
    clearing = [each for each in sources.values() if each['clearing']]

    assert [each['topic'] for each in marking] == ['/stereo/obstacle_points']
    assert [each['topic'] for each in clearing] == ['/stereo/ground_points']
    for limits in (layer, *sources.values()):
        assert limits['min_obstacle_height'] < -100 < 100 < limits['max_obstacle_height']
    for source in sources.values():
        assert source['data_type'] == 'PointCloud2'
        assert source['sensor_frame'] == ''
    assert marking[0]['obstacle_max_range'] <= DetectorConfig().max_range
    assert clearing[0]['raytrace_max_range'] > marking[0]['obstacle_max_range']
    assert clearing[0]['raytrace_min_range'] > 0


def test_rviz_shows_image_mask_overlay_clouds_and_markers() -> None:
    displays = read_yaml(CONFIG / 'obstacle_detector.rviz')['Visualization Manager']['Displays']
    topics = {each['Topic']['Value']: each['Topic'] for each in displays if 'Topic' in each}

    assert set(topics) == {
        '/stereo/left/image_rect',
        '/stereo/obstacle_mask',
        '/stereo/detection_image',
        '/stereo/obstacle_points',
        '/stereo/ground_points',
        '/stereo/obstacle_markers',
    }
    assert set(topics) - {'/stereo/left/image_rect'} <= OUTPUT_TOPICS
    # A reliable display would show nothing of a best-effort camera driver.
    assert topics['/stereo/left/image_rect']['Reliability Policy'] == 'Best Effort'


def test_foxglove_shows_image_mask_overlay_clouds_and_markers() -> None:
    layout = json.loads((CONFIG / 'obstacle_detector.foxglove.json').read_text())
    panels = layout['configById']
    images = {
        panel['imageMode']['imageTopic'] for panel in panels.values() if 'imageMode' in panel
    }
    scene = set(panels['3D!scene']['topics'])

    assert images == {
        '/stereo/left/image_rect',
        '/stereo/obstacle_mask',
        '/stereo/detection_image',
    }
    assert scene == {
        '/stereo/obstacle_points',
        '/stereo/ground_points',
        '/stereo/obstacle_markers',
    }
    assert (images | scene) - {'/stereo/left/image_rect'} <= OUTPUT_TOPICS
    assert set(_leaves(layout['layout'])) == set(panels)


INPUT_TYPES = {'/stereo/left/image_rect': 'Image', '/stereo/left/camera_info': 'CameraInfo'}
TOPIC_TYPES = {
    **INPUT_TYPES,
    **{f'/stereo/{name}': each.type_name.rpartition('/')[2] for name, each in OUTPUTS.items()},
    DIAGNOSTICS: 'DiagnosticArray',
}


def test_rviz_displays_have_the_types_of_their_topics() -> None:
    displays = read_yaml(CONFIG / 'obstacle_detector.rviz')['Visualization Manager']['Displays']

    for display in displays:
        package, _, shown = display['Class'].partition('/')
        assert package == 'rviz_default_plugins'
        if 'Topic' in display:
            assert TOPIC_TYPES[display['Topic']['Value']] == shown
    (coloured,) = (each for each in displays if 'Channel Name' in each)
    assert coloured['Channel Name'] in FIELDS


def test_foxglove_panels_have_the_types_of_their_topics() -> None:
    panels = json.loads((CONFIG / 'obstacle_detector.foxglove.json').read_text())['configById']

    for name, panel in panels.items():
        kind = name.partition('!')[0]
        if kind == 'Image':
            assert TOPIC_TYPES[panel['imageMode']['imageTopic']] == 'Image'
            calibration = panel['imageMode'].get('calibrationTopic', '/stereo/camera_info')
            assert TOPIC_TYPES[calibration] == 'CameraInfo'
        elif kind == 'DiagnosticSummary':
            assert TOPIC_TYPES[panel['topicToRender']] == 'DiagnosticArray'
        else:
            assert kind == '3D'
            for topic, settings in panel['topics'].items():
                has_points = 'pointSize' in settings
                assert TOPIC_TYPES[topic] == ('PointCloud2' if has_points else 'MarkerArray')
                assert settings.get('colorField', 'height') in FIELDS


def test_viewers_look_at_the_ground_ahead_from_above_and_behind() -> None:
    # In the left optical frame: x right, y down, z ahead.
    rviz = read_yaml(CONFIG / 'obstacle_detector.rviz')['Visualization Manager']
    orbit = rviz['Views']['Current']
    pitch, yaw = orbit['Pitch'], orbit['Yaw']
    foxglove = json.loads((CONFIG / 'obstacle_detector.foxglove.json').read_text())
    state = foxglove['configById']['3D!scene']['cameraState']
    polar, azimuth = math.radians(state['phi']), math.radians(state['thetaOffset'])
    towards_viewer = (
        (math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)),
        (
            -math.sin(polar) * math.sin(azimuth),
            -math.sin(polar) * math.cos(azimuth),
            math.cos(polar),
        ),
    )

    for x, y, z in towards_viewer:
        assert x == pytest.approx(0, abs=0.01)
        assert y < -0.4
        assert z < -0.4
    targets = [orbit['Focal Point'][axis] for axis in 'XYZ'], state['targetOffset']
    assert [list(each) for each in targets] == [[0, 0, 3]] * 2


def _leaves(tree: Any) -> list[str]:
    return [tree] if isinstance(tree, str) else _leaves(tree['first']) + _leaves(tree['second'])


class Recorded(SimpleNamespace):
    """Replaces a class of launch; keeps the arguments of its constructor."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(args=args, **kwargs)

    def perform(self, context: dict[str, str]) -> str:
        return context[self.args[0]]


class PackageNotFoundError(KeyError):
    """Replaces that of ament_index_python."""


def no_package(name: str) -> str:
    raise PackageNotFoundError(name)


LAUNCH_MODULES = {
    'ament_index_python': [],
    'launch': ['LaunchDescription'],
    'launch.actions': [
        'DeclareLaunchArgument',
        'ExecuteProcess',
        'LogInfo',
        'OpaqueFunction',
        'SetEnvironmentVariable',
    ],
    'launch.conditions': ['IfCondition'],
    'launch.substitutions': ['LaunchConfiguration', 'PathJoinSubstitution'],
    'launch_ros': [],
    'launch_ros.actions': ['Node'],
    'launch_ros.parameter_descriptions': ['ParameterValue'],
    'launch_ros.substitutions': ['FindPackageShare'],
}


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Any]]:
    """Entities of the launch file by class name, with a fake launch (not on PyPI)."""
    for module_name, names in LAUNCH_MODULES.items():
        module = ModuleType(module_name)
        for name in names:
            setattr(module, name, type(name, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, module_name, module)
    packages = ModuleType('ament_index_python.packages')
    packages.__dict__.update(
        PackageNotFoundError=PackageNotFoundError, get_package_prefix=no_package
    )
    monkeypatch.setitem(sys.modules, packages.__name__, packages)
    script = runpy.run_path(str(ROOT / 'launch' / 'obstacle_detector.launch.py'))
    (entities,) = script['generate_launch_description']().args
    by_kind: dict[str, list[Any]] = {'all': entities}
    for entity in entities:
        by_kind.setdefault(type(entity).__name__, []).append(entity)
    return by_kind


def test_launch_file_starts_the_node_with_remappings_and_parameters(
    launched: dict[str, list[Any]],
) -> None:
    arguments = {each.args[0]: each.default_value for each in launched['DeclareLaunchArgument']}
    node = started(launched, arguments)
    assert (node.package, node.executable) == ('rover_obstacle_detection', 'obstacle_detector')
    assert node.namespace.args[0] in arguments
    assert node.remappings == []
    assert [list(each) for each in node.parameters] == [['use_sim_time']]

    given = {'params_file': 'own.yaml', 'left_image': '/l', 'right_info': '/r/camera_info'}
    node = started(launched, arguments | given)
    assert node.parameters[0] == 'own.yaml'
    assert node.remappings == [
        ('left/image_rect', '/l'),
        ('right/camera_info', '/r/camera_info'),
        ('left/image_rect/compressed', '/l/compressed'),
    ]


def started(launched: dict[str, list[Any]], arguments: dict[str, str]) -> Any:
    """Return the node that the launch file starts."""
    functions = {each.function.__name__: each.function for each in launched['OpaqueFunction']}
    (node,) = functions['_start_node'](arguments)
    return node


def test_launch_file_knows_cameras_and_what_is_given_takes_precedence(
    launched: dict[str, list[Any]],
) -> None:
    arguments = {each.args[0]: each.default_value for each in launched['DeclareLaunchArgument']}
    given = {'camera': 'oak', 'params_file': 'own.yaml', 'left_image': '/mine/left'}
    node = started(launched, arguments | given)

    remapped = dict(node.remappings)
    assert remapped['left/image_rect'] == '/mine/left'
    assert remapped['right/image_rect'] == '/oak/right/image_rect'
    assert remapped['right/image_rect/compressed'] == '/oak/right/image_rect/compressed'
    assert remapped['left/camera_info'] == '/oak/left/camera_info'
    # Of several values, ROS uses the last one.
    assert node.parameters[0]['approximate_sync'] is True
    assert node.parameters[1] == 'own.yaml'


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'params_file': 'none.yaml'}, 'none.yaml: no such parameter file'),
        ({'namespace': 'front'}, '/stereo/obstacle_detector: expected /** or /front/obstacle'),
        ({'namespace': ''}, 'expected /** or /obstacle_detector'),
        ({'camera': 'zedd'}, "camera is 'zedd': expected one of zed, zed4, realsense"),
        ({'rviz': 'true'}, 'rviz:=true: the package rviz2 is not installed'),
    ],
)
def test_launch_file_refuses_what_cannot_start_before_anything_runs(
    launched: dict[str, list[Any]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    changes: dict[str, str],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('own.yaml').write_text('/stereo/obstacle_detector: {ros__parameters: {max_step: 0.2}}')
    check = launched['OpaqueFunction'][0].function
    arguments = {'namespace': '/stereo', 'params_file': 'own.yaml', 'rviz': 'false', 'camera': ''}
    assert check(arguments) == []

    with pytest.raises(ConfigurationError) as refusal:
        check(arguments | changes)

    assert words in str(refusal.value)
    assert '\n' not in str(refusal.value)
    names = [type(each).__name__ for each in launched['all']]
    assert launched['OpaqueFunction'][0].function.__name__ == '_check'
    assert names.index('OpaqueFunction') < names.index('Node')


def test_launch_file_sets_the_profile_unless_the_user_did(
    launched: dict[str, list[Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    set_profile = launched['OpaqueFunction'][1].function
    for name in PROFILE_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(transport, '_free_bytes', lambda folder: 1 << 40)

    shipped = {each.args for each in set_profile({'profile': ''})}
    own = {each.args for each in set_profile({'profile': 'own.xml'})}
    monkeypatch.setitem(os.environ, PROFILE_VARIABLES[0], 'mine.xml')
    users = set_profile({'profile': ''})

    assert shipped == {(name, str(PROFILE)) for name in PROFILE_VARIABLES}
    assert own == {(name, 'own.xml') for name in PROFILE_VARIABLES}
    assert users == []


def test_launch_file_plays_a_bag_on_request(launched: dict[str, list[Any]]) -> None:
    play = launched['OpaqueFunction'][3].function
    arguments = {'bag': '', 'rate': '0.5', 'use_sim_time': 'false'}

    assert play(arguments) == []
    (process,) = play(arguments | {'bag': 'traverse.mcap', 'use_sim_time': 'true'})
    assert process.cmd[2:] == [
        'rover_obstacle_detection', 'play', 'traverse.mcap', '--rate', '0.5', '--clock',
    ]  # fmt: skip
