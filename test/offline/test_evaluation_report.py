"""Descriptions of pictures in the report."""

from __future__ import annotations

from rover_obstacle_detection.evaluation.causes import Cause
from rover_obstacle_detection.evaluation.faults import Fault
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.losses import Losses
from rover_obstacle_detection.evaluation.results import FrameResult, Picture
from rover_obstacle_detection.offline.evaluation_report import summary_lines, summary_of

FAR = Cause('outside the judged range', 'max_range is 20 m')
FIGURES = Figures(frames=1, true_positives=60, false_negatives=30, rocks=9, rocks_found=2)
LOSSES = Losses(hit=60, missed=25, invented=0, too_wide=10, too_narrow=5, outline=20)


def picture(*faults: Fault, figures: Figures = FIGURES, remarks: tuple[str, ...] = ()) -> Picture:
    frame = FrameResult(0, figures, 0.2, 0.1, LOSSES, faults, remarks)
    return Picture('hybrid', 'one', frame, b'')


def test_the_first_line_lists_the_losses_of_iou() -> None:
    (line,) = summary_lines(picture())
    assert line == (
        'IoU 0.67 (lost: 25 % to obstacles missed, 10 % to outlines 0.5 px too wide, '
        '5 % to outlines 0.2 px too narrow), 2 of 9 obstacles found'
    )


def test_the_first_faults_are_listed_and_the_others_counted_by_cause() -> None:
    faults = [Fault('missed rock', 300 - number, 21.0, FAR) for number in range(6)]
    faults += [Fault('missed rock', 250, 22.0, FAR), Fault('false alarm', 120, None)]
    lines = summary_lines(picture(*faults, remarks=('pitch off by +3.0 degrees',)))
    assert lines[1] == 'pitch off by +3.0 degrees'
    assert lines[2] == (
        'missed rock of 300 px at 21.0 m: outside the judged range (max_range is 20 m)'
    )
    assert lines[7:] == [
        '2 more: missed rock, outside the judged range',
        '1 more: false alarm',
    ]
    assert summary_of(picture(faults[0])).endswith('found. ' + lines[2])


def test_a_frame_without_obstacles_has_no_iou() -> None:
    nothing = Figures(frames=1, false_positives=54, true_negatives=900)
    assert summary_lines(picture(figures=nothing)) == ['no obstacles, 54 px flagged']
