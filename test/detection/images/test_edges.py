import numpy as np
import pytest

from rover_obstacle_detection.detection.images.edges import edge_strength


@pytest.mark.parametrize('shape', [(40, 60), (41, 61), (1, 1)])
def test_an_even_image_has_no_edges_at_half_its_size(shape):
    strength = edge_strength(np.full(shape, 77, np.uint8))
    assert strength.shape == ((shape[0] + 1) // 2, (shape[1] + 1) // 2)
    assert strength.dtype == np.float32
    assert not strength.any()


@pytest.mark.parametrize('transposed', [False, True])
def test_a_step_in_grey_level_is_an_edge_there_only(transposed):
    grey = np.full((40, 60), 50, np.uint8)
    grey[:, 30:] = 150
    strength = edge_strength(grey.T if transposed else grey)
    strength = strength.T if transposed else strength
    assert strength[:, 14:16].min() > 20
    assert strength[:, :11].max() < 0.5
    assert strength[:, 19:].max() < 0.5


def test_a_slow_change_has_the_strength_of_its_slope():
    grey = np.tile(np.arange(0, 240, 3, dtype=np.uint8), (20, 1))
    assert edge_strength(grey)[:, 5:-5] == pytest.approx(6, abs=0.3)
