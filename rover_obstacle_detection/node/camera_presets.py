"""Topic names and settings of common camera drivers; for use before rclpy is loaded."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field

from rover_obstacle_detection.errors import ConfigurationError

SIDES = ('left', 'right')
IMAGE, INFO = 'image_rect', 'camera_info'
COMPRESSED = '/compressed'


@dataclass(frozen=True)
class CameraPreset:
    """What a camera's driver publishes, with its default names.

    Parameters
    ----------
    image, info : str
        Topics of one side; ``{}`` stands for the side.
    sides : tuple of str
        What the driver calls the left and the right side.
    parameters : mapping of str to bool, float or str
        Parameters of the node that this driver needs.
    """

    image: str
    info: str
    sides: tuple[str, str] = SIDES
    parameters: Mapping[str, bool | float | str] = field(default_factory=dict)

    @property
    def topics(self) -> dict[str, str]:
        """The driver's name of each of the node's four input topics."""
        return {
            f'{side}/{name}': pattern.format(own)
            for name, pattern in ((IMAGE, self.image), (INFO, self.info))
            for side, own in zip(SIDES, self.sides, strict=True)
        }


# Both sides are exposed together, but each is stamped on its own.
_STAMPED_APART = {'approximate_sync': True, 'approximate_sync_tolerance_seconds': 0.005}

PRESETS: Mapping[str, CameraPreset] = {
    'zed': CameraPreset(
        '/zed/zed_node/{}/color/rect/image', '/zed/zed_node/{}/color/rect/camera_info'
    ),
    'zed4': CameraPreset('/zed/zed_node/{}/image_rect_color', '/zed/zed_node/{}/camera_info'),
    'realsense': CameraPreset(
        '/camera/camera/{}/image_rect_raw', '/camera/camera/{}/camera_info', ('infra1', 'infra2')
    ),
    'oak': CameraPreset('/oak/{}/image_rect', '/oak/{}/camera_info', parameters=_STAMPED_APART),
    'oak2': CameraPreset(
        '/oak/{}/image_raw', '/oak/{}/camera_info', parameters={'rectify': 'never'}
    ),
    'multisense': CameraPreset(
        '/multisense/{}/image_rect', '/multisense/{}/image_rect/camera_info'
    ),
    'gazebo': CameraPreset('/stereo_camera/{}/image_raw', '/stereo_camera/{}/camera_info'),
    'raw': CameraPreset('{}/image_raw', '{}/camera_info'),
}
"""Presets by name; docs/getting_started.md says of which driver each is."""


def camera_preset(name: str) -> CameraPreset:
    """Return a preset.

    Raises
    ------
    ConfigurationError
        If there is none of this name. The message lists all.
    """
    if name in PRESETS:
        return PRESETS[name]
    near = difflib.get_close_matches(name, PRESETS, n=1)
    hint = f'; did you mean {near[0]}?' if near else ''
    raise ConfigurationError(f'camera is {name!r}: expected one of {", ".join(PRESETS)}{hint}')


def remappings(topics: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return the pairs to remap input topics, those of compressed images too."""
    pairs = list(topics.items())
    images = [pair for pair in pairs if pair[0].endswith(IMAGE)]
    return pairs + [(name + COMPRESSED, topic + COMPRESSED) for name, topic in images]


def parameter_arguments(preset: CameraPreset) -> list[str]:
    """Return ROS arguments that set the preset's parameters; later ones take precedence."""
    return [
        text
        for name, value in preset.parameters.items()
        for text in ('-p', f'{name}:={str(value).lower()}')
    ]


def remapping_arguments(preset: CameraPreset) -> list[str]:
    """Return ROS arguments that remap the inputs; earlier ones take precedence."""
    return [
        text for name, topic in remappings(preset.topics) for text in ('-r', f'{name}:={topic}')
    ]
