from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rover_obstacle_detection.simulation.description import DriveParameters, RockParameters
from rover_obstacle_detection.simulation.frames import SceneWorld, rock_heights
from rover_obstacle_detection.simulation.labels import local_ground
from rover_obstacle_detection.simulation.poses import drive
from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.rigs import RIGS
from rover_obstacle_detection.simulation.rock_shapes import icosphere
from rover_obstacle_detection.simulation.rocks import (
    covered_fraction,
    rocks_per_square_metre,
    scatter,
)

NAVCAM = RIGS['navcam']


def level(x_m, y_m):
    return np.zeros(np.shape(x_m), np.float32)


def field(seed=1, frames=1, **parameters):
    rocks = RockParameters(**{'placed': 0, **parameters})
    poses = drive(level, NAVCAM, DriveParameters(frames=frames))
    return scatter(rocks, NAVCAM, NAVCAM.camera(512), poses, seed)


def test_covered_fraction_follows_golombek_and_rapp():
    # Equation 5 with k = 0.069, as at the Viking 1 site: q = 1.79 + 0.152 / 0.069.
    assert covered_fraction(0.0, 0.069) == pytest.approx(0.069)
    assert covered_fraction(0.5, 0.069) == pytest.approx(
        0.069 * math.exp(-(1.79 + 0.152 / 0.069) * 0.5)
    )


def test_rock_counts_add_up_to_the_covered_fraction():
    edges = np.geomspace(0.02, 1.0, 200)
    area = sum(
        rocks_per_square_metre(low, high, 0.1) * math.pi / 4 * ((low + high) / 2) ** 2
        for low, high in itertools.pairwise(edges)
    )
    expected = covered_fraction(0.02, 0.1) - covered_fraction(1.0, 0.1)
    assert area == pytest.approx(expected, rel=1e-3)


def test_scattered_rocks_cover_the_expected_fraction():
    cover, low, high = 0.08, 0.05, 0.3
    covered, seeds = 0.0, range(4)
    for seed in seeds:
        rocks = field(seed, cover=cover, smallest_m=low, largest_m=high)
        # Well inside the view, where all rocks are generated.
        inside = (rocks.x_m > 3) & (rocks.x_m < 9) & (np.abs(rocks.y_m) < 1.5)
        covered += (math.pi / 4 * rocks.diameter_m[inside] ** 2).sum() / 18.0
    expected = covered_fraction(low, cover) - covered_fraction(high, cover)
    # Rocks inside others are removed.
    assert 0.8 * expected < covered / len(seeds) < 1.1 * expected


def test_equal_seeds_give_equal_rocks_sorted_by_size():
    first, again, other = field(7), field(7), field(8)
    for name in ('x_m', 'y_m', 'diameter_m', 'seed'):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert len(first) > 50
    assert (np.diff(first.diameter_m) <= 0).all()
    assert not np.array_equal(first.x_m[:10], other.x_m[:10])


def test_the_path_of_the_rover_is_free_of_rocks():
    rocks = field(3, frames=5, cover=0.3, smallest_m=0.05)
    for pose in drive(level, NAVCAM, DriveParameters(frames=5)):
        x, y = pose.ground_below
        distance = np.hypot(rocks.x_m - x, rocks.y_m - y)
        large = rocks.diameter_m > 0.08
        assert (distance[large] > 0.25).all()


def test_no_rocks_without_cover_and_placed_rocks():
    assert len(field(cover=0.0)) == 0


@pytest.mark.parametrize('level_number', [0, 1, 4])
def test_icosphere_is_closed_and_faces_outward(level_number):
    vertices, faces = icosphere(level_number)
    edges = {
        tuple(sorted(edge)) for a, b, c in faces.tolist() for edge in ((a, b), (b, c), (c, a))
    }
    assert len(vertices) - len(edges) + len(faces) == 2
    assert len(faces) == 20 * 4**level_number
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0, atol=1e-6)
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    assert (np.einsum('ij,ij->i', np.cross(b - a, c - a), a) > 0).all()


def heights_of(scene):
    world = SceneWorld(scene)
    mesh = world.rock_mesh(world.poses[0])
    ground = local_ground(world.terrain.height, (-3.0, -8.0), (14.0, 8.0))
    near = np.flatnonzero(
        (world.rocks.x_m > -2) & (world.rocks.x_m < 13) & (np.abs(world.rocks.y_m) < 7)
    )
    drawn = np.intersect1d(near + 1, np.unique(mesh.instance))
    heights = rock_heights(mesh, ground, len(world.rocks))
    return world.rocks.diameter_m[drawn - 1], heights[drawn], mesh


def test_rock_mesh_proportions_and_consistency():
    diameter, height, mesh = heights_of(scene_of('x', 1, ['noon'], 'vga', {'width': 320}))
    large = diameter > 0.1
    ratio = height[large] / diameter[large]
    assert large.sum() > 10
    assert 0.3 < np.median(ratio) < 0.7
    assert ratio.max() < 1.0
    assert mesh.faces.max() == len(mesh.vertices) - 1
    assert len(mesh.instance) == len(mesh.faces)
    assert ((mesh.colours > 0) & (mesh.colours < 1)).all()


def test_pebbles_are_lower_than_the_clearance():
    _, height, _ = heights_of(scene_of('x', 1, ['pebbles'], 'vga', {'width': 320}))
    assert len(height) > 300
    assert height.max() < 0.08


def test_rock_shape_does_not_depend_on_resolution():
    world = SceneWorld(scene_of('x', 2, ['noon'], 'vga', {'width': 160}))
    chosen = np.array([0])
    far, near = (
        world.rock_maker.mesh(world.rocks, chosen, np.zeros(1), np.array([size]))
        for size in (40.0, 320.0)
    )
    assert len(near.vertices) > 10 * len(far.vertices)
    size = world.rocks.diameter_m[0]
    np.testing.assert_allclose(near.vertices.min(0), far.vertices.min(0), atol=0.04 * size)
    np.testing.assert_allclose(near.vertices.max(0), far.vertices.max(0), atol=0.04 * size)
