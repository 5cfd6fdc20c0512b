"""What it is worth to be told the vertical, and how well it is estimated."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.results import mean_scene_iou, total
from rover_obstacle_detection.evaluation.tables import NONE, Table
from rover_obstacle_detection.evaluation.vertical import angles_deg


@dataclass(frozen=True)
class GravityFrame:
    """A frame with the vertical told and with the vertical estimated.

    Parameters
    ----------
    told, estimated : Figures
    pitch_deg, roll_deg : float
        True ones.
    pitch_error_deg, roll_error_deg : float
        Of the estimate: positive where it looks down more, or leans more to the right.
    """

    told: Figures
    estimated: Figures
    pitch_deg: float
    roll_deg: float
    pitch_error_deg: float
    roll_error_deg: float


@dataclass(frozen=True)
class SceneGravity:
    """All frames of a scene."""

    scene: str
    conditions: tuple[str, ...]
    frames: tuple[GravityFrame, ...]

    @property
    def told(self) -> Figures:
        """Pooled over the frames."""
        return total(frame.told for frame in self.frames)

    @property
    def estimated(self) -> Figures:
        """Pooled over the frames."""
        return total(frame.estimated for frame in self.frames)


def compare_gravity(
    frame: LabelledFrame, config: DetectorConfig, height_m: float | None = None
) -> GravityFrame | None:
    """Run the detector twice; None where the true vertical is not known.

    Parameters
    ----------
    frame : LabelledFrame
    config : DetectorConfig
    height_m : float, optional
        True height of the left eye over the ground.
    """
    if frame.gravity is None:
        return None
    pitch_deg, roll_deg = angles_deg(frame.gravity.up)
    knowing = replace(
        config,
        gravity_source='parameters',
        camera_pitch=pitch_deg,
        camera_roll=roll_deg,
        camera_height=height_m or 0.0,
    )
    guessing = replace(config, gravity_source='estimate')
    told, estimated = (
        Detector(frame.camera, each).detect(frame.left, frame.right)
        for each in (knowing, guessing)
    )
    estimated_pitch_deg, estimated_roll_deg = angles_deg(estimated.ground.up)
    return GravityFrame(
        told=score(told.mask, frame.labels, frame.instances),
        estimated=score(estimated.mask, frame.labels, frame.instances),
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        pitch_error_deg=estimated_pitch_deg - pitch_deg,
        roll_error_deg=estimated_roll_deg - roll_deg,
    )


def gravity_table(groups: Mapping[str, Sequence[SceneGravity]]) -> Table:
    """Tabulate groups of scenes: mean IoU with the vertical told and estimated."""
    rows = []
    for name, scenes in groups.items():
        told = mean_scene_iou(scene.told for scene in scenes)
        estimated = mean_scene_iou(scene.estimated for scene in scenes)
        off = [abs(frame.pitch_error_deg) for scene in scenes for frame in scene.frames]
        rows.append(
            (
                name,
                str(len(scenes)),
                *_ious(told, estimated),
                *_found_and_alarms(total(scene.told for scene in scenes)),
                *_found_and_alarms(total(scene.estimated for scene in scenes)),
                f'{statistics.fmean(off):.1f}' if off else NONE,
            )
        )
    return Table('Vertical told and estimated', ('scenes', 'number', *_HEADER, _OFF), rows)


def gravity_scene_table(scenes: Sequence[SceneGravity]) -> Table:
    """Tabulate scenes, with the true pitch and roll and how far off the estimate is."""
    rows = []
    for scene in scenes:
        worst = max(scene.frames, key=lambda frame: abs(frame.pitch_error_deg), default=None)
        if worst is None:
            continue
        angles = (
            f'{worst.pitch_deg:.1f}',
            f'{worst.pitch_error_deg:+.1f}',
            f'{worst.roll_deg:.1f}',
            f'{worst.roll_error_deg:+.1f}',
        )
        rows.append(
            (
                scene.scene,
                *_ious(_iou(scene.told), _iou(scene.estimated)),
                *_found_and_alarms(scene.told),
                *_found_and_alarms(scene.estimated),
                *angles,
            )
        )
    header = ('scene', *_HEADER, 'pitch (deg)', 'its error', 'roll (deg)', 'its error')
    return Table('Vertical told and estimated, by scene', header, rows)


_HEADER = (
    'IoU told',
    'IoU estimated',
    'difference',
    'obstacles told',
    'false alarms told',
    'obstacles estimated',
    'false alarms estimated',
)
_OFF = 'pitch off by (deg)'


def _iou(figures: Figures) -> float | None:
    return figures.iou if figures.obstacle_pixels else None


def _ious(told: float | None, estimated: float | None) -> tuple[str, str, str]:
    if told is None or estimated is None:
        return NONE, NONE, NONE
    return f'{told:.3f}', f'{estimated:.3f}', f'{told - estimated:+.3f}'


def _found_and_alarms(figures: Figures) -> tuple[str, str]:
    alarms = figures.false_alarms_per_frame
    found = f'{figures.obstacles_found}/{figures.obstacles}'
    return found, NONE if alarms is None else f'{alarms:.2f}'
