"""The parts of the benchmark, by figures that are known."""

from __future__ import annotations

import math
from pathlib import Path

import benchmark_scenes
import growth
import numpy as np
import pytest
from benchmark_scenes import Scene, default_bags, read_scenes, resized, standard_scenes
from clouds import peer_cloud, size_text
from detection_times import PairTimes, curve_table, ratio_lines, smaller_lines, stage_table
from growth import power_line, rock_view, size_table
from replay_times import file_share, pair_rate_hz, replayed

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.bags.stereo import StereoPair
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.messages.cloud import decode_cloud
from rover_obstacle_detection.simulation.cache import cached_bag
from rover_obstacle_detection.simulation.suite import load_suite

ROOT = Path(__file__).parents[2]
MOON = ROOT / 'bags' / 'simulated_vga_moon'


def times(ratio: float, seconds: float = 0.1, figures: Figures | None = None) -> PairTimes:
    return PairTimes(seconds, seconds / ratio, 2 * ratio, {'match': seconds / 2}, figures)


def test_scenes_are_the_samples_and_what_is_rendered_already(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(benchmark_scenes, 'cache_folder', lambda: tmp_path)
    samples = default_bags()
    assert [path.name for path in samples] == [
        'mars_yard',
        'simulated_hazcam_crater',
        'simulated_study_noon',
        'simulated_vga_moon',
    ]
    names = ('report_study_moon', 'tune_vga_moon')
    for scene in load_suite('standard'):
        if scene.name in names:
            cached_bag(scene, tmp_path).mkdir(parents=True)
    assert [path.name for path in default_bags()[4:]] == ['report_study_moon']


def test_scene_of_another_size_is_resized_only_if_there_is_no_other() -> None:
    small = read_scenes([MOON])[0]
    assert (small.name, small.size) == ('simulated_vga_moon 0', (400, 300))
    (large,) = standard_scenes([small])
    assert large.size == (1024, 768)
    assert large.pair.left.shape == (768, 1024)
    assert large.pair.camera.fx == pytest.approx(small.pair.camera.fx * 2.56)
    assert standard_scenes([small, large]) == [large]


def test_lines_of_the_detection_are_medians_and_worst() -> None:
    median, worst, cpu, own_ms, plain_ms = ratio_lines([times(1.0), times(0.5), times(2.5)])
    assert (median.measured, median.met) == ('1.00 x SGBM', True)
    assert (worst.measured, worst.met) == ('2.50 x SGBM', False)
    assert (cpu.measured, cpu.met) == ('2.00 x', None)
    assert (own_ms.measured, plain_ms.measured) == ('100 ms', '100 ms')
    (line,) = smaller_lines([times(4.0), times(8.0)])
    assert line.measured == '6.00 x its own SGBM, worst 8.00; 100 ms'
    assert smaller_lines([]) == ()


def test_stages_are_means_over_the_scenes() -> None:
    assert stage_table([times(1.0), times(3.0, 0.3)]).rows == [('match', '1.00', '100.0')]


def test_curve_has_time_and_accuracy_of_each_setting() -> None:
    good = Figures(
        frames=1,
        true_positives=9,
        false_negatives=1,
        rocks=2,
        rocks_found=2,
        called_free=1,
        checked_obstacle_pixels=10,
    )
    poor = Figures(
        frames=1, true_positives=1, false_negatives=1, rocks=2, rocks_found=1, false_alarms=3
    )
    rows = curve_table(
        {
            DetectorConfig(): [times(1.0, figures=good), times(2.0, figures=poor)],
            DetectorConfig(speed='fast'): [times(0.5)],
            DetectorConfig(working_scale=0.5): [times(0.5)],
        }
    ).rows
    assert [row[0] for row in rows] == [
        '`speed` accurate (default)',
        '`speed` fast',
        '`working_scale` 0.5',
    ]
    assert rows[0][1:] == ('1.50', '2.00', '100', '0.700', '0.500', '3/4', '3', '10.0 %')
    assert rows[1][1:] == rows[2][1:] == ('0.50', '0.50', '100', '-', '-', '0/0', '0', '-')


def test_power_is_one_where_time_is_linear() -> None:
    sizes = {(320, 240): times(1.0, 0.01), (640, 480): times(2.0, 0.04)}
    line = power_line(sizes, 'yard')
    assert (line.measured, line.met) == ('1.00', True)
    sizes[640, 480] = times(2.0, 0.08)
    line = power_line(sizes, 'yard')
    assert (line.measured, line.met) == ('1.50', False)
    assert size_table(sizes).rows[1] == ('640 x 480', '2.00', '80', '40.0', '260')


def test_view_of_rocks_shows_each_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, 'STANDARD', (256, 192))
    one, two = (rock_view(places) for places in ([(0.0, 1.2)], [(0.0, 1.2), (0.6, 1.2)]))
    assert one.left.shape == (192, 256)
    assert one.camera == two.camera
    assert 60 < np.count_nonzero(one.left != two.left) < 12_000


def test_peer_cloud_has_the_depth_of_a_wall() -> None:
    camera = StereoCamera(160, 120, 100.0, 100.0, 79.5, 59.5, 0.1, cx_right=77.5)
    grey = np.random.default_rng(1).integers(0, 255, (120, 176), np.uint8)
    pair = StereoPair(0, '', grey[:, :160], grey[:, 12:172], left_header=None, camera=camera)

    cloud = peer_cloud(pair)

    assert (cloud.width, cloud.height, cloud.point_step, len(cloud.data)) == (160, 120, 16, 307200)
    assert [field.name for field in cloud.fields] == ['x', 'y', 'z', 'rgb']
    points = decode_cloud(cloud).reshape(120, 160, 4)
    # 12 pixels apart, of which 2 are the distance of the principal points.
    assert np.nanmedian(points[..., 2]) == pytest.approx(1.0, rel=0.02)
    row, column = 60, 120
    x, y, z, _ = points[row, column]
    assert (x, y) == pytest.approx(((column - 79.5) * z / 100, (row - 59.5) * z / 100), abs=1e-4)
    assert np.isnan(points[0, :10, :3]).all()
    rgb = cloud.data.reshape(120, 160, 16)[row, column, 12:]
    assert list(rgb) == [grey[row, column]] * 3 + [0]
    assert size_text([cloud]) == '19200 points, 307 kB'


def test_rate_counts_while_all_workers_work() -> None:
    together = [(1.0, 0, 1), (2.0, 1, 1), (2.5, 0, 2), (3.0, 1, 2), (4.0, 0, 3), (9.0, 1, 3)]
    assert pair_rate_hz(together, workers=2) == pytest.approx(3 / 2)
    alone = [(1.0, 0, 1), (2.0, 0, 2), (3.0, 1, 1), (4.0, 1, 2)]
    assert pair_rate_hz(alone, workers=1) == pytest.approx(1.0)
    assert math.isnan(pair_rate_hz([(1.0, 0, 1), (1.0, 1, 1)], workers=2))


def test_replays_are_timed(tmp_path: Path) -> None:
    (tmp_path / 'bag').symlink_to(MOON)
    summaries, rate_hz = replayed(tmp_path, workers=1)
    assert [len(each.frames) for each in summaries] == [1, 1]
    assert rate_hz > 0
    stages = summaries[0].frames[0].stage_ms
    files_ms = stages['read'] + stages['write bag'] + stages['write images']
    assert file_share(summaries[:1]) == pytest.approx(files_ms / sum(stages.values()))


def test_resized_pair_keeps_its_colours_and_field_of_view() -> None:
    scene: Scene = read_scenes([ROOT / 'bags' / 'simulated_study_noon'])[0]
    small = resized(scene.pair, 256, 192)
    assert small.left.shape == (192, 256, 3)
    assert small.camera.fx / 256 == pytest.approx(scene.pair.camera.fx / 512)
    assert np.mean(small.right) == pytest.approx(np.mean(scene.pair.right), abs=1.0)
