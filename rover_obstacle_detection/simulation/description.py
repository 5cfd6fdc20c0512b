"""Description of a scene: every parameter, with its range and meaning."""

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
"""Longer drives need too many rocks and reach the hills."""

_RIG_OVERRIDES = ('pitch_deg', 'camera_height_m', 'baseline_m', 'horizontal_view_deg')


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
    """Base of dataclasses that check their described fields when created."""

    def __post_init__(self) -> None:
        for item in fields(self):  # type: ignore[arg-type]
            if item.metadata:
                description = ParameterDescription(item.name, item.default, **item.metadata)  # type: ignore[arg-type]
                description.check(getattr(self, item.name))


@dataclass(frozen=True)
class Crater(_Checked):
    """A bowl with a raised rim, positioned relative to the start of the drive."""

    ahead_m: float = _parameter(2.0, 'Distance of the centre ahead (m).', -100, 100)
    left_m: float = _parameter(0.0, 'Distance of the centre to the left (m).', -100, 100)
    diameter_m: float = _parameter(1.6, 'Diameter at the rim (m).', 0.1, 100)
    depth_m: float = _parameter(0.35, 'Depth of the centre below the plain (m).', 0.0, 20)


@dataclass(frozen=True)
class Step(_Checked):
    """A step, trench or ridge with an irregular edge, positioned relative to the start."""

    ahead_m: float = _parameter(2.0, 'Distance ahead at which the edge is crossed (m).', -100, 100)
    turn_deg: float = _parameter(
        0.0, 'Direction across the edge: 0 ahead, 90 left (deg).', -180.0, 180.0
    )
    rise_m: float = _parameter(0.25, 'Height beyond the edge; down negative (m).', -5.0, 5.0)
    run_m: float = _parameter(0.04, 'Horizontal width of the face (m).', 0.005, 5.0)
    width_m: float = _parameter(
        0.0, 'Distance to the opposite face of a trench or ridge (m); 0: none.', 0.0, 50.0
    )
    waviness_m: float = _parameter(0.06, 'RMS irregularity of the edge (m).', 0.0, 1.0)


@dataclass(frozen=True)
class TerrainParameters(_Checked):
    """Shape of the ground without rocks."""

    relief_m: float = _parameter(0.022, 'RMS relief, wavelengths 1 to 12 m (m).', 0.0, 1.0)
    roughness_m: float = _parameter(0.005, 'RMS relief, wavelengths 0.1 to 1.2 m (m).', 0.0, 0.1)
    clods_m: float = _parameter(0.0025, 'RMS height of clods, a few cm wide (m).', 0.0, 0.02)
    hills_m: float = _parameter(4.0, 'RMS height of hills, from 25 m away (m).', 0.0, 50.0)
    slope_deg: float = _parameter(
        0.0, 'Slope of a ramp ahead; uphill positive (deg).', -45.0, 45.0
    )
    slope_start_m: float = _parameter(1.0, 'Distance to the foot of the ramp (m).', -100.0, 100.0)
    slope_length_m: float = _parameter(8.0, 'Length of the ramp (m).', 0.5, 100.0)
    slope_turn_deg: float = _parameter(
        0.0, 'Ramp direction: 0 ahead, 90 left (deg).', -180.0, 180.0
    )
    dune_height_m: float = _parameter(0.0, 'Height of dunes, trough to crest (m).', 0.0, 5.0)
    dune_length_m: float = _parameter(6.0, 'Distance between dune crests (m).', 0.5, 100.0)
    ripple_height_m: float = _parameter(0.0, 'Height of ripples, trough to crest (m).', 0.0, 0.2)
    ripple_length_m: float = _parameter(0.3, 'Distance between ripple crests (m).', 0.05, 5.0)
    craters: tuple[Crater, ...] = ()
    steps: tuple[Step, ...] = ()
    plate_size_m: float = _parameter(0.0, 'Size of plates in the ground (m); 0: none.', 0.0, 5.0)
    plate_cover: float = _parameter(1.0, 'Fraction of the plates above the soil.', 0.0, 1.0)
    plate_height_m: float = _parameter(0.0, 'Greatest height of the plates (m).', 0.0, 1.0)
    plate_tilt_deg: float = _parameter(0.0, 'RMS tilt of the plates (deg).', 0.0, 20.0)
    crack_width_m: float = _parameter(0.02, 'Width of cracks between plates (m).', 0.002, 0.5)
    crack_depth_m: float = _parameter(0.02, 'Depth of cracks between plates (m).', 0.0, 0.5)
    layer_m: float = _parameter(
        0.0, 'Thickness of layers that crop out as ledges (m); 0: none.', 0.0, 1.0
    )
    layer_relief_m: float = _parameter(
        0.15, 'RMS relief of the layered ground, wavelengths 0.3 to 5 m (m).', 0.0, 2.0
    )
    track_depth_m: float = _parameter(0.0, 'Depth of wheel tracks (m); 0: none.', 0.0, 0.2)
    track_width_m: float = _parameter(0.14, 'Width of one wheel track (m).', 0.03, 0.6)
    track_gauge_m: float = _parameter(0.8, 'Distance between the two wheel tracks (m).', 0.1, 5.0)
    track_left_m: float = _parameter(
        0.0, 'Distance of the middle of the tracks to the left (m).', -20.0, 20.0
    )
    track_turn_deg: float = _parameter(
        0.0, 'Direction of the tracks: 0 ahead, 90 left (deg).', -180.0, 180.0
    )


@dataclass(frozen=True)
class RockParameters(_Checked):
    """Rocks: sizes after Golombek and Rapp (1997), plus some placed in view."""

    cover: float = _parameter(0.05, 'Fraction k of the ground covered by rocks.', 0.0, 0.6)
    smallest_m: float = _parameter(0.012, 'Smallest diameter (m).', 0.004, 1.0)
    largest_m: float = _parameter(0.7, 'Largest diameter (m).', 0.01, 5.0)
    pebble_cover: float = _parameter(
        0.0, 'Fraction of the ground covered by pebbles of 1 to 5 cm.', 0.0, 0.6
    )
    placed: int = _parameter(7, 'Extra rocks placed in the first view.', 0, 200)
    placed_smallest_m: float = _parameter(
        0.24, 'Smallest diameter of placed rocks (m).', 0.02, 5.0
    )
    placed_largest_m: float = _parameter(0.5, 'Largest diameter of placed rocks (m).', 0.02, 5.0)
    angular: float = _parameter(0.0, 'Fraction of rocks with few, flat, sharp faces.', 0.0, 1.0)
    slabs: float = _parameter(0.0, 'Fraction of rocks that are thin upright plates.', 0.0, 1.0)
    tone: float = _parameter(1.0, 'Reflectance of rocks relative to the default.', 0.1, 3.0)
    dust: float = _parameter(1.0, 'Dust on rocks relative to the default.', 0.0, 2.0)


@dataclass(frozen=True)
class SoilParameters(_Checked):
    """Appearance of ground and rocks."""

    world: str = _parameter('mars', 'Colours of soil, rocks and sky.', choices=('mars', 'moon'))
    contrast: float = _parameter(1.0, 'Soil texture: 1 strong, 0.1 almost none.', 0.0, 2.0)
    grain_m: float = _parameter(0.0006, 'RMS height of grain, for shading only (m).', 0.0, 0.005)
    patch_cover: float = _parameter(
        0.0, 'Fraction of the ground in sharp-edged patches of another tone.', 0.0, 1.0
    )
    patch_tone: float = _parameter(0.45, 'Reflectance of patches over other soil.', 0.1, 3.0)


@dataclass(frozen=True)
class LightParameters(_Checked):
    """Sun and sky."""

    sun_elevation_deg: float = _parameter(
        55.0, 'Sun elevation above the horizon (deg).', 2.0, 90.0
    )
    sun_azimuth_deg: float = _parameter(
        70.0,
        'Azimuth of the sun: 0 ahead (shadows towards the rover), 90 left, 180 behind (deg).',
        -180.0,
        360.0,
    )
    sky: float = _parameter(
        0.3,
        'Ratio of skylight to sunlight on level ground at noon. Skylight fades with a low sun.',
        0.0,
        5.0,
    )
    haze_m: float = _parameter(
        900.0, 'Distance at which haze cuts contrast to 1/e (m).', 10.0, 1e6
    )
    shade_m: float = _parameter(
        0.0, 'Diameter of a shadow cast from outside the view (m); 0: none.', 0.0, 50.0
    )
    shade_ahead_m: float = _parameter(2.0, 'Distance ahead of its centre (m).', -100.0, 100.0)
    shade_left_m: float = _parameter(0.0, 'Distance of its centre to the left (m).', -100.0, 100.0)


@dataclass(frozen=True)
class SensorParameters(_Checked):
    """Lens, exposure, noise and quantisation."""

    bits: int = _parameter(8, 'Bits per pixel: 8, or 9 to 16 in mono16.', 8, 16)
    blur_px: float = _parameter(0.5, 'Standard deviation of the lens blur (px).', 0.0, 10.0)
    motion_blur_px: float = _parameter(0.0, 'Length of the motion blur (px).', 0.0, 100.0)
    motion_blur_deg: float = _parameter(
        90.0, 'Direction of the motion blur: 0 along rows, 90 along columns (deg).', -180.0, 180.0
    )
    vignetting: float = _parameter(0.25, 'Fraction of light lost in the image corners.', 0.0, 1.0)
    exposure: float = _parameter(1.0, 'Exposure relative to the automatic exposure.', 0.01, 20.0)
    right_gain: float = _parameter(1.0, 'Exposure of the right image over the left.', 0.1, 10.0)
    right_blur_px: float = _parameter(
        0.0, 'Additional lens blur of the right image (px).', 0.0, 10.0
    )
    full_well: float = _parameter(12000.0, 'Electrons at full scale, for shot noise.', 50.0, 1e6)
    read_noise: float = _parameter(10.0, 'Read noise (electrons).', 0.0, 1000.0)
    glare: float = _parameter(0.0, 'Stray light, as a fraction of the mean light.', 0.0, 2.0)
    dust_spots: int = _parameter(0, 'Dust spots on each lens.', 0, 500)
    row_error_px: float = _parameter(0.0, 'Upward offset of the right image (px).', -5.0, 5.0)
    roll_error_deg: float = _parameter(0.0, 'Roll of the right image (deg).', -2.0, 2.0)
    gamma: float = _parameter(2.2, 'Exponent of the tone curve; 1: linear.', 1.0, 4.0)
    sharpening: float = _parameter(0.0, 'Strength of sharpening in the camera.', 0.0, 5.0)
    jpeg_quality: int = _parameter(
        0, 'Quality of JPEG compression, 1 to 100, of 8-bit images; 0: none.', 0, 100
    )
    samples: int = _parameter(16, 'Light paths per pixel, a square number.', 1, 1024)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.jpeg_quality and self.bits > 8:
            msg = f'jpeg_quality is {self.jpeg_quality}: expected 0 for {self.bits} bits'
            raise ConfigurationError(msg)


@dataclass(frozen=True)
class DriveParameters(_Checked):
    """Motion of the rover between stereo pairs."""

    frames: int = _parameter(1, 'Number of stereo pairs.', 1, 10000)
    step_m: float = _parameter(0.1, 'Distance between pairs (m).', 0.0, 5.0)
    turn_deg: float = _parameter(0.0, 'Left turn between pairs (deg).', -45.0, 45.0)
    period_s: float = _parameter(0.5, 'Time between pairs (s).', 0.001, 3600.0)


@dataclass(frozen=True)
class TruthParameters(_Checked):
    """Limits that define an obstacle in the labels."""

    clearance_m: float = _parameter(0.10, 'Rocks higher than this are obstacles (m).', 0.01, 2.0)
    slope_limit_deg: float = _parameter(20.0, 'Steeper ground is an obstacle (deg).', 1.0, 60.0)
    drop_m: float = _parameter(
        0.10, 'Ground this far below its surroundings is an obstacle (m).', 0.01, 2.0
    )
    range_m: float = _parameter(40.0, 'Greatest labelled depth (m).', 1.0, 200.0)


@dataclass(frozen=True)
class Scene(_Checked):
    """All inputs of a labelled bag. Equal scenes give equal bags."""

    name: str
    seed: int = _parameter(1, 'Random seed.', 0, 2**31 - 1)
    conditions: tuple[str, ...] = ()
    rig: str = _parameter('study', 'Stereo camera.', choices=tuple(RIGS))
    width: int = _parameter(0, 'Image width (px); 0: as the rig.', 0, 4096)
    pitch_deg: float = _parameter(0.0, 'Pitch below the horizon (deg); 0: as the rig.', 0.0, 89.0)
    camera_height_m: float = _parameter(
        0.0, 'Height of the left camera (m); 0: as the rig.', 0.0, 10.0
    )
    baseline_m: float = _parameter(0.0, 'Baseline (m); 0: as the rig.', 0.0, 2.0)
    horizontal_view_deg: float = _parameter(
        0.0, 'Horizontal field of view (deg); 0: as the rig.', 0.0, 150.0
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
        """Make a scene from nested mappings, as in a suite file.

        Raises
        ------
        ConfigurationError
            If a parameter is unknown, has the wrong type or is out of range.
        """
        scene: Scene = _build(cls, mapping, '')
        return scene

    def to_mapping(self) -> dict[str, Any]:
        """Return nested plain mappings, the inverse of `from_mapping`."""
        return asdict(self)

    def rig_used(self) -> Rig:
        """Return the rig with the overrides of this scene."""
        overrides = {name: getattr(self, name) for name in _RIG_OVERRIDES if getattr(self, name)}
        return replace(RIGS[self.rig], **overrides)

    @property
    def image_width(self) -> int:
        """Image width, pixels."""
        return self.width or RIGS[self.rig].width


def parameters_of(kind: type, prefix: str = '') -> Iterator[ParameterDescription]:
    """Yield the description of every scene parameter, by dotted name."""
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
        msg = f'{where.removesuffix(".") or "scene"} is {mapping!r}: expected named parameters'
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
        msg = f'{where.removesuffix(".") or "scene"}: {error}'
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
