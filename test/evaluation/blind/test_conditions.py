"""The table of conditions: every one applies, and gets worse."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from blind_views import rendered_view

from rover_obstacle_detection.evaluation.blind.conditions import CONDITIONS, CONTROL
from rover_obstacle_detection.evaluation.blind.view import View

VIEW = rendered_view()
# Their strengths are kinds rather than amounts.
KINDS = {
    'undamaged',
    'both images flat',
    'right image black',
    'right image white',
    'same image twice',
    'right image of another moment',
    'left and right exchanged',
    'camera upside down',
    'right principal point',
    'baseline',
    'focal length',
    'pitch and roll',
    'pitch too small',
    'pitch too large',
    'roll wrong',
}
GRADED = [condition for condition in CONDITIONS if condition.name not in KINDS]


def damage(view: View) -> float:
    """Mean grey-level difference from the undamaged images."""
    return sum(
        float(np.abs(getattr(view, name).astype(float) - getattr(VIEW, name)).mean())
        for name in ('left', 'right')
    )


def test_names_are_unique_and_groups_contiguous() -> None:
    assert max(Counter(condition.name for condition in CONDITIONS).values()) == 1
    groups = [condition.group for condition in CONDITIONS]
    assert groups == sorted(groups, key=groups.index)
    assert {condition.name for condition in CONDITIONS} > KINDS


@pytest.mark.parametrize('condition', CONDITIONS, ids=lambda condition: condition.name)
def test_condition_gives_valid_views_that_differ(condition) -> None:
    changed = [change(VIEW) for change in condition.strengths.values()]
    for view in changed:
        assert view.left.shape == view.right.shape == view.camera.shape
        assert view.left.dtype == view.right.dtype == np.uint8
        assert view.labels.shape == view.depth_m.shape == view.camera.shape
        if condition.group != CONTROL:
            told = view.camera != VIEW.camera or view.told_gravity is not None
            assert told or damage(view) > 0.5
    keys = [
        (view.left.tobytes(), view.right.tobytes(), view.camera, view.told_gravity)
        for view in changed
    ]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize('condition', GRADED, ids=lambda condition: condition.name)
def test_strengths_do_more_and_more_damage(condition) -> None:
    amounts = [damage(change(VIEW)) for change in condition.strengths.values()]
    if condition.name == 'both lenses covered':
        amounts = [change(VIEW).left.std() for change in condition.strengths.values()]
    assert len(amounts) >= 3
    assert amounts == sorted(amounts)
    assert amounts[-1] > 1.2 * amounts[0]


def test_views_are_not_changed_in_place() -> None:
    before = VIEW.left.copy(), VIEW.right.copy(), VIEW.labels.copy()
    for condition in CONDITIONS:
        for change in condition.strengths.values():
            change(VIEW)
    for array, copy in zip((VIEW.left, VIEW.right, VIEW.labels), before, strict=True):
        np.testing.assert_array_equal(array, copy)
