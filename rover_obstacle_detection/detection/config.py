"""What a user can set: one frozen object, each parameter with its range and meaning."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any, cast

from rover_obstacle_detection.errors import ConfigurationError

Value = bool | int | float | str

METHODS = ('hybrid', 'study')
SPEEDS = ('accurate', 'fast')
MAX_GRID_CELLS = 1000
"""Cells of `DetectorConfig.grid_extent`."""
BLOCK_SIZES = {'hybrid': 3, 'study': 5}
GRAVITY_SOURCES = ('estimate', 'parameters', 'imu', 'tf')


@dataclass(frozen=True)
class ParameterDescription:
    """A parameter as users, ROS parameter descriptors and the documentation see it."""

    name: str
    default: Value
    description: str
    minimum: float | None = None
    maximum: float | None = None
    step: int | None = None
    choices: tuple[str, ...] = ()
    smallest: float = 0.0
    """Smallest value other than 0, where 0 means that the parameter is not set."""

    def check(self, value: object) -> None:
        """Reject a value of the wrong type or out of range.

        Raises
        ------
        ConfigurationError
            Naming the parameter, the value and what was expected.
        """
        expected = type(self.default)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (type(value) is expected or (expected is float and number)):
            msg = f'{self.name} is {value!r}: expected {_TYPE_NAMES[expected]}'
            raise ConfigurationError(msg)
        if self.choices and value not in self.choices:
            msg = f'{self.name} is {value!r}: expected one of {", ".join(self.choices)}'
            raise ConfigurationError(msg)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            self._check_number(value)

    def _check_number(self, value: float) -> None:
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        if not low <= value <= high:
            msg = f'{self.name} is {value}: expected {low:g} to {high:g}'
            raise ConfigurationError(msg)
        if 0 < value < self.smallest:
            msg = f'{self.name} is {value}: expected 0, or {self.smallest:g} to {high:g}'
            raise ConfigurationError(msg)
        if self.step is not None and (value - low) % self.step:
            msg = f'{self.name} is {value}: expected {low:g} plus a multiple of {self.step}'
            raise ConfigurationError(msg)


_TYPE_NAMES = {
    bool: 'true or false',
    int: 'a whole number',
    float: 'a number',
    str: 'a string',
}


def _parameter(
    default: Any,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    *,
    step: int | None = None,
    choices: tuple[str, ...] = (),
    smallest: float = 0.0,
) -> Any:
    metadata = {
        'description': description,
        'minimum': minimum,
        'maximum': maximum,
        'step': step,
        'choices': choices,
        'smallest': smallest,
    }
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class DetectorConfig:
    """The detector's parameters, named like the ROS parameters.

    Lengths are in metres, angles in degrees, image lengths in pixels of the full image.
    ``DetectorConfig.parameters()`` lists all fields with range and meaning.

    Raises
    ------
    ConfigurationError
        If a value has the wrong type, is out of range, or contradicts another one.
    """

    method: str = _parameter(
        'hybrid', 'Detection method: hybrid, or the method of the study.', choices=METHODS
    )

    max_step: float = _parameter(
        0.10,
        'Largest step, up or down, that the rover can drive over (m).',
        0.01,
        2.0,
    )
    max_slope: float = _parameter(
        20.0, 'Steepest slope that the rover can climb (deg).', 1.0, 60.0
    )
    max_roughness: float = _parameter(
        0.0,
        'Roughest ground that the rover can cross: root mean square height above the local ground '
        'within a wheel base, without obstacles (m); 0: not judged.',
        0.0,
        1.0,
        smallest=0.001,
    )
    min_range: float = _parameter(
        0.3, 'Nearest distance along the optical axis that is judged (m).', 0.01, 100.0
    )
    max_range: float = _parameter(
        40.0, 'Farthest distance along the optical axis that is judged (m).', 0.1, 1000.0
    )

    upside_down: bool = _parameter(
        False,
        'Whether the camera is mounted upside down. The results are those of its images as they '
        'arrive; camera_roll counts from the upside-down position.',
    )

    gravity_source: str = _parameter(
        'estimate',
        'Source of the vertical: estimated from the visible ground; parameters (camera_pitch, '
        'camera_roll); the imu topic; or TF.',
        choices=GRAVITY_SOURCES,
    )
    camera_pitch: float = _parameter(
        0.0,
        'Angle of the optical axis below the horizon, for gravity_source parameters (deg).',
        -90.0,
        90.0,
    )
    camera_roll: float = _parameter(
        0.0,
        'Clockwise roll about the optical axis, for gravity_source parameters (deg).',
        -90.0,
        90.0,
    )
    camera_height: float = _parameter(
        0.0,
        'Height of the left camera above the ground (m), whatever the source of the vertical; '
        '0: unknown. Set it: a contradiction, as with a wrong baseline, gives a warning.',
        0.0,
        20.0,
        smallest=0.05,
    )
    max_camera_pitch: float = _parameter(
        70.0,
        'Where the vertical is estimated: greatest angle of the optical axis below the ground '
        'plane (deg). Steeper planes are walls.',
        5.0,
        90.0,
    )
    max_camera_roll: float = _parameter(
        25.0,
        'Where the vertical is estimated: greatest roll of the camera against the ground plane '
        '(deg).',
        1.0,
        90.0,
    )
    speed: str = _parameter(
        'accurate',
        'Method hybrid: how many pixels are judged; fast: fewer, with coarser outlines. '
        'Only with a working_scale of 0.',
        choices=SPEEDS,
    )
    working_scale: float = _parameter(
        0.0,
        'Method hybrid: scale at which images are judged; 1: as they are; 0: so that the step has '
        'as many pixels as the speed allows.',
        0.0,
        1.0,
        smallest=0.05,
    )

    min_disparity: int = _parameter(
        0, 'Smallest disparity searched (px; hybrid: in the coarse match).', -1024, 1024
    )
    disparity_range: int = _parameter(
        0,
        'Disparities searched (px, multiple of 16; hybrid: in the coarse match); 0: from the '
        'camera and min_range (study: 48).',
        0,
        1024,
        step=16,
    )
    correlation_window_size: int = _parameter(
        -1,
        "Side of the matching block (px, odd); -1: the method's default (hybrid 3, study 5).",
        -1,
        21,
        step=2,
    )
    P1: float = _parameter(
        0.0,
        "SGBM penalty on a disparity change of 1; 0: the method's default (hybrid: from the "
        "image's contrast and noise, study: 600).",
        0.0,
        100000.0,
        smallest=1.0,
    )
    P2: float = _parameter(
        0.0,
        "SGBM penalty on a larger disparity change; 0: the method's default "
        "(hybrid: from the image's contrast and noise, study: 2400).",
        0.0,
        100000.0,
        smallest=2.0,
    )
    uniqueness_ratio: float = _parameter(
        8.0, 'Margin by which the best match must beat the second best (%).', 0.0, 99.0
    )
    speckle_size: int = _parameter(
        50, 'Smaller patches of disparity are removed as speckle (px).', 0, 10000
    )
    speckle_range: int = _parameter(2, 'Disparity variation within a patch (px).', 1, 31)
    disp12_max_diff: int = _parameter(
        1, 'Largest difference in the left-right check (px); below 0: no check.', -1, 128
    )
    prefilter_cap: int = _parameter(63, 'Truncation of the prefiltered image.', 1, 63)
    sgbm_mode: int = _parameter(2, '0 SGBM, 1 HH, 2 SGBM_3WAY, 3 HH4.', 0, 3)
    equalize_histogram: bool = _parameter(
        False, 'Equalise the histograms before matching (study section 3.3).'
    )

    smoothness: float = _parameter(
        1.0,
        "Method hybrid: factor on the penalties that follow from the image's contrast and noise "
        '(where P1 and P2 are 0).',
        0.05,
        20.0,
    )
    core_share: float = _parameter(
        1.0, 'Method hybrid: share of max_step that a rock has to rise above.', 0.3, 2.0
    )
    core_noises: float = _parameter(
        0.7,
        'Method hybrid: standard deviations of its height noise that a rock has to rise above.',
        0.0,
        10.0,
    )
    outline_probability: float = _parameter(
        0.5, 'Method hybrid: network probability from which a pixel is on a rock.', 0.05, 0.95
    )

    min_confidence: float = _parameter(
        0.9,
        'Method hybrid: specks of steep or low ground with less confidence than this are unknown '
        'instead of obstacles; 0: all are obstacles.',
        0.0,
        1.0,
    )

    ground_cell: float = _parameter(
        0.05,
        'Side of the square cells of the ground that have one point each in ground_points (m); '
        '0: a point for each pixel.',
        0.0,
        10.0,
        smallest=0.005,
    )
    grid_cell: float = _parameter(
        0.10, 'Side of the square cells of obstacle_grid (m).', 0.01, 10.0
    )
    grid_extent: float = _parameter(
        10.0,
        'Length of obstacle_grid ahead of the camera (m); it reaches half as far to either side. '
        'At most 1000 cells.',
        0.1,
        100.0,
    )

    mean_shift_spatial_radius: float = _parameter(
        15.0, 'Method study and debug topics: mean-shift spatial bandwidth (px).', 1.0, 100.0
    )
    mean_shift_color_radius: float = _parameter(
        20.0, 'Method study and debug topics: mean-shift grey-level bandwidth.', 1.0, 100.0
    )
    min_region_size: int = _parameter(
        50,
        'Method study and debug topics: smaller regions are merged into a neighbour (px).',
        1,
        100000,
    )
    min_seed_points: int = _parameter(
        10, 'Method study and debug topics: fewest 3D points of a seed region (T1).', 3, 100000
    )
    window_size: int = _parameter(
        5,
        'Method study and debug topics: side of the window for roughness and elevation step '
        '(px, odd).',
        3,
        31,
        step=2,
    )
    study_max_roughness: float = _parameter(
        0.0005,
        'Method study: roughness above which a window is an obstacle, besides noise (T2, m).',
        0.0,
        1.0,
    )
    study_max_step: float = _parameter(
        0.005,
        'Method study: elevation step above which a window is an obstacle, besides noise (T3, m).',
        0.0,
        1.0,
    )
    dark_grey_level: int = _parameter(
        50,
        'Method study: mean grey level below which a region without enough 3D points is an '
        'obstacle (T4).',
        0,
        255,
    )
    morphology_size: int = _parameter(
        7, 'Method study: diameter of the elliptical kernel (px, odd).', 1, 51, step=2
    )
    morphology_iterations: int = _parameter(2, 'Method study: closings, then openings.', 0, 10)

    def __post_init__(self) -> None:
        for description in self.parameters():
            description.check(getattr(self, description.name))
        if self.max_range <= self.min_range:
            msg = f'max_range is {self.max_range}: expected more than min_range, {self.min_range}'
            raise ConfigurationError(msg)
        if self.grid_extent > MAX_GRID_CELLS * self.grid_cell:
            msg = (
                f'grid_extent is {self.grid_extent}: expected at most {MAX_GRID_CELLS} times '
                f'grid_cell, {self.grid_cell}'
            )
            raise ConfigurationError(msg)
        if self.P1 and self.P2 and self.P2 <= self.P1:
            msg = f'P2 is {self.P2}: expected more than P1, {self.P1}'
            raise ConfigurationError(msg)

    @property
    def without_effect(self) -> str | None:
        """What the user should know of parameters that are set and change nothing."""
        names = [each for each in ('camera_pitch', 'camera_roll') if getattr(self, each)]
        if not names or self.gravity_source == 'parameters':
            return None
        return (
            f'{" and ".join(names)} will have no effect, since gravity_source is '
            f'{self.gravity_source!r}: set it to parameters to use them'
        )

    @property
    def block_size(self) -> int:
        """Side of the matching block, pixels."""
        if self.correlation_window_size > 0:
            return self.correlation_window_size
        return BLOCK_SIZES[self.method]

    @classmethod
    def parameters(cls) -> tuple[ParameterDescription, ...]:
        """List every parameter with its default, range and meaning."""
        return tuple(
            ParameterDescription(each.name, cast(Value, each.default), **each.metadata)
            for each in fields(cls)
        )
