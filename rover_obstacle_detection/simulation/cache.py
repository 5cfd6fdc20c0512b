"""Labelled bags kept from one call to the next: rendering takes longer than reading."""

from __future__ import annotations

import hashlib
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

# What only chooses scenes, and does not make them.
_CHOOSERS = {'__init__.py', 'cache.py', 'presets.py', 'suite.py'}
OnProgress = Callable[[int, int], None]


def cache_folder() -> Path:
    """Folder of the rendered bags: of the user, by the XDG rules."""
    base = os.environ.get('XDG_CACHE_HOME')
    return (Path(base) if base else Path.home() / '.cache') / 'rover_obstacle_detection'


def scene_key(scene: Scene) -> str:
    """Name that changes with the scene and with the code that makes it."""
    text = json.dumps(scene.to_mapping(), sort_keys=True) + _code_version()
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def simulated_bag(
    scene: Scene, folder: Path, on_progress: OnProgress = lambda done, expected: None
) -> Path:
    """Return the labelled bag of a scene, rendered only if a folder does not have it yet.

    Parameters
    ----------
    scene : Scene
    folder : Path
        Such as `cache_folder`.
    on_progress : callable
        Called with the steps done and the steps expected.

    Raises
    ------
    MissingExtraError
        If it must be rendered, and Mitsuba or its LLVM is not installed.
    OutputError
        If the bag cannot be written.
    """
    path = folder / scene_key(scene) / scene.name
    if path.exists():
        return path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        msg = f'cannot write into {folder}: {error.strerror}'
        raise OutputError(msg) from error
    with TemporaryDirectory(prefix='.rendering-', dir=path.parent) as own:
        rendered = Path(own) / scene.name
        render_bag(scene, rendered, on_progress)
        try:
            rendered.rename(path)
        except OSError:
            # Another process was faster: the same scene always gives the same bag.
            if not path.exists():
                raise
    return path


def render_bag(
    scene: Scene, path: Path, on_progress: OnProgress = lambda done, expected: None
) -> None:
    """Render a scene and write its labelled bag."""
    expected = scene.drive.frames * STEPS_PER_FRAME
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        on_progress(done, expected)

    on_progress(0, expected)
    write_labelled_bag(path, scene, render(scene, step))


@lru_cache(maxsize=1)
def _code_version() -> str:
    digest = hashlib.sha256()
    folder = resources.files(__package__)
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.name.endswith('.py') and entry.name not in _CHOOSERS:
            digest.update(entry.read_bytes())
    try:
        digest.update(metadata.version('mitsuba').encode())
    except metadata.PackageNotFoundError:
        digest.update(b'none')
    return digest.hexdigest()
