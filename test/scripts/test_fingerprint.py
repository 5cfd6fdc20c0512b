"""The script that tells whether two versions publish the same."""

from __future__ import annotations

import fingerprint
from hand_made import SCENE, write_stereo_bag
from synthetic import render


def test_fingerprint_has_a_hash_for_mask_and_clouds_that_depends_on_the_images(tmp_path):
    view = render(SCENE)
    one = write_stereo_bag(tmp_path / 'one', pairs=1)
    same = write_stereo_bag(tmp_path / 'same', pairs=1)
    darker = view.left // 2, view.right // 2
    other = write_stereo_bag(tmp_path / 'other', pairs=1, images=[darker])
    found = fingerprint.fingerprint(one)
    names = {topic.rpartition('/')[2] for topic in found}
    assert {'obstacle_mask', 'obstacle_points', 'ground_points'} <= names
    assert fingerprint.fingerprint(same) == found
    assert fingerprint.fingerprint(other) != found
