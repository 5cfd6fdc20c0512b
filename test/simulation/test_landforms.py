from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.simulation.description import Step, TerrainParameters
from rover_obstacle_detection.simulation.ground_mesh import fan, fan_mesh
from rover_obstacle_detection.simulation.labels import local_ground
from rover_obstacle_detection.simulation.landforms import Landforms
from rover_obstacle_detection.simulation.poses import standing_pose
from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.rigs import RIGS
from rover_obstacle_detection.simulation.rocks import RockField
from rover_obstacle_detection.simulation.terrain import Terrain

FLAT = {'relief_m': 0.0, 'roughness_m': 0.0, 'clods_m': 0.0, 'hills_m': 0.0}


def terrain_of(**parameters):
    return Terrain(TerrainParameters(**FLAT, **parameters), 3)


def along_x(terrain, *x):
    x = np.array(x, np.float32)
    return terrain.height(x, np.zeros_like(x))


def surveyed(terrain, x0=-1.0, x1=6.0, y0=-2.0, y1=2.0):
    return local_ground(terrain.height, (x0, y0), (x1, y1))


def at(ground, grid, x, y=0.0):
    return float(ground.read(grid, np.array([x]), np.array([y]))[0])


@pytest.mark.parametrize('rise_m', [0.25, -1.2])
def test_step_has_the_requested_rise_and_place(rise_m):
    terrain = terrain_of(steps=(Step(ahead_m=2.0, rise_m=rise_m, waviness_m=0.0),))
    before, edge, after, far = along_x(terrain, 1.97, 2.0, 2.03, 9.0)
    assert before == 0.0
    assert edge == pytest.approx(rise_m / 2, abs=1e-4)
    assert after == far == pytest.approx(rise_m)


def test_edge_runs_in_the_requested_direction():
    terrain = terrain_of(steps=(Step(ahead_m=2.0, turn_deg=45.0, waviness_m=0.0),))
    # Square to the direction 45 degrees left, through (2, 0).
    x, y = np.array([1.3, 1.2, 2.9, 2.7], np.float32), np.array([0.8, 0.7, -0.8, -0.8], np.float32)
    np.testing.assert_allclose(terrain.height(x, y), [0.25, 0.0, 0.25, 0.0], atol=1e-5)


def test_trench_has_the_requested_width_and_ends_level():
    terrain = terrain_of(steps=(Step(ahead_m=2.0, rise_m=-0.4, width_m=0.6, waviness_m=0.0),))
    z = along_x(terrain, 1.9, 2.1, 2.5, 2.7, 5.0)
    np.testing.assert_allclose(z, [0.0, -0.4, -0.4, 0.0, 0.0], atol=1e-6)


def test_edges_are_irregular_by_the_requested_amount():
    terrain = terrain_of(steps=(Step(ahead_m=4.0, rise_m=1.0, run_m=0.01, waviness_m=0.1),))
    x = np.arange(3.0, 5.0, 0.005, dtype=np.float32)
    y = np.arange(-9.0, 9.0, 0.1, dtype=np.float32)
    edge_m = 5.0 - 0.005 * (terrain.height(*np.meshgrid(x, y)) > 0.5).sum(1)
    assert 0.05 < edge_m.std() < 0.2
    assert edge_m.mean() == pytest.approx(4.0, abs=0.15)


def test_ledges_and_brims_are_slopes_and_trenches_are_drops():
    ledge = surveyed(terrain_of(steps=(Step(ahead_m=2.0, rise_m=0.2, waviness_m=0.0),)))
    cliff = surveyed(terrain_of(steps=(Step(ahead_m=2.0, rise_m=-1.0, waviness_m=0.0),)))
    trench = surveyed(
        terrain_of(steps=(Step(ahead_m=2.0, rise_m=-0.4, width_m=0.8, waviness_m=0.0),))
    )
    for ground in (ledge, cliff, trench):
        assert at(ground, ground.slope_deg, 2.0) > 30
        assert at(ground, ground.slope_deg, 1.5) < 5
    assert at(cliff, cliff.slope_deg, 1.85) > 20
    # Wide ground below a straight cliff is not a hollow.
    assert at(cliff, cliff.drop_m, 4.0) < 0.01
    assert at(trench, trench.drop_m, 2.4) == pytest.approx(0.4, abs=0.03)
    assert at(trench, trench.slope_deg, 2.4) < 5


@pytest.mark.parametrize('condition', ['cracked_mud', 'ripples', 'wheel_tracks'])
def test_small_forms_are_free_ground(condition):
    terrain = Terrain(scene_of('x', 3, [condition], 'vga').terrain, 3)
    ground = surveyed(terrain)
    inside = (slice(50, -50), slice(50, -50))
    assert (ground.slope_deg[inside] < 20).mean() > 0.999
    assert (ground.drop_m[inside] < 0.1).mean() > 0.999


@pytest.mark.parametrize('condition', ['layered_outcrop', 'fractured_bedrock'])
def test_outcrops_have_free_and_impassable_ground(condition):
    ground = surveyed(Terrain(scene_of('x', 3, [condition], 'vga').terrain, 3))
    steep = (ground.slope_deg > 20).mean()
    assert 0.05 < steep < 0.6


def test_cracks_have_the_requested_size_and_depth():
    terrain = terrain_of(plate_size_m=0.3, crack_width_m=0.03, crack_depth_m=0.02)
    z = terrain.height(*np.meshgrid(*2 * [np.float32(np.r_[1:4:0.004])]))
    top = np.median(z)
    assert top - z.min() == pytest.approx(0.02, abs=0.002)
    assert 0.05 < (z < top - 0.01).mean() < 0.2


def test_layers_have_the_requested_thickness():
    landforms = Landforms(TerrainParameters(layer_m=0.2, layer_relief_m=0.3), 3)
    z = landforms.height(*np.meshgrid(*2 * [np.float32(np.r_[2:10:0.03])]))
    height, count = np.unique(np.round(z / 0.2).astype(int), return_counts=True)
    assert len(height[count > 500]) >= 3
    # Treads lie near multiples of the thickness.
    assert (np.abs(z / 0.2 - np.round(z / 0.2)) < 0.15).mean() > 0.85


@pytest.mark.parametrize(
    'forms',
    [
        {'layer_m': 0.2, 'layer_relief_m': 0.5},
        {'plate_size_m': 0.6, 'plate_height_m': 0.3, 'plate_tilt_deg': 5.0},
    ],
)
def test_rover_stands_on_level_ground(forms):
    terrain = terrain_of(**forms)
    pose = standing_pose(terrain.height, RIGS['vga'], 0.0, 0.0, 0.0)
    assert pose.roll_deg == pytest.approx(0.0, abs=0.5)


def test_wheel_tracks_have_the_requested_gauge_and_depth():
    terrain = terrain_of(track_depth_m=0.05, track_gauge_m=0.8, track_width_m=0.2)
    y = np.arange(-1, 1, 0.005, dtype=np.float32)
    z = np.mean([terrain.height(np.full_like(y, x), y) for x in np.r_[2:2.22:0.01]], 0)
    rut = np.flatnonzero(z < z[0] - 0.03)
    left, right = y[rut][y[rut] > 0], y[rut][y[rut] < 0]
    assert left.mean() - right.mean() == pytest.approx(0.8, abs=0.03)
    assert np.ptp(left) == pytest.approx(0.2, abs=0.04)
    assert z[0] - z[rut].min() == pytest.approx(0.05, abs=0.01)


def test_mesh_has_rows_on_the_face_of_a_step():
    steps = (Step(ahead_m=2.0, rise_m=0.3, run_m=0.03, waviness_m=0.05),)
    terrain, rig = terrain_of(steps=steps), RIGS['vga']
    camera = rig.camera(320)
    pose = standing_pose(terrain.height, rig, 0.0, 0.0, 0.0)
    coarse, fine = (fan(rig, camera, pose, forms) for forms in (None, terrain.landforms))

    def on_face(places):
        z = fan_mesh(places, terrain.height).vertices[..., 2] - along_x(terrain, 0.0)
        inner = z[:, z.shape[1] // 3 : -z.shape[1] // 3]
        return ((inner > 0.03) & (inner < 0.27)).sum(0).min()

    assert on_face(coarse) < 6
    assert on_face(fine) > 15
    normals = fan_mesh(fine, terrain.height).normals
    assert np.isfinite(normals).all()
    assert (np.diff(fine.x_m, axis=0) >= 0).all()
    # Cells elsewhere do not get larger.
    assert np.diff(fine.x_m, axis=0).max() <= np.diff(coarse.x_m, axis=0).max() * 1.01


def test_mesh_covers_ground_below_a_cliff_within_the_view():
    steps = (Step(ahead_m=1.5, rise_m=-2.0),)
    terrain, rig = terrain_of(steps=steps), RIGS['study']
    camera = rig.camera(128)
    pose = standing_pose(terrain.height, rig, 0.0, 0.0, 0.0)
    places = fan(rig, camera, pose, terrain.landforms)
    points = pose.to_camera(fan_mesh(places, terrain.height).vertices)
    column = camera.fx * points[..., 0] / points[..., 2] + camera.cx
    below = (places.x_m[:, 0] > 2.5) & (places.x_m[:, 0] < 6)
    step_px = np.abs(np.diff(column[below], axis=1))
    inside = (column[below][:, 1:] > 0) & (column[below][:, 1:] < camera.width)
    assert step_px[inside].max() < 3


def test_rocks_stay_away_from_edges():
    landforms = Landforms(TerrainParameters(steps=(Step(rise_m=-0.5, waviness_m=0.0),)), 1)
    x = np.array([1.0, 1.95, 2.05, 2.3, 3.0])
    rocks = RockField(x, np.zeros(5), np.array([0.3, 0.05, 0.05, 0.3, 0.3]), np.arange(5))
    kept = rocks.away_from_edges(landforms.height)
    # A pebble at the foot may stay; at the brim it would stand above the low-passed ground.
    assert kept.x_m.tolist() == [1.0, 2.05, 2.3, 3.0]
    assert kept.seed.tolist() == [0, 2, 3, 4]
