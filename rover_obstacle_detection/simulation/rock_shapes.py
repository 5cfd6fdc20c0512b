"""Shape and colour of rocks: spheres cut by planes, with fractal relief."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation import streams
from rover_obstacle_detection.simulation.description import RockParameters
from rover_obstacle_detection.simulation.noise import solid_noise
from rover_obstacle_detection.simulation.rocks import RockField

Floats = NDArray[np.float32]
Indices = NDArray[np.uint32]

_FINEST = 7
"""Highest subdivision level of a rock: 328,000 triangles."""
_SHARED_SHAPES = 96
_OWN_SHAPE_M = 0.10
"""Smaller rocks share shapes, rotated and stretched differently, to save time."""
_SLAB_AXES = (1.0, 0.38, 0.92)
_SLAB_FLAT = 0.4
"""Half the thickness of slabs before they are scaled along the axes."""
_ANGULAR_WEAR, _ANGULAR_DEEPER = 0.006, 0.16
"""Radius of edges, and how much closer to the centre the faces are, of angular rocks."""
_VERTICES_AT_ONCE = 400_000
"""Bounds the memory of one batch of rocks."""


@dataclass(frozen=True)
class RockMesh:
    """Triangle mesh of many rocks.

    Parameters
    ----------
    vertices : ndarray of float32, shape (v, 3)
        World coordinates, metres.
    faces : ndarray of uint32, shape (f, 3)
    colours : ndarray of float32, shape (v, 3)
        Linear RGB reflectance.
    instance : ndarray of int32, shape (f,)
        Rock number of each face, starting at 1.
    """

    vertices: Floats
    faces: Indices
    colours: Floats
    instance: NDArray[np.int32]


@dataclass(frozen=True)
class RockTones:
    """Linear RGB reflectances of rocks, shape (n, 3), and of the dust on them, shape (3,)."""

    tones: Floats
    dust: Floats
    dust_strength: float


@lru_cache(maxsize=_FINEST + 1)
def icosphere(level: int) -> tuple[Floats, Indices]:
    """Return vertices (v, 3) and faces (f, 3) of a unit sphere of 20 * 4^level triangles."""
    if level == 0:
        golden = (1 + math.sqrt(5)) / 2
        corners = [(a, b * golden, 0.0) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
        vertices = np.array(
            [corner for a, b, c in corners for corner in ((a, b, c), (c, a, b), (b, c, a))],
            np.float64,
        )
        distance = np.linalg.norm(vertices[:, np.newaxis] - vertices, axis=2)
        near = np.isclose(distance, 2.0)
        faces = [
            (i, j, k)
            for i in range(12)
            for j in range(i + 1, 12)
            for k in range(j + 1, 12)
            if near[i, j] and near[j, k] and near[i, k]
        ]
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
        triangles = np.array(faces)
        a, b, c = (vertices[triangles[:, n]] for n in range(3))
        inward = np.einsum('ij,ij->i', np.cross(b - a, c - a), a) < 0
        triangles[inward] = triangles[inward][:, ::-1]
        return vertices.astype(np.float32), triangles.astype(np.uint32)
    vertices32, faces32 = icosphere(level - 1)
    edges = np.sort(
        np.concatenate([faces32[:, [0, 1]], faces32[:, [1, 2]], faces32[:, [2, 0]]]), axis=1
    )
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    middle = vertices32[unique[:, 0]] + vertices32[unique[:, 1]]
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    ab, bc, ca = (inverse.reshape(-1).reshape(3, -1) + len(vertices32)).astype(np.uint32)
    a, b, c = faces32.T
    split = np.concatenate(
        [np.stack(corner, 1) for corner in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
    )
    return np.concatenate([vertices32, middle]).astype(np.float32), split


class RockMaker:
    """Makes rock meshes at image resolution.

    Parameters
    ----------
    seed : int
    tones : RockTones
    parameters : RockParameters
        Kinds of shapes, tone and dust.
    """

    def __init__(
        self, seed: int, tones: RockTones, parameters: RockParameters | None = None
    ) -> None:
        rng = np.random.default_rng([seed, streams.ROCK_TEXTURE])
        self._seed = seed
        self._tones = tones
        self._parameters = RockParameters() if parameters is None else parameters
        self._shape_noise = solid_noise(rng, 1.7)
        self._skin_noise = solid_noise(rng, 1.3)
        self._tone_noise = solid_noise(rng, 0.8)

    def mesh(
        self,
        field: RockField,
        chosen: NDArray[np.int64],
        ground_m: NDArray[np.float64],
        size_px: NDArray[np.float64],
    ) -> RockMesh:
        """Mesh some rocks of a field.

        Parameters
        ----------
        field : RockField
        chosen : ndarray of int64, shape (k,)
            Indices of the rocks to mesh.
        ground_m : ndarray of float64, shape (k,)
            Height of the ground under each rock.
        size_px : ndarray of float64, shape (k,)
            Width of each rock in the image; sets its mesh resolution.
        """
        levels = np.clip(np.ceil(np.log2(np.maximum(size_px, 1) / 4.0)) + 1, 1, _FINEST)
        # The empty arrays make the result valid without rocks.
        vertices, colours = ([np.empty((0, 3), np.float32)] for _ in range(2))
        faces, instance = [np.empty((0, 3), np.uint32)], [np.empty(0, np.int32)]
        count = 0
        for level in np.unique(levels).astype(int):
            sphere, triangles = icosphere(int(level))
            for part in np.array_split(
                np.flatnonzero(levels == level),
                max(1, int((levels == level).sum() * len(sphere) / _VERTICES_AT_ONCE)),
            ):
                rocks = chosen[part]
                points, colour = self._rocks(field, rocks, ground_m[part], sphere, int(level))
                offsets = count + len(sphere) * np.arange(len(rocks), dtype=np.uint32)
                vertices.append(points.reshape(-1, 3))
                colours.append(colour.reshape(-1, 3))
                faces.append((triangles[np.newaxis] + offsets[:, None, None]).reshape(-1, 3))
                instance.append(np.repeat(rocks + 1, len(triangles)).astype(np.int32))
                count += points.shape[0] * points.shape[1]
        return RockMesh(
            np.concatenate(vertices),
            np.concatenate(faces).astype(np.uint32),
            np.concatenate(colours),
            np.concatenate(instance),
        )

    def _rocks(
        self,
        field: RockField,
        rocks: NDArray[np.int64],
        ground_m: NDArray[np.float64],
        sphere: Floats,
        level: int,
    ) -> tuple[Floats, Floats]:
        """Return vertices and colours of rocks of one level, each (k, v, 3)."""
        number = len(rocks)
        own = field.diameter_m[rocks] > _OWN_SHAPE_M
        shapes = np.where(own, field.seed[rocks], field.seed[rocks] % _SHARED_SHAPES)
        unique, index = np.unique(shapes, return_inverse=True)
        bodies = np.stack([self._body(int(shape), sphere, level) for shape in unique])[index]
        rngs = [
            np.random.default_rng([self._seed, streams.ROCK_POSE, int(s)])
            for s in field.seed[rocks]
        ]
        draws = np.array([rng.uniform(size=8) for rng in rngs]).reshape(number, 8)
        axes = np.stack(
            [np.ones(number), 0.68 + 0.3 * draws[:, 0], 0.5 + 0.38 * draws[:, 1]], axis=1
        )
        slab = np.array([self._is_slab(int(shape)) for shape in shapes], bool)
        axes[slab] = np.array(_SLAB_AXES)
        turned = np.einsum('kvi,kij->kvj', bodies * axes[:, np.newaxis], _attitudes(draws))
        half = 0.5 * field.diameter_m[rocks]
        points = turned * half[:, np.newaxis, np.newaxis]
        low, high = points[..., 2].min(1), points[..., 2].max(1)
        buried = 0.18 + 0.3 * draws[:, 5] ** 1.5
        lift = ground_m - (low + buried * (high - low))
        points[..., 2] += lift[:, np.newaxis]
        points[..., 0] += field.x_m[rocks][:, np.newaxis]
        points[..., 1] += field.y_m[rocks][:, np.newaxis]
        above = (points[..., 2] - ground_m[:, np.newaxis]) / np.maximum(
            (1 - buried) * (high - low), 1e-6
        )[:, np.newaxis]
        colours = self._colours(bodies, sphere, above, half, draws)
        return points.astype(np.float32), colours

    def _colours(
        self,
        bodies: Floats,
        sphere: Floats,
        above: NDArray[np.floating],
        half_m: NDArray[np.float64],
        draws: NDArray[np.float64],
    ) -> Floats:
        tones = self._tones
        tone = tones.tones[(draws[:, 6] * len(tones.tones)).astype(int)]
        tone = tone * (0.8 + 0.4 * draws[:, 7])[:, np.newaxis]
        # Mottling of a few centimetres and mineral grain of a few millimetres.
        place = bodies * half_m[:, np.newaxis, np.newaxis].astype(np.float32) + np.float32(
            7.3
        ) * draws[:, np.newaxis, :3].astype(np.float32)
        mottle = self._tone_noise.read((place / 0.25).astype(np.float32))
        grain = self._tone_noise.read((place / 0.06).astype(np.float32))
        value = np.exp(0.14 * mottle + 0.16 * grain)
        colour = tone[:, np.newaxis] * value[..., np.newaxis]
        # Dust settles on top, and soil stains the foot.
        dusty = np.clip(above - 0.55 + 0.15 * mottle, 0, 1) * 0.5
        dusty += np.clip(0.22 - above + 0.06 * mottle, 0, 0.25) * 2.0
        strength = (tones.dust_strength * (0.4 + draws[:, 0]))[:, np.newaxis]
        dusty = np.clip(dusty * strength * self._parameters.dust, 0, 0.85)[..., np.newaxis]
        colour = colour * (1 - dusty) + tones.dust * dusty
        return np.asarray(colour * np.float32(self._parameters.tone), np.float32)

    def _is_slab(self, shape: int) -> bool:
        # Small rocks share shapes; none of these is a slab.
        return shape >= _SHARED_SHAPES and _chance(shape, 0) < self._parameters.slabs

    def _body(self, shape: int, sphere: Floats, level: int) -> Floats:
        """Return a rock of about unit radius from the vertices of a sphere, shape (v, 3)."""
        rng = np.random.default_rng([self._seed, streams.ROCK_SHAPE, shape])
        radius = np.ones(len(sphere), np.float32)
        rounded = rng.uniform()
        wear = 0.015 + 0.06 * rounded
        angular = _chance(shape, 1) < self._parameters.angular
        if angular:
            rounded, wear = 0.0, _ANGULAR_WEAR
        cuts = int(rng.integers(9, 20))
        for _ in range(cuts // 2 + 4 if angular else cuts):
            normal = rng.standard_normal(3)
            normal /= np.linalg.norm(normal)
            distance = rng.uniform(0.52, 0.88) + 0.14 * rounded
            if angular:
                distance -= _ANGULAR_DEEPER
            cosine = sphere @ normal.astype(np.float32)
            cut = np.where(cosine > 0.2, distance / np.maximum(cosine, 0.2), 3.0)
            # A smooth minimum rounds the edges.
            blend = np.clip(0.5 + 0.5 * (cut - radius) / wear, 0, 1)
            radius = cut * (1 - blend) + radius * blend - wear * blend * (1 - blend)
            radius = radius.astype(np.float32)
        if self._is_slab(shape):
            flat = _SLAB_FLAT / np.maximum(np.abs(sphere[:, 1]), 1e-3)
            radius = np.minimum(radius, flat).astype(np.float32)
        offset = rng.uniform(0, 1, 3).astype(np.float32)
        radius += 0.045 * self._shape_noise.read(sphere * np.float32(0.22) + offset)
        if level > 1:
            skin = np.float32(0.006 + 0.010 * (1 - rounded))
            place = sphere * (0.5 * radius[:, np.newaxis]) + offset
            radius += skin * self._skin_noise.read(place.astype(np.float32))
        return np.asarray(sphere * radius[:, np.newaxis], np.float32)


def _chance(shape: int, purpose: int) -> float:
    """Return a number from 0 to 1 that depends on the shape only, not on a random stream."""
    return (shape * 2654435761 + purpose * 40503 * 65536) % 2**32 / 2**32


def _attitudes(draws: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return random rotations: a tilt of up to 28 degrees, then any heading."""
    turn = 2 * np.pi * draws[:, 2]
    tilt = np.radians(28) * draws[:, 3]
    axis = 2 * np.pi * draws[:, 4]
    zero, one = np.zeros_like(turn), np.ones_like(turn)

    def about_z(angle: NDArray[np.float64]) -> NDArray[np.float64]:
        c, s = np.cos(angle), np.sin(angle)
        rows = [[c, s, zero], [-s, c, zero], [zero, zero, one]]
        return np.moveaxis(np.array(rows), 2, 0)

    c, s = np.cos(tilt), np.sin(tilt)
    about_x = np.moveaxis(np.array([[one, zero, zero], [zero, c, s], [zero, -s, c]]), 2, 0)
    return np.asarray(about_z(axis) @ about_x @ about_z(turn - axis), np.float64)
