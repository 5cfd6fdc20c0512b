"""What to replay and what to write."""

from __future__ import annotations

from dataclasses import dataclass, field

from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.messages.raw_images import BY_NAME
from rover_obstacle_detection.rover_mask import RoverMask


@dataclass(frozen=True)
class ReplayOptions:
    """What to replay and what to write.

    Parameters
    ----------
    config : DetectorConfig
    rover : RoverMask, optional
        Pixels that show the rover itself.
    left_topic, right_topic : str, optional
        Image topics; found by name if omitted.
    side_by_side : bool
        The images of `left_topic` show both views side by side.
    rectify : str
        Which images are raw, one of `messages.raw_images.RECTIFY`.
    calibration : CalibrationRequest
        From the bag if nothing is given.
    tolerance_ns : int, optional
        Largest stamp difference of a pair; equal stamps are required if omitted.
    start_s, duration_s : float
        The part of the recording to replay, in seconds from its start.
    every : int
        Use every n-th pair.
    salvage : bool
        Replay the readable part of a damaged recording instead of refusing it.
    images : tuple of str
        The pictures of each pair to write, of `PICTURE_NAMES`.
    video : bool
        Write ``overlays.mp4``.
    report : bool
        Write ``report.html``.
    command_line : str
        Shown in the report.
    force : bool
        Replace the files of a previous run.
    """

    config: DetectorConfig
    rover: RoverMask | None = None
    left_topic: str | None = None
    right_topic: str | None = None
    side_by_side: bool = False
    rectify: str = BY_NAME
    calibration: CalibrationRequest = field(default_factory=CalibrationRequest)
    tolerance_ns: int | None = None
    start_s: float = 0.0
    duration_s: float | None = None
    every: int = 1
    salvage: bool = False
    images: tuple[str, ...] = ()
    video: bool = False
    report: bool = False
    command_line: str = ''
    force: bool = False
