"""Causes of missed obstacles and false alarms, on hand-made arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.causes import FrameCauses
from rover_obstacle_detection.evaluation.faults import find_faults
from rover_obstacle_detection.evaluation.figures import score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.losses import Losses, measure_losses
from rover_obstacle_detection.evaluation.surroundings import median, quantile, slope_deg, top

SHAPE = (120, 160)
CAMERA = StereoCamera(160, 120, 100.0, 100.0, 79.5, 59.5, 0.2)
PITCH_DEG = 45.0
CAMERA_HEIGHT_M = 1.0
ROCK = np.s_[50:70, 70:90]
SPOT = np.s_[80:95, 20:50]


def depth_at(height_m: np.ndarray) -> np.ndarray:
    """Depth of points at a height above level ground, from a camera pitched 45 degrees down."""
    up = np.asarray(Gravity.from_angles(PITCH_DEG).up)
    x_over_z, y_over_z = CAMERA.rays()
    rise = up[0] * x_over_z + up[1] * y_over_z + up[2]
    return ((height_m - CAMERA_HEIGHT_M) / rise).astype(np.float32)


class View:
    """A rock of 20 x 20 pixels on level ground, measured perfectly until changed."""

    def __init__(self, rock_m: float = 0.2) -> None:
        self.true_m = np.zeros(SHAPE, np.float32)
        self.true_m[ROCK] = rock_m
        self.labels = np.zeros(SHAPE, np.uint8)
        self.labels[ROCK] = 1
        self.instances = np.zeros(SHAPE, np.uint16)
        self.instances[ROCK] = 7
        self.measured_m = self.true_m.copy()
        self.ground_m = np.zeros(SHAPE, np.float32)
        self.matched = np.ones(SHAPE, bool)
        self.known = np.ones(SHAPE, bool)
        self.mask = np.zeros(SHAPE, np.uint8)
        self.cues = np.zeros(SHAPE, np.uint8)
        self.noise_m = np.full(SHAPE, 0.06, np.float32)
        rng = np.random.default_rng(0)
        self.grey = rng.integers(90, 110, SHAPE).astype(np.uint8)
        self.gravity = Gravity.from_angles(PITCH_DEG)
        self.depth_m = depth_at(self.true_m)

    def frame(self) -> LabelledFrame:
        blank = np.zeros(SHAPE, np.uint8)
        return LabelledFrame(
            1, CAMERA, blank, blank, self.labels, self.instances, self.depth_m, self.gravity
        )

    def detection(self) -> Detection:
        disparity = np.float32(CAMERA.fx * CAMERA.baseline_m) / depth_at(self.measured_m)
        disparity[~self.matched] = 0
        height_m = np.where(self.matched, self.measured_m - self.ground_m, np.nan)
        up = Gravity.from_angles(PITCH_DEG).up
        return small_detection(
            CAMERA,
            ground=GroundPlane(up, CAMERA_HEIGHT_M, up),
            grey=self.grey,
            disparity=disparity.astype(np.float32),
            height=height_m.astype(np.float32),
            height_noise=self.noise_m,
            known=self.known & self.matched,
            cues=self.cues,
            mask=self.mask,
        )

    def causes(self) -> FrameCauses:
        return FrameCauses(self.detection(), self.frame())

    def faults(self) -> list[str]:
        causes = self.causes()
        truth = self.labels, self.instances, self.depth_m
        return [str(fault) for fault in find_faults(self.mask, *truth, causes)]

    def fault(self) -> str:
        (fault,) = self.faults()
        return fault.partition(': ')[2]


def test_rock_without_matches() -> None:
    view = View()
    view.matched[ROCK] = False
    view.matched[50:54, 70:90] = True
    view.grey[ROCK] = 12
    (fault,) = view.faults()
    assert fault.startswith('missed rock of 400 px at 1.')
    assert fault.endswith(
        ': not matched (20 % of its pixels have a disparity, in shadow: grey level 12)'
    )


def test_rock_at_the_left_border_is_not_visible_in_the_right_image() -> None:
    view = View()
    view.labels[...] = view.instances[...] = 0
    view.labels[50:80, :8], view.instances[50:80, :8] = 1, 7
    view.matched[:, :20] = False
    assert view.fault() == 'not visible in the right image (0 % of its pixels have a disparity)'


@pytest.mark.parametrize(
    ('far', 'detail'), [(True, 'max_range 40 m'), (False, 'height noise 6 cm')]
)
def test_rock_beyond_the_detection_range(far: bool, detail: str) -> None:
    view = View()
    view.known[ROCK] = False
    if far:
        view.depth_m[ROCK] = 45.0
    assert view.fault() == f'beyond the detection range ({detail})'


def test_rock_in_doubt() -> None:
    view = View()
    view.known[ROCK] = False
    view.noise_m[...] = 0.04
    assert view.fault() == 'in doubt'


def test_ground_estimated_too_high_under_a_rock() -> None:
    view = View()
    view.ground_m[ROCK] = 0.12
    assert view.fault() == (
        'ground estimated too high (by 12 cm, true height 20 cm, measured 8 cm, limit 10 cm)'
    )


def test_rock_flattened_by_matching() -> None:
    view = View()
    view.measured_m[ROCK] = 0.07
    assert view.fault() == (
        'flattened by matching (top 13 cm too low, true height 20 cm, measured 7 cm, limit 10 cm)'
    )


def test_rock_measured_above_the_limit_but_not_flagged() -> None:
    view = View(0.115)
    assert view.fault() == (
        'just above the limit (true height 12 cm, measured 12 cm, limit 10 cm)'
    )


def test_rock_without_visible_ground_around_it() -> None:
    view = View(0.06)
    view.instances[view.instances == 0] = 9
    assert view.fault() == (
        'measured too low (measured 6 cm, limit 10 cm, too little visible ground around it)'
    )


def test_partly_found_rock() -> None:
    view = View()
    view.mask[50:58, 70:90] = 255
    assert view.fault() == (
        'partly found (40 % flagged, true height 20 cm, measured 20 cm, limit 10 cm)'
    )


def test_rock_lower_than_the_limit_above_the_ground() -> None:
    view = View(0.05)
    assert view.fault() == (
        'low above the surrounding ground (true height 5 cm, measured 5 cm, limit 10 cm)'
    )


def test_missed_drop_with_its_depth() -> None:
    view = View()
    view.labels[...] = view.instances[...] = 0
    drop = np.s_[40:90, 60:110]
    view.true_m[...] = view.measured_m[...] = 0
    view.labels[drop], view.true_m[drop], view.measured_m[drop] = 3, -0.2, -0.06
    view.depth_m = depth_at(view.true_m)
    assert view.fault() == (
        'drop not recognised (true depth 20 cm, measured 6 cm, limit 10 cm, 0 % flagged)'
    )


def test_missed_slope() -> None:
    view = View()
    view.instances[...] = 0
    view.labels[...] = 2
    view.gravity = Gravity.from_angles(33.0)
    assert view.fault() == (
        'vertical estimate off (pitch off by +12.0 degrees, roll by +0.0, 0 % flagged)'
    )
    view.gravity = Gravity.from_angles(PITCH_DEG)
    assert view.fault().startswith('measured too flat (')


def test_only_a_large_error_of_the_vertical_is_reported() -> None:
    view = View()
    assert view.causes().vertical() is None
    view.gravity = Gravity.from_angles(PITCH_DEG - 3.0, 4.0)
    assert view.causes().vertical() == 'pitch off by +3.0 degrees, roll by -4.0'
    view.gravity = None
    assert view.causes().vertical() is None


def alarm(**changes) -> View:
    """The rock is found, with a false alarm of 450 pixels next to it."""
    view = View()
    view.mask[ROCK] = view.mask[SPOT] = 255
    view.cues[SPOT] = int(changes.pop('cue', Cue.HEIGHT))
    for name, value in changes.items():
        getattr(view, name)[SPOT] = value
    return view


def test_false_alarm_from_a_false_match() -> None:
    assert alarm(measured_m=0.2, grey=100).fault() == (
        'false match (disparity off by +4.5 px, height by 20 cm, flagged by height, '
        'measured height 20 cm, no texture: grey level 100)'
    )


def test_false_alarm_on_ground_estimated_too_low() -> None:
    assert alarm(ground_m=-0.15).fault() == (
        'ground estimated too low (by 15 cm, flagged by height, measured height 15 cm)'
    )


def test_false_alarm_without_matches() -> None:
    view = alarm(cue=Cue.GREY_LEVEL, matched=False, grey=20)
    assert view.fault() == 'no match (flagged by grey level, in shadow: grey level 20)'


def test_false_alarm_from_a_wrong_vertical() -> None:
    view = alarm(cue=Cue.SLOPE)
    view.gravity = Gravity.from_angles(39.0)
    assert view.fault() == (
        'vertical estimate off (flagged by slope, pitch off by +6.0 degrees, roll by +0.0)'
    )


def test_false_alarm_on_a_rock_below_the_limit() -> None:
    view = alarm(true_m=0.07, measured_m=0.12, instances=8)
    view.depth_m = depth_at(view.true_m)
    assert view.fault() == ('rock below the limit (true height 7 cm, measured 12 cm, limit 10 cm)')


def test_unexplained_false_alarm_is_noise() -> None:
    assert (
        alarm(cue=0)
        .fault()
        .startswith(
            'noise (disparity off by +0.0 px, 10 % of it by over 0.0 px, '
            'flagged by the morphology alone, measured height 0 cm'
        )
    )


def test_false_alarm_next_to_a_rock() -> None:
    view = View()
    beside = np.s_[50:70, 93:110]
    view.mask[ROCK] = view.mask[beside] = 255
    view.cues[beside] = int(Cue.HEIGHT)
    assert view.fault() == 'next to a rock (flagged by height, measured height 0 cm)'


def test_causes_need_depth() -> None:
    view = View()
    view.depth_m = None
    frame = view.frame()
    view.depth_m = depth_at(view.true_m)
    with pytest.raises(ValueError, match='needs true depth'):
        FrameCauses(view.detection(), frame)


@pytest.mark.parametrize('angle_deg', [0.0, 17.0, 30.0])
def test_slope_of_a_ramp(angle_deg: float) -> None:
    x, z = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 80), np.linspace(2, 4, 80)))
    y = -math.tan(math.radians(angle_deg)) * z
    points = np.column_stack((x, y, z)).astype(np.float32)
    points[::7] = np.nan
    assert slope_deg(points, (0.0, -1.0, 0.0)) == pytest.approx(angle_deg, abs=0.01)
    assert math.isnan(slope_deg(points[:20], (0.0, -1.0, 0.0)))


def test_quantiles_ignore_nan() -> None:
    values = np.array([np.nan, 1.0, 2.0, 3.0])
    assert median(values) == 2.0
    assert top(values) == pytest.approx(2.96)
    assert math.isnan(quantile(values[:1], 0.5))


def test_losses_add_up_to_the_union() -> None:
    labels = np.zeros((60, 80), np.uint8)
    instances = np.zeros((60, 80), np.uint16)
    labels[10:20, 10:20], instances[10:20, 10:20] = 1, 1
    labels[40:50, 10:20], instances[40:50, 10:20] = 1, 2
    labels[0], labels[30:40, 60:70] = 255, 2
    mask = np.zeros((60, 80), np.uint8)
    mask[10:20, 12:24] = 255
    mask[40:50, 50:53] = 255
    mask[30:40, 60:70] = 255
    losses = measure_losses(mask, labels, instances)
    assert losses == Losses(
        hit=80 + 100, missed=100, invented=30, too_wide=40, too_narrow=20, outline=2 * 36
    )
    figures = score(mask, labels, instances)
    assert losses.share('hit') == figures.iou
    assert losses.width_px('too_wide') == pytest.approx(40 / 72)
    twice = losses + losses
    assert twice.union == 2 * losses.union
    assert Losses().share('missed') is None
    assert Losses().width_px('too_wide') is None
