"""A small ray-caster: stereo pairs of flat patches and ellipsoids, with exact depth.

Each image is cast on its own at the same geometry; the right one is never made from the left one.
Patches may mirror. A pair of 640 x 480 pixels takes about 0.2 s.

The texture is anchored to the surfaces. What scenes are made of is in `surfaces`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from ground_texture import tiles, weathered
from surfaces import DAYLIGHT, Light, Look, Patch, Rig, Surface

NOTHING = -1
NEAREST_M = 0.02
AMBIENT = 0.5
SUN = np.array([-0.45, -0.35, 0.82]) / np.linalg.norm([-0.45, -0.35, 0.82])
LENS_BLUR_PX = 0.5


@dataclass(frozen=True, eq=False)
class Eye:
    """An optical centre, its axes as rows, and the rays of a window of its image."""

    origin: np.ndarray
    axes: np.ndarray
    x: np.ndarray
    y: np.ndarray
    focal_px: float

    @classmethod
    def of(cls, rig: Rig, offset_m: float) -> Eye:
        camera, axes = rig.camera, rig.axes
        x, y = (axis.astype(np.float32) for axis in camera.rays())
        origin = np.array([0.0, 0.0, rig.height_m]) + offset_m * axes[0]
        return cls(origin, axes, x, y, camera.fx)

    def mirrored(self, patch: Patch, window: tuple[slice, slice]) -> Eye:
        """Return where the mirror image of the eye stands, with the same rays of a window."""
        normal = patch.normal
        flip = np.eye(3) - 2 * np.outer(normal, normal)
        distance = normal @ (self.origin - patch.corner)
        return Eye(
            self.origin - 2 * distance * normal,
            self.axes @ flip,
            self.x[:, window[1]],
            self.y[window[0]],
            self.focal_px,
        )


@dataclass(eq=False)
class Hits:
    """What each pixel sees: depth, number of the surface, place on it, pixel size, light."""

    depth: np.ndarray
    surface: np.ndarray
    u: np.ndarray
    v: np.ndarray
    footprint_m: np.ndarray
    light: np.ndarray

    @classmethod
    def none(cls, shape: tuple[int, int]) -> Hits:
        zero = [np.zeros(shape, np.float32) for _ in range(4)]
        return cls(np.full(shape, np.inf, np.float32), np.full(shape, NOTHING, np.int16), *zero)

    def take(self, window, closer, **values) -> None:
        for name, value in values.items():
            np.copyto(getattr(self, name)[window], value, where=closer)


@dataclass(frozen=True, eq=False)
class Cast:
    """One pair, and what each pixel shows: depth (NaN in the sky) and number of the surface."""

    left: np.ndarray
    right: np.ndarray
    depth_m: np.ndarray
    surface: np.ndarray
    right_depth_m: np.ndarray
    right_surface: np.ndarray


def cast(
    rig: Rig,
    surfaces: tuple[Surface, ...],
    light: Light = DAYLIGHT,
    seed: int = 0,
    right_moved_m: tuple[float, float] = (0.0, 0.0),
) -> Cast:
    """Render a pair; the right image possibly after the rover moved so far right and ahead."""
    left, hits = _image(Eye.of(rig, 0.0), surfaces, light, seed, 0)
    eye = Eye.of(rig, rig.baseline_m)
    eye = replace(eye, origin=eye.origin + np.array([*right_moved_m, 0.0]))
    right, right_hits = _image(eye, surfaces, light, seed, 1)
    return Cast(left, right, _depth(hits), hits.surface, _depth(right_hits), right_hits.surface)


def _depth(hits: Hits) -> np.ndarray:
    return np.where(hits.surface == NOTHING, np.float32(np.nan), hits.depth)


def _image(eye, surfaces, light, seed, side):
    hits = _trace(eye, surfaces, np.float32(NEAREST_M))
    grey = _grey(eye, surfaces, hits, light, seed)
    for number, surface in enumerate(surfaces):
        if surface.look.mirror and (hits.surface == number).any():
            _add_reflection(grey, eye, surfaces, hits, number, light, seed)
    if light.veil:
        grey = (1 - np.float32(light.veil)) * grey + np.float32(light.veil * light.sky)
    grey = cv2.GaussianBlur(grey * np.float32(light.exposure), (0, 0), LENS_BLUR_PX)
    noise = np.random.default_rng((seed, side)).standard_normal(grey.shape, np.float32)
    grey += np.float32(light.noise) * noise
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8), hits


def _add_reflection(grey, eye, surfaces, hits, number, light, seed):
    mirror = surfaces[number]
    inside = hits.surface == number
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    inside = inside[window]
    behind = eye.mirrored(mirror, window)
    # Only what lies beyond the mirror as seen from the mirrored eye is reflected.
    nearest = np.where(inside, hits.depth[window] * np.float32(1 + 1e-4), np.float32(np.inf))
    others = tuple(each for each in surfaces if each is not mirror)
    image = _grey(behind, others, _trace(behind, others, nearest), light, seed)
    share = np.float32(mirror.look.mirror)
    grey[window][inside] = ((1 - share) * grey[window] + share * image)[inside]


def _trace(eye: Eye, surfaces: tuple[Surface, ...], nearest: np.ndarray) -> Hits:
    hits = Hits.none((eye.y.shape[0], eye.x.shape[1]))
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        for number, surface in enumerate(surfaces):
            hit = _hit_patch if isinstance(surface, Patch) else _hit_ellipsoid
            hit(eye, surface, number, hits, nearest)
    return hits


def _hit_patch(eye: Eye, patch: Patch, number: int, hits: Hits, nearest: np.ndarray) -> None:
    window = _window(eye, patch.corners)
    distance = float(patch.normal @ (patch.corner - eye.origin))
    if window is None or abs(distance) < 1e-9:
        return
    x, y = eye.x[:, window[1]], eye.y[window[0]]
    normal, u, v = (eye.axes @ np.asarray(axis) for axis in (patch.normal, patch.u, patch.v))
    depth = np.float32(distance) / _dot(normal, x, y)
    offset = eye.origin - patch.corner
    on_u = depth * _dot(u, x, y) + np.float32(offset @ np.asarray(patch.u))
    on_v = depth * _dot(v, x, y) + np.float32(offset @ np.asarray(patch.v))
    closer = (depth > _within(nearest, window)) & (depth < hits.depth[window])
    closer &= (on_u >= patch.u_range[0]) & (on_u <= patch.u_range[1])
    closer &= (on_v >= patch.v_range[0]) & (on_v <= patch.v_range[1])
    if not closer.any():
        return
    facing = -math.copysign(1.0, distance) * float(patch.normal @ SUN)
    hits.take(
        window,
        closer,
        depth=depth,
        surface=np.int16(number),
        u=on_u,
        v=on_v,
        footprint_m=_footprint(depth, normal / distance, x, y, eye.focal_px),
        light=np.float32(AMBIENT + (1 - AMBIENT) * max(facing, 0.0)),
    )


def _hit_ellipsoid(eye, ball, number, hits, nearest) -> None:
    centre, radii = np.asarray(ball.centre), np.asarray(ball.radii)
    signs = np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
    window = _window(eye, centre + signs * radii, solid=True)
    if window is None:
        return
    x, y = eye.x[:, window[1]], eye.y[window[0]]
    # In units of the radii the ellipsoid is a ball.
    ray = [_dot(eye.axes[:, axis] / radii[axis], x, y) for axis in range(3)]
    start = (eye.origin - centre) / radii
    squared = sum(each * each for each in ray)
    along = sum(np.float32(at) * each for at, each in zip(start, ray, strict=True))
    depth = (-along - np.sqrt(along**2 - squared * np.float32(start @ start - 1))) / squared
    closer = (depth > _within(nearest, window)) & (depth < hits.depth[window])
    if not closer.any():
        return
    across, ahead, up = (
        np.clip(np.float32(at) + depth * each, -1, 1) for at, each in zip(start, ray, strict=True)
    )
    normal = [each / np.float32(r) for each, r in zip((across, ahead, up), radii, strict=True)]
    facing = sum(np.float32(s) * n for s, n in zip(SUN, normal, strict=True))
    facing /= np.sqrt(sum(n * n for n in normal))
    size = float(radii.mean())
    hits.take(
        window,
        closer,
        depth=depth,
        surface=np.int16(number),
        u=size * np.arctan2(-ahead, up),
        v=size * np.arcsin(across),
        footprint_m=1.3 * depth / np.float32(eye.focal_px),
        light=np.float32(AMBIENT) + np.float32(1 - AMBIENT) * np.maximum(facing, 0),
    )


def _dot(vector, x, y):
    """Product of a vector in the camera frame with the ray of each pixel."""
    a, b, c = vector
    return (a * x + c).astype(np.float32) + (b * y).astype(np.float32)


def _within(nearest, window):
    return nearest if np.ndim(nearest) == 0 else nearest[window]


def _footprint(depth, plane, x, y, focal_px):
    """Size of a pixel on a plane (``plane @ point = 1``), metres.

    Rows show the same lines of the ground in both images, so that along the columns the texture
    may be undersampled a little.
    """
    length = 1 + x * x + y * y
    across, down = (depth * np.float32(each) for each in plane[:2])
    width = 1 - 2 * x * across + across * across * length
    height = 1 - 2 * y * down + down * down * length
    return depth / np.float32(focal_px) * np.sqrt(np.maximum(width, height / 16))


def _window(eye: Eye, corners: np.ndarray, *, solid: bool = False):
    """Return the part of the image that holds a patch or the box around a solid."""
    points = (corners - eye.origin) @ eye.axes.T
    ahead = points[:, 2] > NEAREST_M
    if not ahead.any():
        return None
    if not ahead.all():
        if solid:
            return np.s_[:, :]
        points = _clipped(points)
    limits = []
    for rays, axis in ((eye.y.ravel(), 1), (eye.x.ravel(), 0)):
        place = points[:, axis] / points[:, 2]
        first = np.searchsorted(rays, place.min() - 1 / eye.focal_px)
        last = np.searchsorted(rays, place.max() + 1 / eye.focal_px)
        if first >= last:
            return None
        limits.append(slice(int(first), int(last)))
    return limits[0], limits[1]


def _clipped(points):
    """Cut a polygon where it comes too near to be projected."""
    result = []
    for one, other in zip(points, np.roll(points, -1, axis=0), strict=True):
        if one[2] > NEAREST_M:
            result.append(one)
        if (one[2] > NEAREST_M) != (other[2] > NEAREST_M):
            result.append(one + (other - one) * (NEAREST_M - one[2]) / (other[2] - one[2]))
    points = np.stack(result)
    points[:, 2] = np.maximum(points[:, 2], NEAREST_M)
    return points


def _grey(eye: Eye, surfaces, hits: Hits, light: Light, seed: int) -> np.ndarray:
    looks = [surface.look for surface in surfaces] + [Look(light.sky, 0.0)]
    grey, contrast, tile_m, joint_m = (
        np.array([getattr(look, name) for look in looks], np.float32)[hits.surface]
        for name in ('grey', 'contrast', 'tile_m', 'joint_m')
    )
    # Surfaces, and scenes of another seed, show different parts of the same texture.
    skins = [n if each.skin is None else -each.skin for n, each in enumerate(surfaces)]
    shift = np.array([0.737 * skin + 0.619 * seed for skin in [*skins, 0]]) % 4
    shift = shift.astype(np.float32)[hits.surface]
    pattern = weathered(hits.u + shift, hits.v - shift, hits.footprint_m)
    image = grey * np.maximum(1 + contrast * pattern, 0.05)
    if any(look.tile_m for look in looks):
        image *= tiles(hits.u, hits.v, hits.footprint_m, tile_m, joint_m)
    seen = hits.surface != NOTHING
    image *= np.where(seen, hits.light, np.float32(1))
    if light.shadows:
        image *= _shadow(eye, hits, light.shadows)
    if light.fog:
        clear = np.exp(-np.float32(light.fog) * np.where(seen, hits.depth, np.inf))
        image = clear * image + (1 - clear) * np.float32(light.sky)
    return image


def _shadow(eye: Eye, hits: Hits, shadows) -> np.ndarray:
    depth = np.where(np.isfinite(hits.depth), hits.depth, np.float32(0))
    x, y = (
        np.float32(eye.origin[axis]) + depth * _dot(eye.axes[:, axis], eye.x, eye.y)
        for axis in (0, 1)
    )
    light = np.ones_like(depth)
    for shadow in shadows:
        (x0, x1), (y0, y1) = shadow.x_range, shadow.y_range
        inside = (x > x0) & (x < x1) & (y > y0) & (y < y1) & (hits.surface != NOTHING)
        light[inside] = shadow.light
    return light
