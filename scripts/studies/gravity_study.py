"""Detection with known and with estimated gravity, and the error of the estimate."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.results import mean_scene_iou, total
from rover_obstacle_detection.evaluation.tables import NONE, Table, found_of, number
from rover_obstacle_detection.evaluation.vertical import angles_deg

_HEADER = (
    'IoU known',
    'IoU estimated',
    'difference',
    'obstacles known',
    'false alarms known',
    'obstacles estimated',
    'false alarms estimated',
)


@dataclass(frozen=True)
class GravityFrame:
    """Figures of a frame with known and with estimated gravity.

    Parameters
    ----------
    known, estimated : Figures
    pitch_deg, roll_deg : float
        True camera angles.
    pitch_error_deg, roll_error_deg : float
        Estimated minus true: positive where the camera is taken to look further down, or to lean
        further right, than it does.
    """

    known: Figures
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
    def known(self) -> Figures:
        """Figures with known gravity, pooled over the frames."""
        return total(frame.known for frame in self.frames)

    @property
    def estimated(self) -> Figures:
        """Figures with estimated gravity, pooled over the frames."""
        return total(frame.estimated for frame in self.frames)


def compare_gravity(
    frame: LabelledFrame, config: DetectorConfig, height_m: float | None = None
) -> GravityFrame | None:
    """Run the detector with known and with estimated gravity; None without a true vertical.

    Parameters
    ----------
    frame : LabelledFrame
    config : DetectorConfig
    height_m : float, optional
        True height of the left camera above the ground.
    """
    if frame.gravity is None:
        return None
    pitch_deg, roll_deg = angles_deg(frame.gravity.up)
    with_known = replace(
        config,
        gravity_source='parameters',
        camera_pitch=pitch_deg,
        camera_roll=roll_deg,
        camera_height=height_m or 0.0,
    )
    with_estimate = replace(config, gravity_source='estimate')
    known, estimated = (
        Detector(frame.camera, each).detect(frame.left, frame.right)
        for each in (with_known, with_estimate)
    )
    estimated_pitch_deg, estimated_roll_deg = angles_deg(estimated.ground.up)
    return GravityFrame(
        known=score(known.mask, frame.labels, frame.instances),
        estimated=score(estimated.mask, frame.labels, frame.instances),
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        pitch_error_deg=estimated_pitch_deg - pitch_deg,
        roll_error_deg=estimated_roll_deg - roll_deg,
    )


def gravity_table(groups: Mapping[str, Sequence[SceneGravity]]) -> Table:
    """Tabulate groups of scenes, with the mean absolute error of the estimated pitch."""
    rows = []
    for name, scenes in groups.items():
        ious = (
            mean_scene_iou(scene.known for scene in scenes),
            mean_scene_iou(scene.estimated for scene in scenes),
        )
        pooled = total(scene.known for scene in scenes), total(scene.estimated for scene in scenes)
        errors = [abs(frame.pitch_error_deg) for scene in scenes for frame in scene.frames]
        error = number(statistics.fmean(errors) if errors else None, 1)
        rows.append((name, str(len(scenes)), *_cells(*ious, *pooled), error))
    header = ('scenes', 'number', *_HEADER, 'pitch error (deg)')
    return Table('Known and estimated gravity', header, rows)


def gravity_scene_table(scenes: Sequence[SceneGravity]) -> Table:
    """Tabulate scenes, with the true angles and the errors in the worst frame."""
    rows = []
    for scene in scenes:
        worst = max(scene.frames, key=lambda frame: abs(frame.pitch_error_deg), default=None)
        if worst is None:
            continue
        ious = mean_scene_iou([scene.known]), mean_scene_iou([scene.estimated])
        rows.append(
            (
                scene.scene,
                *_cells(*ious, scene.known, scene.estimated),
                f'{worst.pitch_deg:.1f}',
                f'{worst.pitch_error_deg:+.1f}',
                f'{worst.roll_deg:.1f}',
                f'{worst.roll_error_deg:+.1f}',
            )
        )
    header = ('scene', *_HEADER, 'pitch (deg)', 'pitch error', 'roll (deg)', 'roll error')
    return Table('Known and estimated gravity, by scene', header, rows)


def _cells(
    known_iou: float | None, estimated_iou: float | None, known: Figures, estimated: Figures
) -> tuple[str, ...]:
    both = known_iou is not None and estimated_iou is not None
    return (
        number(known_iou),
        number(estimated_iou),
        f'{known_iou - estimated_iou:+.3f}' if both else NONE,
        found_of(known),
        number(known.false_alarms_per_frame, 2),
        found_of(estimated),
        number(estimated.false_alarms_per_frame, 2),
    )
