"""The script that calibrates the confidence."""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rover_obstacle_detection.detection.config import METHODS
from rover_obstacle_detection.detection.result.confidence import (
    FEATURES,
    STRENGTHEN,
    WEAKEN,
    logistic,
)
from rover_obstacle_detection.detection.result.confidence_coefficients import COEFFICIENTS

ROOT = Path(__file__).parents[2]
SAMPLE_BAG = ROOT / 'bags' / 'mars_yard'


@pytest.fixture(scope='module')
def script():
    names = runpy.run_path(str(ROOT / 'scripts' / 'calibrate_confidence.py'))
    return SimpleNamespace(names=names, **names)


def column(name):
    return FEATURES.index(name)


def samples(script, weights, count=20000, scenes=1):
    """Obstacles that are real with the probability that the weights give."""
    random = np.random.default_rng(5)
    features = random.normal(2, 1, (count, len(FEATURES)))
    features[:, 0] = 1
    features[:, column('roughness_step_share')] = 0
    real = random.random(count) < logistic(features @ weights)
    return [
        script.Sample(f'tune_{index}', 'as recorded', features[index::scenes], real[index::scenes])
        for index in range(scenes)
    ]


def weights_of(**given):
    return np.array([given.get(name, 0.0) for name in FEATURES])


TRUE = weights_of(
    intercept=-1, log_excess=0.7, log_pixels=0.5, log_raggedness=-0.8, slope_share=-0.3
)


def test_fit_recovers_the_weights(script):
    found = script.fit(samples(script, TRUE, 80_000), ridge=1)
    assert found == pytest.approx(TRUE, abs=0.1)


def test_constant_feature_has_no_weight(script):
    found = script.fit(samples(script, TRUE), ridge=1)
    assert found[column('roughness_step_share')] == 0


def test_mean_confidence_is_the_real_share(script):
    fitted = samples(script, TRUE, 500)
    judged = script.judged(fitted, script.fit(fitted))
    assert judged.confidence.mean() == pytest.approx(judged.real.mean(), abs=1e-6)


def test_weights_of_the_wrong_sign_are_dropped(script):
    against = weights_of(intercept=1, log_excess=-0.8, log_raggedness=0.6, slope_share=-0.5)
    found = script.fit(samples(script, against), ridge=1)
    assert found[column('log_excess')] == found[column('log_raggedness')] == 0
    assert found[column('slope_share')] == pytest.approx(-0.5, abs=0.1)
    assert all(found[column(name)] >= 0 for name in STRENGTHEN)
    assert all(found[column(name)] <= 0 for name in WEAKEN)


def test_ridge_keeps_weights_of_separable_data_finite(script):
    features = np.ones((20, len(FEATURES)))
    features[:10, 2] = 5
    separable = [script.Sample('tune_a', 'as recorded', features, np.arange(20) < 10)]
    judged = script.judged(separable, script.fit(separable, ridge=1))
    assert np.isfinite(judged.confidence).all()
    assert judged.confidence[0] > 0.8 > 0.2 > judged.confidence[-1]


def test_cross_validation_fits_to_the_other_scenes(script):
    apart = samples(script, TRUE, 3000, scenes=3)
    expected = [
        logistic(own.features @ script.fit([each for each in apart if each is not own]))
        for own in apart
    ]
    judged = script.cross_validated(apart)
    assert judged.confidence == pytest.approx(np.concatenate(expected))
    np.testing.assert_array_equal(judged.real, np.concatenate([each.real for each in apart]))


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16])
@pytest.mark.parametrize('shape', [(20, 30), (20, 30, 3)])
def test_variations_change_the_images_but_not_their_format(script, dtype, shape):
    random = np.random.default_rng(1)
    full = np.iinfo(dtype).max
    left = random.integers(0, full, shape).astype(dtype)
    right = random.integers(0, full, shape).astype(dtype)
    before = left.copy(), right.copy()
    for name, vary in script.VARIATIONS.items():
        varied = vary(left, right, np.random.default_rng(2))
        same = [np.array_equal(one, other) for one, other in zip(varied, before, strict=True)]
        assert [image.shape for image in varied] == [shape, shape]
        assert [image.dtype for image in varied] == [dtype, dtype]
        assert all(same) == (name == 'as recorded')
        again = vary(left, right, np.random.default_rng(2))
        np.testing.assert_array_equal(varied[1], again[1])
    np.testing.assert_array_equal(left, before[0])


def test_shift_moves_the_image_down(script):
    image = np.zeros((10, 8), np.uint8)
    image[4] = 100
    np.testing.assert_array_equal(script.shifted(image, 2.0)[6], 100)
    np.testing.assert_array_equal(script.shifted(image, 0.5)[4:6], 50)


def test_coefficient_file_holds_every_method(script):
    text = script.file_text(COEFFICIENTS)
    assert text == script.COEFFICIENTS_FILE.read_text()
    changed = {**COEFFICIENTS, 'study': script.by_name(np.arange(len(FEATURES)) - 0.00001)}
    names = {}
    exec(script.file_text(changed), names)
    assert names['COEFFICIENTS'] == {
        'hybrid': COEFFICIENTS['hybrid'],
        'study': {name: float(index) for index, name in enumerate(FEATURES)},
    }
    assert set(names['COEFFICIENTS']) == set(METHODS)
    assert '-0.0,' not in script.file_text(changed)


def test_bags_in_tables_out(script, tmp_path, monkeypatch, capsys):
    few = {name: script.VARIATIONS[name] for name in ('as recorded', 'dark')}
    monkeypatch.setitem(script.names['main'].__globals__, 'VARIATIONS', few)
    copy = tmp_path / 'coefficients.py'
    copy.write_text(script.COEFFICIENTS_FILE.read_text())
    monkeypatch.setitem(script.names['main'].__globals__, 'COEFFICIENTS_FILE', copy)
    bags = [tmp_path / name for name in ('tune_yard', 'report_yard', 'tune_broken')]
    for bag in bags[:2]:
        shutil.copytree(SAMPLE_BAG, bag)
    bags[2].mkdir()

    script.main([*map(str, bags), '--write'])

    output = capsys.readouterr()
    assert 'hybrid, 1 fitted scenes, with all variations' in output.out
    assert 'hybrid, 1 test scenes' in output.out
    assert output.out.count('| 0.9 to 1 |') == 4
    assert 'tune_broken' in output.err
    names = {}
    exec(copy.read_text(), names)
    printed = {line.split()[0]: line.split()[-1] for line in output.out.splitlines() if line}
    for name, value in names['COEFFICIENTS']['hybrid'].items():
        assert value == pytest.approx(float(printed[name]), abs=1e-4)
    assert names['COEFFICIENTS']['study'] == COEFFICIENTS['study']


def test_test_bags_alone_are_refused(script, tmp_path, capsys):
    with pytest.raises(SystemExit) as error:
        script.main([str(tmp_path / 'report_a')])
    assert error.value.code == 2
    assert 'all bag names start with report_ or drawn_' in capsys.readouterr().err
