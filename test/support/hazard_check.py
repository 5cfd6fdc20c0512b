"""Judge a detection by what a hazard scene expects of each pixel, as a table.

    PYTHONPATH=.:test/support python test/support/hazard_check.py [PATTERN ...] [--gravity]
        [--save DIR] [--set max_step=0.2] [--noise 3] [--random 40 --seed 1] [--quiet]

Patterns are those of file names, such as ``drop_*`` or ``*_mast``; by default, all scenes. With
``--random``, scenes drawn at random take the place of the list.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from hazard_scene import HazardScene, View
from hazard_scenes import HAZARD_SCENES
from random_scenes import random_scenes
from surfaces import BLIND, BRIM, FREE, NOT_FREE, OBSTACLE

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import ObstacleDetectionError

MIN_PIXELS = 50
MAX_SHARE = {FREE: 0.01, OBSTACLE: 0.2, NOT_FREE: 0.05, BLIND: 0.05}
MIN_MARKED_COLUMNS = 0.9
COLOURS = {FREE: (0, 200, 0), OBSTACLE: (0, 0, 255), NOT_FREE: (255, 0, 255)}
COLOURS |= {BRIM: (0, 255, 255), BLIND: (255, 128, 0)}


def judge(
    scene: HazardScene, *, gravity: bool = False, save: Path | None = None, **detector: Any
) -> tuple[bool, str]:
    """Say whether the detector meets a scene's expectations, and its figures.

    Parameters
    ----------
    gravity : bool
        Tell the detector the true vertical and the height of the camera; not where the fault is
        that nobody knows it.
    save : path, optional
        Write a picture of the expectation and the result to this folder.
    **detector
        For `Detector`; ``config`` overrides the scene's, and may be a mapping.
    """
    view = scene.render()
    config = detector.pop('config', {})
    if not isinstance(config, DetectorConfig):
        config = DetectorConfig(**{**scene.config, **config})
    told = gravity and not scene.fault.upside_down
    detection: Detection | None = None
    try:
        detection = Detector(scene.camera, config, **detector).detect(
            view.left, view.right, gravity=scene.gravity if told else None
        )
        ok, text = verdict(view.expected, detection.mask > 0, detection.known)
        text += f'; {_pose(detection, scene)}'
    except ObstacleDetectionError as error:
        ok = scene.may_refuse or not np.isin(view.expected, (FREE, OBSTACLE, BRIM)).any()
        text = f'refused: {error}'
    if save:
        draw(save / f'{scene.name}.png', view, detection)
    return ok, text


def verdict(expected: np.ndarray, obstacle: np.ndarray, known: np.ndarray) -> tuple[bool, str]:
    """Compare a mask with what is expected of each pixel."""
    free = known & ~obstacle
    rows = []
    for value, what, bad in (
        (FREE, 'phantom', obstacle),
        (OBSTACLE, 'missed', ~obstacle),
        (NOT_FREE, 'called free', free),
        (BLIND, 'judged although blind', obstacle | free),
    ):
        where = expected == value
        if where.sum() > MIN_PIXELS:
            share, limit = float(bad[where].mean()), MAX_SHARE[value]
            rows.append((share <= limit, f'{what} {share:.3f} (at most {limit})'))
    band = expected == BRIM
    columns = band.any(axis=0)
    if columns.any():
        # Columns without a brim count as marked, as in the cases that users reported.
        share = float(((obstacle & band).any(axis=0) | ~columns).mean())
        text = f'brim marked in {share:.3f} of the columns (at least {MIN_MARKED_COLUMNS})'
        rows.append((share >= MIN_MARKED_COLUMNS, text))
    return all(ok for ok, _ in rows), '; '.join(text for _, text in rows)


def _pose(detection: Detection, scene: HazardScene) -> str:
    ground = detection.ground
    pitch = np.degrees(np.arcsin(np.clip(-ground.up[2], -1, 1)))
    text = f'camera {ground.height_m:.2f} m ({scene.height_m:.2f}), '
    text += f'pitch {pitch:.1f} ({scene.pitch_deg:.1f})'
    known = detection.known.mean()
    return f'{text}, known {known:.2f}' + ''.join(f'; {each}' for each in detection.warnings)


def draw(path: Path, view: View, detection: Detection | None) -> None:
    """Write the left image, the expectation and the result (red; unknown dark), side by side."""
    left = cv2.cvtColor(view.left, cv2.COLOR_GRAY2BGR)
    expectation, result = left.copy(), left.copy()
    for value, colour in COLOURS.items():
        _tint(expectation, view.expected == value, colour)
    if detection is None:
        result //= 4
    else:
        result[~detection.known] //= 4
        _tint(result, detection.mask > 0, COLOURS[OBSTACLE])
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.hstack((left, expectation, result)))


def _tint(image: np.ndarray, where: np.ndarray, colour: tuple[int, int, int]) -> None:
    image[where] = (0.5 * image[where] + 0.5 * np.array(colour)).astype(np.uint8)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('patterns', nargs='*', default=['*'], help='names of scenes, with * and ?')
    parser.add_argument('--gravity', action='store_true', help='tell the true vertical and height')
    parser.add_argument('--save', type=Path, help='folder for a picture of each scene')
    parser.add_argument('--random', type=int, help='number of scenes drawn at random')
    parser.add_argument('--seed', type=int, default=0, help='of the scenes drawn at random')
    parser.add_argument('--noise', type=float, help='image noise in grey levels')
    parser.add_argument(
        '--set', action='append', default=[], metavar='NAME=VALUE', help='detector parameter'
    )
    parser.add_argument('--quiet', action='store_true', help='print failures and totals only')
    return parser.parse_args(arguments)


def _config(settings: list[str]) -> dict[str, Any]:
    """Read ``name=value``, each value in the type of the parameter's default."""
    default, config = DetectorConfig(), {}
    for setting in settings:
        name, _, text = setting.partition('=')
        kind = type(getattr(default, name))
        config[name] = text.lower() == 'true' if kind is bool else kind(text)
    return config


def main(arguments: list[str] | None = None) -> int:
    chosen = _arguments(arguments)
    config = _config(chosen.set)
    passed, total = Counter[str](), Counter[str]()
    scenes = HAZARD_SCENES
    if chosen.random:
        scenes = random_scenes(chosen.random, chosen.seed)
    for scene in scenes:
        if not any(fnmatch(scene.name, pattern) for pattern in chosen.patterns):
            continue
        if chosen.noise is not None:
            scene = scene.with_noise(chosen.noise)
        scene.render()
        start = time.perf_counter()
        ok, text = judge(scene, gravity=chosen.gravity, save=chosen.save, config=config)
        seconds = time.perf_counter() - start
        total[scene.kind] += 1
        passed[scene.kind] += ok
        if not (ok and chosen.quiet):
            mark = 'ok  ' if ok else 'FAIL'
            print(f'{mark} {scene.name:46} {seconds:4.1f} s  {text}', flush=True)
    for kind, count in total.items():
        print(f'{kind}: {passed[kind]} of {count}')
    print(f'{passed.total()} of {total.total()} scenes')
    return int(passed.total() < total.total())


if __name__ == '__main__':
    sys.exit(main())
