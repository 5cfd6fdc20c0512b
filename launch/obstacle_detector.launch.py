"""Start the node, and optionally play a bag and open RViz.

ros2 launch rover_obstacle_detection obstacle_detector.launch.py namespace:=stereo
ros2 launch rover_obstacle_detection obstacle_detector.launch.py camera:=realsense
ros2 launch rover_obstacle_detection obstacle_detector.launch.py bag:=traverse.mcap rviz:=true
"""

import os
import sys

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
)
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.node.camera_presets import PRESETS, camera_preset, remappings
from rover_obstacle_detection.node.transport import PROFILE_VARIABLES, use_large_message_profile
from rover_obstacle_detection.parameter_file import NODE_NAME, check_node_file

PACKAGE = 'rover_obstacle_detection'
TOPICS = {
    'left_image': 'left/image_rect',
    'right_image': 'right/image_rect',
    'left_info': 'left/camera_info',
    'right_info': 'right/camera_info',
}


def generate_launch_description():
    """Return the arguments and processes."""
    config = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config'])
    use_sim_time = LaunchConfiguration('use_sim_time')
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace',
                default_value='stereo',
                description='Namespace of node and topics.',
            ),
            DeclareLaunchArgument(
                'params_file',
                default_value='',
                description='ROS parameter file of the node. Empty: the defaults.',
            ),
            DeclareLaunchArgument(
                'camera',
                default_value='',
                description=f'Camera driver whose topics to subscribe to: {", ".join(PRESETS)}.',
            ),
            *(
                DeclareLaunchArgument(
                    argument,
                    default_value='',
                    description=f'Topic remapped to {topic}. Empty: that of the camera.',
                )
                for argument, topic in TOPICS.items()
            ),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            DeclareLaunchArgument(
                'profile',
                default_value='',
                description='Fast DDS profile. Empty: the one in your environment, else the '
                'shipped one for large messages.',
            ),
            DeclareLaunchArgument('bag', default_value='', description='Bag to play.'),
            DeclareLaunchArgument('rate', default_value='1.0', description='Playback rate.'),
            DeclareLaunchArgument('rviz', default_value='false', description='Start RViz.'),
            OpaqueFunction(function=_check),
            OpaqueFunction(function=_set_profile),
            OpaqueFunction(function=_start_node),
            OpaqueFunction(function=_play),
            Node(
                package='rviz2',
                executable='rviz2',
                arguments=['-d', PathJoinSubstitution([config, 'obstacle_detector.rviz'])],
                parameters=[{'use_sim_time': ParameterValue(use_sim_time, value_type=bool)}],
                condition=IfCondition(LaunchConfiguration('rviz')),
            ),
        ]
    )


def _check(context):
    """Refuse what cannot start before any process runs: launch leaves those running on errors."""
    namespace = LaunchConfiguration('namespace').perform(context).strip('/')
    name = f'/{namespace}/{NODE_NAME}' if namespace else f'/{NODE_NAME}'
    if params_file := LaunchConfiguration('params_file').perform(context):
        check_node_file(params_file, name)
    if camera := LaunchConfiguration('camera').perform(context):
        camera_preset(camera)
    if LaunchConfiguration('rviz').perform(context).lower() in ('true', '1'):
        try:
            get_package_prefix('rviz2')
        except PackageNotFoundError:
            msg = 'rviz:=true: the package rviz2 is not installed: install it, or omit rviz:=true'
            raise ConfigurationError(msg) from None
    return []


def _set_profile(context):
    """Set the same transport for every process of this launch."""
    own = LaunchConfiguration('profile').perform(context)
    environment = dict(os.environ)
    if own:
        environment.update(dict.fromkeys(PROFILE_VARIABLES, own))
        warning = None
    else:
        warning = use_large_message_profile(environment)
    actions = [
        SetEnvironmentVariable(name, environment[name])
        for name in PROFILE_VARIABLES
        if environment.get(name) != os.environ.get(name)
    ]
    if warning is not None:
        actions.append(LogInfo(msg=warning))
    return actions


def _start_node(context):
    """Start the node; its parameter file and given topics take precedence over the camera's."""
    camera = LaunchConfiguration('camera').perform(context)
    topics, parameters = {}, []
    if camera:
        topics |= camera_preset(camera).topics
        if own := dict(camera_preset(camera).parameters):
            parameters.append(own)
    for argument, topic in TOPICS.items():
        if given := LaunchConfiguration(argument).perform(context):
            topics[topic] = given
    if params_file := LaunchConfiguration('params_file').perform(context):
        parameters.append(params_file)
    use_sim_time = LaunchConfiguration('use_sim_time')
    parameters.append({'use_sim_time': ParameterValue(use_sim_time, value_type=bool)})
    return [
        Node(
            package=PACKAGE,
            executable='obstacle_detector',
            namespace=LaunchConfiguration('namespace'),
            parameters=parameters,
            remappings=remappings(topics),
            output='screen',
        )
    ]


def _play(context):
    """Play the bag, if one is given; publish /clock under use_sim_time."""
    bag = LaunchConfiguration('bag').perform(context)
    if not bag:
        return []
    command = [sys.executable, '-m', PACKAGE, 'play', bag]
    command += ['--rate', LaunchConfiguration('rate').perform(context)]
    if LaunchConfiguration('use_sim_time').perform(context).lower() in ('true', '1'):
        command.append('--clock')
    return [ExecuteProcess(cmd=command, output='screen')]
