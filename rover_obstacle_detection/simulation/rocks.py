"""Positions and sizes of rocks, with sizes after Golombek and Rapp (1997)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.simulation import streams
from rover_obstacle_detection.simulation.description import RockParameters
from rover_obstacle_detection.simulation.poses import CameraPose, HeightFunction
from rover_obstacle_detection.simulation.rigs import Rig
from rover_obstacle_detection.simulation.terrain import Apron

_SMALLEST_PX = 2.5
"""Rocks narrower than this in the image are left out."""
_FARTHEST_M = 150.0
_MOST_ROCKS = 60000
"""Bounds memory; instance numbers must also fit 16 bits."""
_BINS_PER_DECADE = 12
_PEBBLES_M = (0.01, 0.05)
_APRON_REACH_M = 12.0
_APRON_SMALLEST_M = 0.06
"""Smaller rocks get no soil heaped against them."""
_UNEVEN = 0.5
"""Greatest difference of the ground below a rock, relative to its diameter."""
_BRIM_M, _BRIM_RISE_M = 0.15, 0.03
"""No rock lies where the ground is this much higher than around it, on average."""
_OVERLAP = 0.42
"""Smallest distance of two rocks, relative to the sum of their diameters."""
_OVERLAP_SMALLEST_M = 0.05
"""Overlaps with rocks smaller than this are not checked."""


@dataclass(frozen=True)
class RockField:
    """Rocks, largest first. The instance number of a rock is its index plus one.

    Parameters
    ----------
    x_m, y_m : ndarray of float64, shape (n,)
        Position of each rock's centre.
    diameter_m : ndarray of float64, shape (n,)
    seed : ndarray of int64, shape (n,)
        Seed of the shape, attitude, burial and colour of each rock.
    """

    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    diameter_m: NDArray[np.float64]
    seed: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.diameter_m.size)

    def aprons(self, poses: Sequence[CameraPose]) -> list[Apron]:
        """Return the soil heaped by wind against the larger rocks near the drive."""
        near = np.zeros(len(self), bool)
        for pose in poses:
            x, y = pose.ground_below
            near |= np.hypot(self.x_m - x, self.y_m - y) < _APRON_REACH_M
        near &= self.diameter_m > _APRON_SMALLEST_M
        return [
            Apron(float(x), float(y), float(0.62 * d), float(0.045 * d))
            for x, y, d in zip(self.x_m[near], self.y_m[near], self.diameter_m[near], strict=True)
        ]

    def away_from_edges(self, height: HeightFunction) -> RockField:
        """Return the rocks without those that lie across an edge or at a brim.

        Even pebbles at a brim stand high above the local ground, which is low-passed.

        Parameters
        ----------
        height : callable
            Returns the height (m) of landforms with edges at positions x, y.
        """
        own = height(self.x_m.astype(np.float32), self.y_m.astype(np.float32))
        keep = np.ones(len(self), bool)
        for reach in (0.5 * self.diameter_m, _BRIM_M):
            around = np.stack(
                [
                    height(
                        (self.x_m + reach * math.cos(turn)).astype(np.float32),
                        (self.y_m + reach * math.sin(turn)).astype(np.float32),
                    )
                    for turn in np.arange(8) * math.pi / 4
                ]
            )
            keep &= own - around.mean(0) < _BRIM_RISE_M
            if reach is not _BRIM_M:
                keep &= np.ptp(around, axis=0) < _UNEVEN * self.diameter_m + _BRIM_RISE_M
        return RockField(self.x_m[keep], self.y_m[keep], self.diameter_m[keep], self.seed[keep])


def cover_exponent(cover: float) -> float:
    """Return q (1/m) of the law F_k(D) = k exp(-q D) (Golombek and Rapp 1997, eq. 5)."""
    return 1.79 + 0.152 / cover


def covered_fraction(diameter_m: float, cover: float) -> float:
    """Return the fraction of the ground covered by rocks larger than a diameter."""
    return cover * math.exp(-cover_exponent(cover) * diameter_m)


def rocks_per_square_metre(low_m: float, high_m: float, cover: float) -> float:
    """Return the number of rocks per square metre in a narrow bin of diameters."""
    area = covered_fraction(low_m, cover) - covered_fraction(high_m, cover)
    mean_square = (low_m * low_m + low_m * high_m + high_m * high_m) / 3
    return area / (math.pi / 4 * mean_square)


def scatter(
    parameters: RockParameters,
    rig: Rig,
    camera: StereoCamera,
    poses: Sequence[CameraPose],
    seed: int,
) -> RockField:
    """Draw the rocks of a scene, each size up to the distance where it is too small to see.

    Parameters
    ----------
    parameters : RockParameters
    rig : Rig
    camera : StereoCamera
        At the size of the rendered images.
    poses : sequence of CameraPose
        Of the whole drive. Rocks lie within view of any of them.
    seed : int
    """
    rng = np.random.default_rng([seed, streams.ROCK_FIELD])
    parts = [_placed(parameters, rig, camera, poses[0], rng)] if parameters.placed else []
    for low, high, density in _sizes(parameters):
        place = _positions(density, high, camera, poses, rng)
        diameter = np.exp(rng.uniform(math.log(low), math.log(high), len(place)))
        parts.append((place, diameter))
    if not parts:
        none = np.empty(0)
        return RockField(none, none, none, np.empty(0, np.int64))
    place, diameter = (np.concatenate(part) for part in zip(*parts, strict=True))
    keep = _clear_of_rover(place, diameter, poses, rig)
    place, diameter = place[keep], diameter[keep]
    first = np.argsort(-diameter, kind='stable')
    place, diameter = place[first], diameter[first]
    keep = _not_inside_another(place, diameter)
    place, diameter = place[keep][:_MOST_ROCKS], diameter[keep][:_MOST_ROCKS]
    seeds = rng.integers(0, 2**31, len(diameter))
    return RockField(place[:, 0], place[:, 1], diameter, seeds)


def _sizes(parameters: RockParameters) -> list[tuple[float, float, float]]:
    """Return bins of diameters: lower end, upper end, rocks per square metre."""
    sizes = []
    low, high = parameters.smallest_m, parameters.largest_m
    if parameters.cover > 0 and high > low:
        for a, b in _bins(low, high):
            sizes.append((a, b, rocks_per_square_metre(a, b, parameters.cover)))
    if parameters.pebble_cover > 0:
        bins = _bins(*_PEBBLES_M)
        for a, b in bins:
            # Every logarithmic bin covers the same area.
            area = parameters.pebble_cover / len(bins)
            sizes.append((a, b, area / (math.pi / 4 * a * b)))
    return sizes


def _bins(low: float, high: float) -> list[tuple[float, float]]:
    count = max(1, round(_BINS_PER_DECADE * math.log10(high / low)))
    edges = np.geomspace(low, high, count + 1)
    return [(float(a), float(b)) for a, b in itertools.pairwise(edges)]


def _positions(
    density: float,
    high: float,
    camera: StereoCamera,
    poses: Sequence[CameraPose],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    reach = min(_FARTHEST_M, camera.fx * high / _SMALLEST_PX)
    centres = np.array([pose.ground_below for pose in poses])
    low_corner, high_corner = centres.min(0) - reach, centres.max(0) + reach
    area = float(np.prod(high_corner - low_corner))
    number = rng.poisson(density * area)
    place = rng.uniform(low_corner, high_corner, (number, 2))
    seen = np.zeros(number, bool)
    half_view = camera.width / 2 / camera.fx
    for pose in poses:
        offset = place - pose.ground_below
        cosine, sine = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        ahead = offset @ (cosine, sine)
        aside = np.abs(offset @ (-sine, cosine))
        # Rocks just outside the view may cast shadows into it.
        margin = 0.5 + 6 * high
        seen |= (
            (ahead > -margin)
            & (aside < 1.2 * half_view * (np.maximum(ahead, 0) + 1.0) + margin)
            & (np.hypot(ahead, aside) < reach)
        )
    return np.asarray(place[seen], np.float64)


def _placed(
    parameters: RockParameters,
    rig: Rig,
    camera: StereoCamera,
    pose: CameraPose,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # Uniform in the image rather than on the ground, for near and far rocks alike.
    horizon = camera.cy - camera.fy * math.tan(math.radians(pose.pitch_deg))
    top = max(0.04 * camera.height, horizon + 0.05 * camera.height)
    number = parameters.placed
    column = rng.uniform(0.04 * camera.width, 0.96 * camera.width, 4 * number)
    row = rng.uniform(top, 0.93 * camera.height, 4 * number)
    diameter = np.exp(
        rng.uniform(
            math.log(parameters.placed_smallest_m),
            math.log(parameters.placed_largest_m),
            4 * number,
        )
    )
    ray = np.column_stack(
        [(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, np.ones_like(row)]
    )
    direction = ray @ pose.rotation.T
    depth = rig.camera_height_m / np.maximum(-direction[:, 2], 1e-3)
    place = (pose.position + direction * depth[:, np.newaxis])[:, :2]
    # Leave out rocks that fill the view.
    fits = (camera.fx * diameter / depth < 0.2 * camera.width) & (depth < 40.0)
    return place[fits][:number], diameter[fits][:number]


def _clear_of_rover(
    place: NDArray[np.float64],
    diameter: NDArray[np.float64],
    poses: Sequence[CameraPose],
    rig: Rig,
) -> NDArray[np.bool_]:
    keep = np.ones(len(diameter), bool)
    for pose in poses:
        distance = np.hypot(*(place - pose.ground_below).T)
        free = np.where(diameter > 0.08, 0.25 + 0.7 * diameter, 0.0)
        # Keep rocks that may reach the camera farther away.
        tall = np.where(diameter > 0.8 * rig.camera_height_m, 1.2 + diameter, 0.0)
        keep &= distance > np.maximum(free, tall)
    return keep


def _not_inside_another(
    place: NDArray[np.float64], diameter: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which rocks do not lie inside a larger one. They may touch."""
    keep = np.ones(len(diameter), bool)
    for index in range(int((diameter > _OVERLAP_SMALLEST_M).sum())):
        if keep[index]:
            distance = np.hypot(*(place[index + 1 :] - place[index]).T)
            keep[index + 1 :] &= distance > _OVERLAP * (diameter[index] + diameter[index + 1 :])
    return keep
