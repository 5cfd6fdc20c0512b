from __future__ import annotations

import numpy as np
from relief import PosedCamera, block


def test_window_has_its_own_pixels():
    terrain, *_ = PosedCamera(pitch_deg=20.0).survey(block(0.0, 2.0, 0.4, 0.3))
    window = np.s_[2:120, 50:140]
    found = terrain.within(window)
    for name in ('height_m', 'noise_m', 'camera_m', 'pixels_per_metre', 'measured'):
        np.testing.assert_array_equal(getattr(found, name), getattr(terrain, name)[window])
    assert 0 < found.measured.mean() < 1
    assert found.layers == ()
