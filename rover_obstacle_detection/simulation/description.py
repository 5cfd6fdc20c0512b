"""What a scene is: one frozen value with every parameter, its range and its meaning."""

from __future__ import annotations

import difflib
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from typing import Any

from rover_obstacle_detection.detection.config import ParameterDescription
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.simulation.rigs import RIGS, Rig

LONGEST_DRIVE_M = 100.0
_OF_THE_RIG = ('pitch_deg', 'camera_height_m', 'baseline_m', 'horizontal_view_deg')


def _parameter(
    default: Any,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    *,
    choices: tuple[str, ...] = (),
) -> Any:
    metadata = {
        'description': description,
        'minimum': minimum,
        'maximum': maximum,
        'choices': choices,
    }
    return field(default=default, metadata=metadata)


class _Checked:
    """Fields with a description are checked against it."""

    def __post_init__(self) -> None:
        for item in fields(self):  # type: ignore[arg-type]
            if item.metadata:
                description = ParameterDescription(item.name, item.default, **item.metadata)  # type: ignore[arg-type]
                description.check(getattr(self, item.name))


@dataclass(frozen=True)
class Crater(_Checked):
    """A bowl with a raised rim; its place is given from the rover's start."""

    ahead_m: float = _parameter(2.0, 'Distance of the centre ahead (m).', -100, 100)
    left_m: float = _parameter(0.0, 'Distance of the centre to the left (m).', -100, 100)
    diameter_m: float = _parameter(1.6, 'Diameter at the rim (m).', 0.1, 100)
    depth_m: float = _parameter(0.35, 'Depth of the centre under the plain (m).', 0.0, 20)


@dataclass(frozen=True)
class TerrainParameters(_Checked):
    """The shape of the ground without rocks."""

    relief_m: float = _parameter(
        0.022, 'RMS height of undulation with wavelengths of 1 to 12 m (m).', 0.0, 1.0
    )
    roughness_m: float = _parameter(
        0.005, 'RMS height of undulation with wavelengths of 0.1 to 1.2 m (m).', 0.0, 0.1
    )
    clods_m: float = _parameter(
        0.0025, 'RMS height of clods a few centimetres wide, in patches (m).', 0.0, 0.02
    )
    hills_m: float = _parameter(
        4.0, 'RMS height of hills that begin 25 m from the rover (m).', 0.0, 50.0
    )
    slope_deg: float = _parameter(
        0.0, 'Slope of a ramp ahead, upward if positive (deg).', -45.0, 45.0
    )
    slope_start_m: float = _parameter(1.0, 'Where the ramp begins ahead (m).', -100.0, 100.0)
    slope_length_m: float = _parameter(8.0, 'Length of the ramp (m).', 0.5, 100.0)
    slope_turn_deg: float = _parameter(
        0.0, 'Turn of the ramp from straight ahead to the left (deg).', -180.0, 180.0
    )
    dune_height_m: float = _parameter(0.0, 'Height of dunes, trough to crest (m).', 0.0, 5.0)
    dune_length_m: float = _parameter(6.0, 'Distance of dune crests (m).', 0.5, 100.0)
    ripple_height_m: float = _parameter(
        0.0, 'Height of wind ripples, trough to crest (m).', 0.0, 0.2
    )
    ripple_length_m: float = _parameter(0.3, 'Distance of ripple crests (m).', 0.05, 5.0)
    craters: tuple[Crater, ...] = ()


@dataclass(frozen=True)
class RockParameters(_Checked):
    """Rocks after Golombek and Rapp 1997, and some put in view on purpose."""

    cover: float = _parameter(
        0.05, 'Fraction k of the ground covered by rocks of all sizes.', 0.0, 0.6
    )
    smallest_m: float = _parameter(0.012, 'Smallest diameter drawn (m).', 0.004, 1.0)
    largest_m: float = _parameter(0.7, 'Largest diameter drawn (m).', 0.01, 5.0)
    pebble_cover: float = _parameter(
        0.0, 'Fraction of the ground covered by further pebbles of 1 to 5 cm.', 0.0, 0.6
    )
    placed: int = _parameter(7, 'Further rocks spread over the first view.', 0, 200)
    placed_smallest_m: float = _parameter(0.24, 'Smallest diameter of those (m).', 0.02, 5.0)
    placed_largest_m: float = _parameter(0.5, 'Largest diameter of those (m).', 0.02, 5.0)


@dataclass(frozen=True)
class SoilParameters(_Checked):
    """How ground and rocks look."""

    world: str = _parameter('mars', 'Colours of soil, rocks and sky.', choices=('mars', 'moon'))
    contrast: float = _parameter(
        1.0, 'Strength of the soil texture: 1 rich, 0.1 almost none.', 0.0, 2.0
    )
    grain_m: float = _parameter(
        0.0006, 'RMS height of the grain that the light brings out (m).', 0.0, 0.005
    )


@dataclass(frozen=True)
class LightParameters(_Checked):
    """The sun and the sky."""

    sun_elevation_deg: float = _parameter(
        55.0, 'Height of the sun above the horizon (deg).', 2.0, 90.0
    )
    sun_azimuth_deg: float = _parameter(
        70.0,
        'Where the sun stands: 0 straight ahead (shadows towards the rover), 90 left, '
        '180 behind (deg).',
        -180.0,
        360.0,
    )
    sky: float = _parameter(
        0.3,
        'Light of the dusty sky on level ground over that of the sun, both at noon; '
        'it fades with the sun.',
        0.0,
        5.0,
    )
    haze_m: float = _parameter(
        900.0, 'Distance at which dusty air hides two thirds of what is behind (m).', 10.0, 1e6
    )


@dataclass(frozen=True)
class SensorParameters(_Checked):
    """From the light at the sensor to the published image."""

    bits: int = _parameter(8, 'Bits a pixel: 8, or 9 to 16 in mono16.', 8, 16)
    blur_px: float = _parameter(0.5, 'Standard deviation of the lens blur (px).', 0.0, 10.0)
    motion_blur_px: float = _parameter(0.0, 'Length of the motion blur (px).', 0.0, 100.0)
    motion_blur_deg: float = _parameter(
        90.0, 'Direction of the motion blur: 0 along rows, 90 along columns (deg).', -180.0, 180.0
    )
    vignetting: float = _parameter(0.25, 'Loss of light in the corners of the image.', 0.0, 1.0)
    exposure: float = _parameter(1.0, 'Exposure over that of the automatic exposure.', 0.01, 20.0)
    right_gain: float = _parameter(1.0, "The right eye's exposure over the left one's.", 0.1, 10.0)
    full_well: float = _parameter(
        12000.0, 'Electrons at full scale: sets the shot noise.', 50.0, 1e6
    )
    read_noise: float = _parameter(10.0, 'Read noise (electrons).', 0.0, 1000.0)
    glare: float = _parameter(
        0.0, 'Light scattered in the lens over the mean light of the image.', 0.0, 2.0
    )
    dust_spots: int = _parameter(0, 'Dark soft spots on each lens.', 0, 500)
    row_error_px: float = _parameter(
        0.0, 'How much too high the right image sits (px).', -5.0, 5.0
    )
    roll_error_deg: float = _parameter(
        0.0, 'How much the right image is turned about its centre (deg).', -2.0, 2.0
    )
    samples: int = _parameter(16, 'Light paths a pixel, a square number.', 1, 1024)


@dataclass(frozen=True)
class DriveParameters(_Checked):
    """How the rover moves; one frame stands still."""

    frames: int = _parameter(1, 'Stereo pairs.', 1, 10000)
    step_m: float = _parameter(0.1, 'Way between two pairs (m).', 0.0, 5.0)
    turn_deg: float = _parameter(0.0, 'Turn to the left between two pairs (deg).', -45.0, 45.0)
    period_s: float = _parameter(0.5, 'Time between two pairs (s).', 0.001, 3600.0)


@dataclass(frozen=True)
class TruthParameters(_Checked):
    """What the labels call an obstacle."""

    clearance_m: float = _parameter(
        0.10, 'Rocks taller than this above the local ground are obstacles (m).', 0.01, 2.0
    )
    slope_limit_deg: float = _parameter(
        20.0, 'Ground steeper than this is an obstacle (deg).', 1.0, 60.0
    )
    drop_m: float = _parameter(
        0.10, 'Ground further than this below its surroundings is an obstacle (m).', 0.01, 2.0
    )
    range_m: float = _parameter(
        40.0, 'Farthest distance along the optical axis that is labelled (m).', 1.0, 200.0
    )


@dataclass(frozen=True)
class Scene(_Checked):
    """Everything a labelled bag is made from: the same value always gives the same bag."""

    name: str
    seed: int = _parameter(1, 'Seed of everything drawn by chance.', 0, 2**31 - 1)
    conditions: tuple[str, ...] = ()
    rig: str = _parameter('study', 'Stereo camera.', choices=tuple(RIGS))
    width: int = _parameter(0, "Width of the images (px); 0: the rig's own.", 0, 4096)
    pitch_deg: float = _parameter(
        0.0, "The camera's angle below the horizon (deg); 0: the rig's own.", 0.0, 89.0
    )
    camera_height_m: float = _parameter(
        0.0, "Height of the left eye above the ground (m); 0: the rig's own.", 0.0, 10.0
    )
    baseline_m: float = _parameter(
        0.0, "Distance between the eyes (m); 0: the rig's own.", 0.0, 2.0
    )
    horizontal_view_deg: float = _parameter(
        0.0, "Horizontal field of view (deg); 0: the rig's own.", 0.0, 150.0
    )
    terrain: TerrainParameters = TerrainParameters()
    rocks: RockParameters = RockParameters()
    soil: SoilParameters = SoilParameters()
    light: LightParameters = LightParameters()
    sensor: SensorParameters = SensorParameters()
    drive: DriveParameters = DriveParameters()
    truth: TruthParameters = TruthParameters()

    def __post_init__(self) -> None:
        super().__post_init__()
        length_m = (self.drive.frames - 1) * self.drive.step_m
        if length_m > LONGEST_DRIVE_M:
            msg = f'the drive is {length_m:g} m long: expected at most {LONGEST_DRIVE_M:g} m'
            raise ConfigurationError(msg)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Scene:
        """Make a scene of nested mappings, as a suite file holds them.

        Raises
        ------
        ConfigurationError
            Naming the parameter, if one is unknown, of a wrong type or out of range.
        """
        scene: Scene = _build(cls, mapping, '')
        return scene

    def to_mapping(self) -> dict[str, Any]:
        """Return nested plain mappings that `from_mapping` makes the same scene of."""
        return asdict(self)

    def rig_used(self) -> Rig:
        """Return the rig with what this scene has of its own."""
        own = {name: getattr(self, name) for name in _OF_THE_RIG if getattr(self, name)}
        return replace(RIGS[self.rig], **own)

    @property
    def image_width(self) -> int:
        """Width of the images, pixels."""
        return self.width or RIGS[self.rig].width


def parameters_of(kind: type, prefix: str = '') -> Iterator[ParameterDescription]:
    """List the parameters of a scene by dotted name, for documentation and command line."""
    for item in fields(kind):
        if is_dataclass(item.default):
            yield from parameters_of(type(item.default), f'{prefix}{item.name}.')
        elif item.metadata:
            yield ParameterDescription(prefix + item.name, item.default, **item.metadata)  # type: ignore[arg-type]


def _build(kind: type, mapping: Mapping[str, Any], where: str) -> Any:
    known = {item.name: item for item in fields(kind)}
    hints = typing.get_type_hints(kind)
    values: dict[str, Any] = {}
    if not isinstance(mapping, Mapping):
        msg = f'{where or "scene"} is {mapping!r}: expected named parameters'
        raise ConfigurationError(msg)
    for name, value in mapping.items():
        if name not in known:
            near = difflib.get_close_matches(str(name), known, 1)
            hint = f'; did you mean {where}{near[0]}?' if near else ''
            msg = f'unknown scene parameter {where}{name}{hint}'
            raise ConfigurationError(msg)
        hint_type = hints[name]
        if is_dataclass(hint_type):
            value = _build(typing.cast(type, hint_type), value, f'{where}{name}.')
        elif isinstance(hint_type, types.GenericAlias):
            value = _build_tuple(hint_type, value, f'{where}{name}')
        elif hint_type is float and type(value) is int:
            value = float(value)
        values[name] = value
    try:
        return kind(**values)
    except TypeError as error:
        msg = f'{where or "scene"}: {error}'
        raise ConfigurationError(msg) from error


def _build_tuple(hint: types.GenericAlias, value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, (list, tuple)):
        msg = f'{where} is {value!r}: expected a list'
        raise ConfigurationError(msg)
    kind = hint.__args__[0]
    if is_dataclass(kind):
        return tuple(
            _build(typing.cast(type, kind), item, f'{where}[{index}].')
            for index, item in enumerate(value)
        )
    return tuple(str(item) for item in value)
