"""The node's own parameters, and all parameters as one frozen value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rover_obstacle_detection.detection.config import DetectorConfig, ParameterDescription
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.messages.raw_images import BY_NAME, RECTIFY
from rover_obstacle_detection.node.watchdog import WatchdogLimits
from rover_obstacle_detection.rover_mask import RoverMask

IMAGE_TRANSPORTS = ('raw', 'compressed')
# Without a tolerance, approximate_sync accepts any stamp difference.
NO_LIMIT_NS = 1 << 62

NODE_PARAMETERS = (
    ParameterDescription(
        'approximate_sync',
        False,
        'Pair images whose stamps differ. If false, only equal stamps are paired.',
    ),
    ParameterDescription(
        'approximate_sync_tolerance_seconds',
        0.0,
        'Largest stamp difference within a pair if approximate_sync is true (s); 0: no limit.',
        0.0,
        10.0,
    ),
    ParameterDescription(
        'queue_size', 5, 'Images of each camera that may wait for their partner.', 1, 100
    ),
    ParameterDescription(
        'image_transport',
        'raw',
        'raw: subscribe to Image on left/image_rect and right/image_rect. compressed: subscribe '
        'to CompressedImage on left/image_rect/compressed and right/image_rect/compressed.',
        choices=IMAGE_TRANSPORTS,
    ),
    ParameterDescription(
        'rectify',
        BY_NAME,
        'Which images are raw and are rectified with K, D, R and P of camera_info. by_name: those '
        'of topics without rect in the name, such as left/image_raw. always, never: whatever the '
        'names are.',
        choices=RECTIFY,
    ),
    ParameterDescription(
        'base_frame', 'base_link', 'Frame whose z axis points up, for gravity_source tf.'
    ),
    *(
        ParameterDescription(
            f'imu_{name}',
            0.0,
            f'{name.capitalize()} (URDF rpy) of the IMU frame in the left optical frame, for '
            'gravity_source imu (deg).',
            -180.0,
            180.0,
        )
        for name in ('roll', 'pitch', 'yaw')
    ),
    ParameterDescription(
        'rover_mask',
        '',
        'Image file of the size of the left image, not black where the rover itself is visible. '
        'These pixels are excluded from detection.',
    ),
    ParameterDescription(
        'rover_polygon',
        '',
        'Outline of the rover in the left image, [[column, row], ...] (px). The pixels inside '
        'are excluded from detection.',
    ),
    ParameterDescription(
        'watchdog',
        True,
        'Watch the input: while an image does not change, publish no free ground; report frozen, '
        'missing, late and unjudgeable pairs as errors on /diagnostics. A simulator without image '
        'noise repeats the images of a standing rover: set false there.',
    ),
    ParameterDescription(
        'frozen_after',
        10,
        'Watchdog: pairs in a row that repeat an image byte for byte, with new stamps, after '
        'which the camera counts as frozen.',
        1,
        10000,
    ),
    ParameterDescription(
        'stale_after',
        2.0,
        'Watchdog: time without a pair, or without one that can be judged, after which it is an '
        'error (s).',
        0.1,
        3600.0,
    ),
    ParameterDescription(
        'max_image_age',
        2.0,
        "Watchdog: age of an image on arrival, the node's clock minus its stamp, above which it "
        'is an error (s). Not judged if the stamps are of another clock: in the future or more '
        'than a minute old from the start.',
        0.01,
        3600.0,
    ),
    ParameterDescription(
        'autostart', True, 'Configure and activate at start-up, without a lifecycle manager.'
    ),
)
# Read once, at start-up.
READ_ONLY = frozenset({'autostart'})


@dataclass(frozen=True, eq=False)
class Settings:
    """All parameters, validated.

    Parameters
    ----------
    config : DetectorConfig
    tolerance_ns : int or None
        For `StereoPairing`.
    queue_size : int
    image_transport : str
    rectify : str
        One of `RECTIFY`.
    base_frame : str
    imu_angles_deg : tuple of float
        Roll, pitch and yaw of the IMU frame in the left optical frame (deg).
    rover_mask : RoverMask or None
    watchdog : WatchdogLimits or None
        None: no watchdog.
    autostart : bool
    """

    config: DetectorConfig
    tolerance_ns: int | None
    queue_size: int
    image_transport: str
    rectify: str
    base_frame: str
    imu_angles_deg: tuple[float, float, float]
    rover_mask: RoverMask | None
    watchdog: WatchdogLimits | None
    autostart: bool

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> Settings:
        """Validate all parameters, individually and in combination.

        Parameters
        ----------
        values : mapping of str to value
            Values of `all_parameters`; missing ones keep their default.

        Raises
        ------
        ConfigurationError
            Naming the parameter, its value and the expected value.
        """
        names = {each.name for each in DetectorConfig.parameters()}
        config = DetectorConfig(**{name: values[name] for name in names if name in values})
        own = {each.name: values.get(each.name, each.default) for each in NODE_PARAMETERS}
        for description in NODE_PARAMETERS:
            description.check(own[description.name])
        if not own['base_frame']:
            msg = "base_frame is '': expected the name of a frame"
            raise ConfigurationError(msg)
        tolerance_ns = None
        if own['approximate_sync']:
            tolerance_ns = round(own['approximate_sync_tolerance_seconds'] * 1e9) or NO_LIMIT_NS
        return cls(
            config=config,
            tolerance_ns=tolerance_ns,
            queue_size=own['queue_size'],
            image_transport=own['image_transport'],
            rectify=own['rectify'],
            base_frame=own['base_frame'],
            imu_angles_deg=(own['imu_roll'], own['imu_pitch'], own['imu_yaw']),
            rover_mask=RoverMask.load(own['rover_mask'], own['rover_polygon']),
            watchdog=_watchdog_limits(own),
            autostart=own['autostart'],
        )


def _watchdog_limits(values: Mapping[str, Any]) -> WatchdogLimits | None:
    if not values['watchdog']:
        return None
    return WatchdogLimits(
        frozen_after=values['frozen_after'],
        stale_after_s=values['stale_after'],
        max_image_age_s=values['max_image_age'],
    )


def all_parameters() -> tuple[ParameterDescription, ...]:
    """Return all parameters of the node: the detector's, then its own."""
    return (*DetectorConfig.parameters(), *NODE_PARAMETERS)
