"""The hybrid without one or the other of its stages, as the ablation runs it."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import Box, Dome, Pit, Plane, iou, mast, pinhole, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.hybrid import OPTIONAL_STAGES
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.errors import ConfigurationError

SCENE = mast(solids=(Box(0.35, 1.4, 0.25, 0.25, 0.22), Dome(-0.3, 1.0, 0.2)), solid_brightness=0.3)


def test_unknown_stage_cannot_be_left_out():
    with pytest.raises(ConfigurationError, match=r"leave_out has 'outline': .* noise, rows, "):
        Detector(SCENE.camera, leave_out=frozenset({'rows', 'outline'}))


def test_every_stage_may_be_left_out():
    assert len(set(OPTIONAL_STAGES)) == len(OPTIONAL_STAGES)
    everything = Detector(SCENE.camera, leave_out=frozenset(OPTIONAL_STAGES))
    view = render(SCENE)
    found = everything.detect(view.left, view.right)
    assert found.ground.up == found.ground.normal
    assert found.mask.any()
    assert set(np.unique(found.cues)) == {0, Cue.HEIGHT}


@pytest.mark.parametrize('stage', OPTIONAL_STAGES)
def test_each_stage_may_be_left_out(stage):
    view = render(SCENE)
    without = Detector(SCENE.camera, leave_out=frozenset({stage}))
    stages = []
    found = without.detect(view.left, view.right, on_stage=stages.append)
    assert iou(found.mask, view.obstacle) > 0.5
    assert (found.mask[~view.obstacle] > 0).mean() < 0.03
    whole = []
    Detector(SCENE.camera).detect(view.left, view.right, on_stage=whole.append)
    assert stages == whole


@pytest.mark.parametrize(
    ('stage', 'cue'),
    [
        ('slope', Cue.SLOPE),
        ('drop', Cue.DROP),
        ('regions', Cue.REGION),
        ('grey level', Cue.GREY_LEVEL),
    ],
)
def test_what_is_left_out_makes_no_obstacle(stage, cue):
    scene, pair, config = seen_by(cue)
    # What the filter judges without 3D has the cue of the grey level too.
    apart = frozenset({'sight'})
    whole = Detector(scene.camera, config, leave_out=apart).detect(*pair, gravity=scene.gravity)
    part = Detector(scene.camera, config, leave_out=apart | {stage})
    found = part.detect(*pair, gravity=scene.gravity)
    assert (whole.cues & cue).any()
    np.testing.assert_array_equal(found.cues, whole.cues & ~np.uint8(cue))


def seen_by(cue):
    """A scene, a pair and a configuration with which the cue finds something."""
    config = DetectorConfig()
    if cue == Cue.SLOPE:
        scene = mast(planes=(Plane.uphill(26),))
    elif cue == Cue.DROP:
        scene = mast(camera=pinhole(320, 240, 60.0, 0.15), pits=(Pit(0, 1.1, 0.8, 0.8, 0.4),))
    else:
        scene = SCENE
    left, right = render(scene).left.copy(), render(scene).right.copy()
    generator = np.random.default_rng(3)
    if cue == Cue.GREY_LEVEL:
        # The right eye sees something else where the left one sees a dark patch of ground.
        config = DetectorConfig(min_seed_points=100_000, P1=300.0, P2=1200.0)
        right[170:220, 100:230] = generator.integers(0, 256, (50, 130))
        left[170:220, 120:230] = generator.integers(4, 12, (50, 110))
    elif cue == Cue.REGION:
        # ... and where it sees the middle of the dome.
        config = DetectorConfig(P1=300.0, P2=1200.0)
        rows, columns = np.nonzero(render(scene).surface == 2)
        row, column = int(rows.mean()), int(columns.mean())
        around = np.s_[row - 12 : row + 12, column - 12 : column + 12]
        left[around] = np.median(left[rows, columns])
        right[row - 14 : row + 14, column - 40 : column + 8] = generator.integers(0, 256, (28, 48))
    return scene, (left, right), config


def test_without_subpixel_the_noise_is_that_of_the_matching():
    view = render(SCENE)
    bare = Detector(SCENE.camera, leave_out=frozenset({'subpixel'}))
    found = bare.detect(view.left, view.right, gravity=SCENE.gravity)
    ground = (found.disparity > 0) & (np.abs(found.height) < 0.01)
    expected = found.ground.height_m * 0.125 / found.disparity[ground]
    # On ground that seems to tilt a little it is a little different.
    off = np.abs(found.height_noise[ground] / expected - 1)
    assert np.median(off) < 0.02
    assert np.quantile(off, 0.99) < 0.1
    whole = Detector(SCENE.camera).detect(view.left, view.right, gravity=SCENE.gravity)
    matched = (found.disparity > 0) & (whole.disparity > 0)
    assert np.abs(found.disparity - whole.disparity)[matched].max() <= 1 + 1e-4
    assert (found.disparity != whole.disparity)[matched].any()
