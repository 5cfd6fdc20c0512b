"""Cache of labelled bags, because rendering takes much longer than reading."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
from collections.abc import Callable
from functools import lru_cache
from importlib import metadata, resources
from pathlib import Path
from tempfile import TemporaryDirectory

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.simulation.bag import write_labelled_bag
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.frames import STEPS_PER_FRAME, render

# These modules choose scenes but do not affect how a scene is rendered.
_NOT_RENDERING = {
    '__init__.py',
    'cache.py',
    'hazard_presets.py',
    'preset.py',
    'presets.py',
    'suite.py',
}
OnProgress = Callable[[int, int], None]


def cache_folder() -> Path:
    """Return the user's cache folder, following the XDG specification."""
    base = os.environ.get('XDG_CACHE_HOME')
    return (Path(base) if base else Path.home() / '.cache') / 'rover_obstacle_detection'


def scene_key(scene: Scene) -> str:
    """Return a hash of the scene and of the code that renders it."""
    text = json.dumps(scene.to_mapping(), sort_keys=True) + _code_version()
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def cached_bag(scene: Scene, folder: Path) -> Path:
    """Return where the cache has the labelled bag of a scene, or would have it."""
    return folder / scene_key(scene) / scene.name


def simulated_bag(
    scene: Scene, folder: Path, on_progress: OnProgress = lambda done, expected: None
) -> Path:
    """Return the labelled bag of a scene, rendering it if it is not in the cache.

    Parameters
    ----------
    scene : Scene
    folder : Path
        The cache, such as `cache_folder`.
    on_progress : callable
        Called with the steps done and the total.

    Raises
    ------
    MissingExtraError
        If the scene must be rendered and Mitsuba or LLVM is missing.
    OutputError
        If the bag cannot be written.
    """
    path = cached_bag(scene, folder)
    if path.exists():
        return path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        msg = f'cannot write into {folder}: {error.strerror}'
        raise OutputError(msg) from error
    with TemporaryDirectory(prefix='.rendering-', dir=path.parent) as temporary:
        rendered = Path(temporary) / scene.name
        render_bag(scene, rendered, on_progress)
        try:
            rendered.rename(path)
        except OSError:
            # Another process may have finished first. Its bag is identical.
            if not path.exists():
                raise
    return path


def render_bag(
    scene: Scene, path: Path, on_progress: OnProgress = lambda done, expected: None
) -> None:
    """Render a scene and write its labelled bag."""
    expected = scene.drive.frames * STEPS_PER_FRAME
    done = itertools.count(1)
    on_progress(0, expected)
    frames = render(scene, lambda: on_progress(next(done), expected))
    write_labelled_bag(path, scene, frames)


@lru_cache(maxsize=1)
def _code_version() -> str:
    digest = hashlib.sha256()
    folder = resources.files(__package__)
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.name.endswith('.py') and entry.name not in _NOT_RENDERING:
            digest.update(entry.read_bytes())
    try:
        digest.update(metadata.version('mitsuba').encode())
    except metadata.PackageNotFoundError:
        digest.update(b'none')
    return digest.hexdigest()
