"""Training examples: features of the cells of a map, and the labels of the pixels in them."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from training_bags import straightened_labels

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.methods.measurement import measure
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.terrain.cell_evidence import cell_evidence
from rover_obstacle_detection.detection.terrain.cell_features import (
    TRAINED_SLOPES_DEG,
    TRAINED_STEPS_M,
    cell_features,
)
from rover_obstacle_detection.detection.terrain.likely_hazards import share_of_cells
from rover_obstacle_detection.detection.terrain.terrain import Layer, Terrain
from rover_obstacle_detection.errors import BagError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import DROP, FREE, SLOPE
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics
from rover_obstacle_detection.simulation.description import Scene, TruthParameters
from rover_obstacle_detection.simulation.frames import SceneWorld
from rover_obstacle_detection.simulation.renderer import Hits

LABELS = (SLOPE, DROP, FREE)
"""Labels of pixels, in the order of the network's classes."""


@dataclass(frozen=True, eq=False)
class MapExample:
    """A labelled map.

    Parameters
    ----------
    features : ndarray of float16, shape (features, rows, columns)
    pixels : ndarray of uint16, shape (classes, rows, columns)
        Number of pixels of each cell with each of `LABELS`. Rocks do not count.
    """

    features: NDArray[np.float16]
    pixels: NDArray[np.uint16]


def random_limits(generator: np.random.Generator) -> DetectorConfig:
    """Draw the limits of a rover."""
    return DetectorConfig(
        max_step=math.exp(generator.uniform(*np.log(TRAINED_STEPS_M))),
        max_slope=float(generator.uniform(*TRAINED_SLOPES_DEG)),
    )


def limits_of(config: DetectorConfig, truth: TruthParameters) -> TruthParameters:
    """Replace the limits of the labels by those of a rover."""
    return replace(
        truth,
        clearance_m=config.max_step,
        drop_m=config.max_step,
        slope_limit_deg=config.max_slope,
    )


def examples_of_bag(path: Path) -> list[MapExample]:
    """Make examples of all labelled frames of a recording, and name the frames that are skipped.

    Frames of rendered scenes are judged twice: for the default limits, and for random ones with
    the true vertical.

    Raises
    ------
    ObstacleDetectionError
        If the recording cannot be read or has no labels.
    """
    print(f'reading {path.name}', file=sys.stderr)
    world = _world(path)
    seed = world.scene.seed if world else 0
    generator = np.random.default_rng([seed, 78])
    with open_bag(path) as bag:
        frames, _ = labelled_frames(bag, find_truth_topics(bag), BagOptions())
        labelled = [
            (number, frame)
            for number, frame in enumerate(frames)
            if not isinstance(frame, BadFrame)
        ]
    if not labelled:
        msg = f'{path}: no labelled frame'
        raise BagError(msg)
    examples: list[MapExample] = []
    for number, frame in labelled:
        try:
            examples += examples_of(frame, DetectorConfig())
            if world is not None:
                limits = random_limits(generator)
                again = _labelled_again(frame, world, number, limits)
                examples += examples_of(again, limits, told_vertical=True)
        except UnjudgeablePairError as error:
            print(f'skipped: {path}: {error}', file=sys.stderr)
    return examples


def examples_of(
    frame: LabelledFrame, config: DetectorConfig, *, told_vertical: bool = False
) -> list[MapExample]:
    """Measure a frame as the detector does.

    Raises
    ------
    UnjudgeablePairError
        If the pair says nothing about the ground, or contradicts itself.
    """
    parameters = DetectorParameters.from_config(config)
    gravity = frame.gravity if told_vertical else None
    full = Frame(grey_pair(frame.left, frame.right, frame.camera), frame.camera, gravity)
    measured = measure(full, parameters)
    labels = straightened_labels(frame.labels, measured.frame.camera, measured.correction)
    edges = measured.brims.edge(parameters.terrain.brims)
    return examples_of_terrain(measured.terrain, measured.stereo.ground, edges, labels, parameters)


def examples_of_terrain(
    terrain: Terrain,
    ground: GroundPlane,
    edges: NDArray[np.bool_],
    labels: NDArray[np.uint8],
    parameters: DetectorParameters,
) -> list[MapExample]:
    """Make an example of each map.

    Parameters
    ----------
    terrain : Terrain
    ground : GroundPlane
    edges : ndarray of bool, shape (height, width)
        Edges of brims.
    labels : ndarray of uint8, shape (height, width)
    parameters : DetectorParameters
    """
    p = parameters.terrain
    examples = []
    for each in cell_evidence(terrain, ground, p):
        brim = share_of_cells(edges, each.layer)
        features = cell_features(each.layer, each.rise, each.hollows, brim, ground, p)
        pixels = pixels_by_label(each.layer, labels)
        examples.append(MapExample(features.astype(np.float16), pixels.astype(np.uint16)))
    return examples


def pixels_by_label(layer: Layer, labels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Count the pixels of each cell with each of `LABELS`, shape (classes, rows, columns)."""
    positions = layer.positions
    rows, columns = positions.shape
    inside = layer.pixels & positions.inside
    row, column = np.rint(positions.row[inside]), np.rint(positions.column[inside])
    cell = (np.clip(row, 0, rows - 1) * columns + np.clip(column, 0, columns - 1)).astype(np.intp)
    found = labels[layer.rows][inside]
    return np.stack(
        [np.bincount(cell[found == label], minlength=rows * columns) for label in LABELS]
    ).reshape(len(LABELS), rows, columns).astype(np.float32)  # fmt: skip


def _world(path: Path) -> SceneWorld | None:
    """Read the scene that a bag was rendered from; None for other recordings."""
    with AnyReader([path]) as reader:
        found = [each for each in reader.connections if each.topic == '/truth/scene']
        for connection, _, data in reader.messages(found) if found else ():
            text = reader.deserialize(data, connection.msgtype).data
            return SceneWorld(Scene.from_mapping(json.loads(text)))
    return None


def _labelled_again(
    frame: LabelledFrame, world: SceneWorld, number: int, config: DetectorConfig
) -> LabelledFrame:
    """Label a rendered frame for other limits."""
    assert frame.depth_m is not None
    pose, scene = world.poses[number], world.scene
    world.scene = replace(scene, truth=limits_of(config, scene.truth))
    hits = Hits(frame.depth_m, frame.instances)
    labels = world.label(hits, pose, world.rock_mesh(pose))
    world.scene = scene
    return replace(frame, labels=labels)
