from __future__ import annotations

from dataclasses import asdict

import pytest

from rover_obstacle_detection.errors import ConfigurationError, MissingExtraError, OutputError
from rover_obstacle_detection.simulation import cache, renderer
from rover_obstacle_detection.simulation.description import Scene, parameters_of
from rover_obstacle_detection.simulation.hazard_presets import HAZARD_PRESETS
from rover_obstacle_detection.simulation.presets import PRESETS, scene_of
from rover_obstacle_detection.simulation.rigs import RIGS
from rover_obstacle_detection.simulation.suite import load_suite, suite_names

LANDFORMS = {
    name
    for name, preset in HAZARD_PRESETS.items()
    if {'steps', 'layer_m', 'plate_size_m', 'track_depth_m'}
    & set(preset.changes(RIGS['vga']).get('terrain', {}))
}


@pytest.mark.parametrize('condition', PRESETS)
def test_every_condition_and_rig_gives_a_serialisable_scene(condition):
    for rig in RIGS:
        scene = scene_of('x', 3, [condition], rig)
        assert Scene.from_mapping(scene.to_mapping()) == scene
        assert scene.rig == rig
        if condition != 'noon':
            assert scene != scene_of('x', 3, [], rig, {'conditions': [condition]})


def test_later_conditions_and_parameters_override():
    scene = scene_of(
        'x', 1, ['low_sun_across', 'crater'], 'study', {'light': {'sun_azimuth_deg': 5}}
    )
    assert scene.conditions == ('low_sun_across', 'crater')
    assert scene.light.sun_elevation_deg == 32.0
    assert scene.light.sun_azimuth_deg == 5.0
    assert len(scene.terrain.craters) == 2


@pytest.mark.parametrize(
    ('call', 'message'),
    [
        (lambda: scene_of('x', 1, ['crator']), "unknown condition 'crator'; did you mean crater"),
        (lambda: scene_of('x', 1, [], 'navcm'), "rig is 'navcm': expected one of study"),
        (
            lambda: scene_of('x', 1, [], 'study', {'light': {'sun_elevation': 5}}),
            'unknown scene parameter light.sun_elevation; did you mean light.sun_elevation_deg',
        ),
        (
            lambda: scene_of('x', 1, [], 'study', {'rocks': {'cover': 2.0}}),
            'cover is 2.0: expected 0 to 0.6',
        ),
        (
            lambda: scene_of('x', 1, [], 'study', {'rocks': {'cover': 'much'}}),
            "cover is 'much': expected a number",
        ),
        (
            lambda: scene_of('x', 1, [], 'study', {'terrain': {'craters': [{'depth': 1}]}}),
            r'unknown scene parameter terrain.craters\[0\].depth; did you mean',
        ),
        (
            lambda: scene_of('x', 1, [], 'study', {'drive': {'frames': 101, 'step_m': 2}}),
            'the drive is 200 m long: expected at most 100 m',
        ),
        (
            lambda: scene_of('x', 1, [], 'study', {'terrain': 3}),
            'terrain is 3: expected named parameters',
        ),
    ],
)
def test_invalid_scene_is_named(call, message):
    with pytest.raises(ConfigurationError, match=message):
        call()


def test_every_parameter_has_a_description():
    parameters = list(parameters_of(Scene))
    names = [parameter.name for parameter in parameters]
    assert 'light.sun_elevation_deg' in names
    assert 'seed' in names
    assert all(parameter.description for parameter in parameters)


@pytest.mark.parametrize(
    'own',
    [
        {'pitch_deg': 10},
        {'camera_height_m': 1.2, 'baseline_m': 0.3},
        {'horizontal_view_deg': 60.0},
    ],
)
def test_scene_overrides_the_rig(own):
    scene = scene_of('x', 1, [], 'navcam', own)
    assert asdict(scene.rig_used()) == {**asdict(RIGS['navcam']), **own}


@pytest.mark.parametrize(
    ('rig', 'focal', 'size'),
    [('study', 665.1, (1024, 768)), ('navcam', 1236.1, (1024, 768)), ('vga', 457.0, (640, 480))],
)
def test_focal_length_follows_field_of_view_and_width(rig, focal, size):
    camera = RIGS[rig].camera()
    assert camera.fx == pytest.approx(focal, abs=0.1)
    assert (camera.width, camera.height) == size
    half = RIGS[rig].camera(size[0] // 2)
    assert half.fx == pytest.approx(camera.fx / 2)


def test_standard_suite_covers_all_conditions_and_rigs_without_shared_seeds():
    scenes = load_suite('standard')
    tuning = [scene for scene in scenes if scene.name.startswith('tune_')]
    reporting = [scene for scene in scenes if scene.name.startswith('report_')]
    assert len(tuning) + len(reporting) == len(scenes)
    # Reported figures stay comparable only if these scenes do not change.
    assert len(reporting) == 16
    assert {scene.rig for scene in tuning} == {scene.rig for scene in reporting} == set(RIGS)
    assert {name for scene in scenes for name in scene.conditions} == set(PRESETS) - set(
        HAZARD_PRESETS
    )
    assert len({scene.seed for scene in scenes}) == len(scenes)
    assert 'standard' in suite_names()


def test_hazard_suite_covers_all_its_conditions_in_separate_families():
    scenes = load_suite('hazards')
    families = {
        prefix: [scene for scene in scenes if scene.name.startswith(prefix)]
        for prefix in ('hazard_tune_', 'hazard_report_')
    }
    tuning, reporting = families.values()
    assert len(tuning) + len(reporting) == len(scenes)
    assert len(reporting) == 14
    assert {scene.rig for scene in tuning} == {scene.rig for scene in reporting} == set(RIGS)
    assert {name for scene in scenes for name in scene.conditions} >= set(HAZARD_PRESETS)
    ground = [
        {name for scene in family for name in scene.conditions if name in LANDFORMS}
        for family in (tuning, [*reporting])
    ]
    training = {name for scene in load_suite('training_wide') for name in scene.conditions}
    assert ground[0] >= {'ledge_up', 'ledge_down', 'cliff', 'trench'}
    assert not ground[1] & (ground[0] | training)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('scenes: [{name: a, sed: 1}]', 'scene 1'),
        ('scenes: [{name: a, conditions: [nun]}]', "scene a: unknown condition 'nun'"),
        ('scenes: [{name: a}, {name: a}]', 'two scenes are named a'),
        ('scenes: []', 'expected a list named scenes'),
        ('scenes: [', 'suite .*mine.yaml'),
    ],
)
def test_invalid_suite_is_refused(tmp_path, text, message):
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=message):
        load_suite(str(path))


def test_unknown_suite_is_refused():
    with pytest.raises(
        ConfigurationError,
        match="no suite 'standart': expected one of drawn, hazards, samples, standard",
    ):
        load_suite('standart')


def test_cached_bag_is_not_rendered_again(tmp_path, monkeypatch):
    rendered = []

    def write(path, scene, frames):
        rendered.append(scene)
        path.mkdir(parents=True)

    monkeypatch.setattr(cache, 'write_labelled_bag', write)
    scene = scene_of('one', 1)
    first = cache.simulated_bag(scene, tmp_path)
    assert cache.simulated_bag(scene, tmp_path) == first
    assert first.name == 'one'
    assert cache.simulated_bag(scene_of('one', 2), tmp_path) != first
    assert [scene.seed for scene in rendered] == [1, 2]


def test_concurrent_rendering_of_a_scene(tmp_path, monkeypatch):
    scene = scene_of('one', 1)
    cached = tmp_path / cache.scene_key(scene) / 'one'

    def write(path, scene, frames):
        for each in (path, cached):
            each.mkdir(parents=True)
            (each / 'metadata.yaml').write_text('whole')

    monkeypatch.setattr(cache, 'write_labelled_bag', write)
    assert cache.simulated_bag(scene, tmp_path) == cached
    assert (cached / 'metadata.yaml').read_text() == 'whole'
    assert list(cached.parent.iterdir()) == [cached]


def test_unwritable_cache_is_named(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(OutputError, match=r'cannot write into .*file'):
        cache.simulated_bag(scene_of('one', 1), tmp_path / 'file')


def test_cache_folder_follows_xdg(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    assert cache.cache_folder().parent == tmp_path


def test_missing_llvm_names_the_install_command(monkeypatch):
    monkeypatch.delenv('DRJIT_LIBLLVM_PATH', raising=False)
    monkeypatch.setattr(renderer, '_find_llvm', lambda: None)
    with pytest.raises(MissingExtraError, match='sudo apt-get install libllvm19'):
        renderer.load_mitsuba()


def test_incompatible_llvm_is_named(monkeypatch):
    class Mitsuba:
        def set_variant(self, name):
            raise ImportError('the LLVM backend is inactive')

    monkeypatch.setenv('DRJIT_LIBLLVM_PATH', '/opt/libLLVM-14.so')
    monkeypatch.setattr(renderer.importlib, 'import_module', lambda name: Mitsuba())
    with pytest.raises(MissingExtraError, match=r'cannot use /opt/libLLVM-14.so .* libllvm19'):
        renderer.load_mitsuba()


def test_missing_mitsuba_names_the_install_command(monkeypatch):
    def refuse(name):
        raise ImportError(name)

    monkeypatch.setenv('DRJIT_LIBLLVM_PATH', 'libLLVM.so')
    monkeypatch.setattr(renderer.importlib, 'import_module', refuse)
    with pytest.raises(MissingExtraError, match='pip install mitsuba'):
        renderer.load_mitsuba()
