"""Mitsuba scene: path tracing for the images, ray casting for the ground truth."""

from __future__ import annotations

import ctypes.util
import importlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.simulation.ground_mesh import GroundMesh
from rover_obstacle_detection.simulation.poses import CameraPose
from rover_obstacle_detection.simulation.rock_shapes import RockMesh
from rover_obstacle_detection.simulation.sky import Light
from rover_obstacle_detection.simulation.soil import SoilTexture

Floats = NDArray[np.float32]

_LLVM_VERSION = 19
_PATH_DEPTH = 3
"""Mitsuba's `max_depth`: three path segments, which is two bounces."""
_PATHS_AT_ONCE = 4_000_000
"""Bounds the memory of one path tracing call."""
_RETRY_OFFSET_PX = 0.002
"""About one ray in a million passes between two triangles; a second one this far away hits."""
_ENVIRONMENT_TO_WORLD = [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
"""Mitsuba's environment maps have +y up and start at -z; the world has z up."""


def load_mitsuba() -> Any:
    """Import Mitsuba with a compatible LLVM.

    Raises
    ------
    MissingExtraError
        Naming the command that installs Mitsuba or LLVM.
    """
    if 'DRJIT_LIBLLVM_PATH' not in os.environ:
        library = _find_llvm()
        if library is None:
            msg = (
                f'simulate needs LLVM {_LLVM_VERSION}: sudo apt-get install '
                f'libllvm{_LLVM_VERSION} (or set DRJIT_LIBLLVM_PATH to the library)'
            )
            raise MissingExtraError(msg)
        # Dr.Jit would pick any installed LLVM, and some versions abort the process.
        os.environ['DRJIT_LIBLLVM_PATH'] = library
    try:
        mitsuba = importlib.import_module('mitsuba')
    except ImportError as error:
        msg = 'simulate needs Mitsuba: pip install mitsuba'
        raise MissingExtraError(msg) from error
    try:
        mitsuba.set_variant('llvm_ad_rgb')
    except ImportError as error:
        path = os.environ['DRJIT_LIBLLVM_PATH']
        msg = (
            f'Mitsuba cannot use {path} as LLVM: sudo apt-get install '
            f'libllvm{_LLVM_VERSION}, and unset DRJIT_LIBLLVM_PATH'
        )
        raise MissingExtraError(msg) from error
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba


def _find_llvm() -> str | None:
    found = ctypes.util.find_library(f'LLVM-{_LLVM_VERSION}')
    if found:
        return found
    for folder in ('/usr/lib', '/usr/lib64', '/usr/local/lib', '/opt/homebrew/lib'):
        names = (f'libLLVM.so.{_LLVM_VERSION}*', f'libLLVM-{_LLVM_VERSION}*.so*')
        for pattern in names:
            for path in sorted([*Path(folder).glob(pattern), *Path(folder).glob(f'*/{pattern}')]):
                return str(path)
    return None


@dataclass(frozen=True)
class Hits:
    """First surfaces hit by the rays through the pixel centres of one camera.

    Parameters
    ----------
    depth_m : ndarray of float32, shape (height, width)
        Along the optical axis; NaN for sky.
    instances : ndarray of uint16, shape (height, width)
        Rock number; 0 for ground and sky.
    """

    depth_m: Floats
    instances: NDArray[np.uint16]


class Renderer:
    """Mitsuba scene of one frame.

    Parameters
    ----------
    ground : GroundMesh
    soil : SoilTexture
        Texture of `ground`.
    surroundings : GroundMesh
        Coarse ground outside the view.
    rocks : RockMesh
    light : Light
    plain_soil : ndarray of float32, shape (3,)
        Linear RGB reflectance of the surroundings.
    shade : GroundMesh or None
        Casts a shadow into the view from outside it.

    Raises
    ------
    MissingExtraError
        If Mitsuba or LLVM is not installed.
    """

    def __init__(
        self,
        ground: GroundMesh,
        soil: SoilTexture,
        surroundings: GroundMesh,
        rocks: RockMesh,
        light: Light,
        plain_soil: Floats,
        shade: GroundMesh | None = None,
    ) -> None:
        self._mitsuba = mi = load_mitsuba()
        self._drjit = importlib.import_module('drjit')
        self._instance_of_face = rocks.instance
        objects: dict[str, Any] = {
            'type': 'scene',
            'ground': self._ground_mesh('ground', ground, self._soil_material(soil)),
            'surroundings': self._ground_mesh(
                'surroundings', surroundings, _plain(plain_soil.tolist())
            ),
            **self._lights(light),
        }
        if len(rocks.faces):
            objects['rocks'] = self._rock_mesh(rocks)
        if shade is not None:
            objects['shade'] = self._ground_mesh('shade', shade, _plain([0.05] * 3))
        self._scene = mi.load_dict(objects)
        self._shapes = {shape.id(): shape for shape in self._scene.shapes()}
        self._integrator = mi.load_dict({'type': 'path', 'max_depth': _PATH_DEPTH})

    def radiance(self, camera: StereoCamera, pose: CameraPose, samples: int, seed: int) -> Floats:
        """Render the light that reaches each pixel.

        Parameters
        ----------
        camera : StereoCamera
        pose : CameraPose
        samples : int
            Light paths per pixel, a square number.
        seed : int

        Returns
        -------
        ndarray of float32, shape (height, width, 3)
            Linear RGB radiance.
        """
        mi = self._mitsuba
        sampler = mi.load_dict({'type': 'multijitter', 'sample_count': samples})
        samples = int(sampler.sample_count())
        image = np.empty((camera.height, camera.width, 3), np.float32)
        rows_at_once = max(1, _PATHS_AT_ONCE // (camera.width * samples))
        for top in range(0, camera.height, rows_at_once):
            rows = min(rows_at_once, camera.height - top)
            count = rows * camera.width * samples
            part = sampler.clone()
            part.set_samples_per_wavefront(samples)
            part.seed((seed * 7919 + top) & 0x7FFFFFFF, count)
            pixel = self._drjit.arange(mi.UInt32, count) // samples
            offset = part.next_2d()
            column = mi.Float(pixel % camera.width) + offset.x - 0.5
            row = mi.Float(pixel // camera.width + top) + offset.y - 0.5
            ray = self._rays(camera, pose, column, row)
            light, _, _ = self._integrator.sample(self._scene, part, ray)
            values = np.asarray(light, np.float32)
            values = values if values.shape[0] == count else values.T
            image[top : top + rows] = values.reshape(rows, camera.width, samples, 3).mean(2)
        return image

    def cast(self, camera: StereoCamera, pose: CameraPose) -> Hits:
        """Cast a ray through each pixel centre."""
        row, column = np.mgrid[: camera.height, : camera.width].astype(np.float32)
        depth, instances = self.cast_at(camera, pose, column, row)
        offset = np.float32(_RETRY_OFFSET_PX)
        retry, retry_instances = self.cast_at(camera, pose, column + offset, row + offset)
        with np.errstate(invalid='ignore'):
            missed = retry < np.where(np.isnan(depth), np.inf, depth) * (1 - 1e-3)
        return Hits(np.where(missed, retry, depth), np.where(missed, retry_instances, instances))

    def cast_at(
        self, camera: StereoCamera, pose: CameraPose, column: Floats, row: Floats
    ) -> tuple[Floats, NDArray[np.uint16]]:
        """Cast rays through image positions; pixel centres are at integers.

        Returns
        -------
        depth_m : ndarray of float32, shape of `column`
            NaN for sky.
        instances : ndarray of uint16, shape of `column`
            Rock number; 0 for ground and sky.
        """
        mi = self._mitsuba
        ray = self._rays(
            camera, pose, mi.Float(column.ravel()), mi.Float(row.ravel()), unit_depth=True
        )
        hit = self._scene.ray_intersect_preliminary(ray)
        valid = np.asarray(hit.is_valid(), bool)
        depth = np.where(valid, np.asarray(hit.t, np.float32), np.float32('nan'))
        instances = np.zeros(depth.shape, np.uint16)
        if 'rocks' in self._shapes:
            shape = mi.ShapePtr(self._shapes['rocks'])
            on_rock = np.asarray(hit.shape == shape, bool) & valid
            face = np.asarray(hit.prim_index, np.int64)
            instances[on_rock] = self._instance_of_face[face[on_rock]]
        return depth.reshape(column.shape), instances.reshape(column.shape)

    def _rays(
        self,
        camera: StereoCamera,
        pose: CameraPose,
        column: Any,
        row: Any,
        *,
        unit_depth: bool = False,
    ) -> Any:
        mi = self._mitsuba
        x, y = (column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy
        axes = [mi.Vector3f(*(float(v) for v in pose.rotation[:, i])) for i in range(3)]
        # A direction of unit depth makes the ray parameter equal to the depth.
        direction = axes[0] * x + axes[1] * y + axes[2]
        if not unit_depth:
            direction = self._drjit.normalize(direction)
        return mi.RayDifferential3f(mi.Ray3f(mi.Point3f(*map(float, pose.position)), direction))

    def _soil_material(self, soil: SoilTexture) -> dict[str, Any]:
        def texture(values: Floats) -> dict[str, Any]:
            bitmap = self._mitsuba.Bitmap(np.ascontiguousarray(values))
            return {'type': 'bitmap', 'bitmap': bitmap, 'raw': True, 'wrap_mode': 'clamp'}

        material = {'type': 'diffuse', 'reflectance': texture(soil.reflectance)}
        if not soil.relief_m.any():
            return material
        relief = texture(soil.relief_m[..., np.newaxis])
        return {'type': 'bumpmap', 'relief': relief, 'material': material}

    def _ground_mesh(self, name: str, mesh: GroundMesh, material: dict[str, Any]) -> Any:
        values = {
            'vertex_positions': mesh.vertices.reshape(-1, 3),
            'vertex_normals': mesh.normals,
            'vertex_texcoords': mesh.texture_coordinates,
        }
        return self._mesh(name, mesh.faces, values, material)

    def _rock_mesh(self, rocks: RockMesh) -> Any:
        values = {
            'vertex_positions': rocks.vertices,
            'vertex_normals': _vertex_normals(rocks.vertices, rocks.faces),
            'vertex_color': rocks.colours,
        }
        material = {
            'type': 'diffuse',
            'reflectance': {'type': 'mesh_attribute', 'name': 'vertex_color'},
        }
        return self._mesh('rocks', rocks.faces, values, material)

    def _mesh(
        self,
        name: str,
        faces: NDArray[np.uint32],
        values: dict[str, Floats],
        material: dict[str, Any],
    ) -> Any:
        mi = self._mitsuba
        properties = mi.Properties()
        properties['bsdf'] = mi.load_dict(material)
        properties.set_id(name)
        mesh = mi.Mesh(
            name,
            vertex_count=len(values['vertex_positions']),
            face_count=len(faces),
            has_vertex_normals=True,
            has_vertex_texcoords='vertex_texcoords' in values,
            props=properties,
        )
        if 'vertex_color' in values:
            mesh.add_attribute('vertex_color', 3, values['vertex_color'].ravel())
        parameters = mi.traverse(mesh)
        parameters['faces'] = mi.UInt32(faces.ravel())
        for key, value in values.items():
            parameters[key] = mi.Float(np.ascontiguousarray(value).ravel())
        parameters.update()
        return mesh

    def _lights(self, light: Light) -> dict[str, Any]:
        mi = self._mitsuba
        lights: dict[str, Any] = {
            'sun': {
                'type': 'directional',
                'direction': (-light.sun_direction).tolist(),
                'irradiance': {'type': 'rgb', 'value': light.sun_irradiance.tolist()},
            }
        }
        if light.sky is not None:
            lights['sky'] = {
                'type': 'envmap',
                'bitmap': mi.Bitmap(np.ascontiguousarray(light.sky)),
                'to_world': mi.ScalarTransform4f(_ENVIRONMENT_TO_WORLD),
            }
        return lights


def _plain(reflectance: list[float]) -> dict[str, Any]:
    return {'type': 'diffuse', 'reflectance': {'type': 'rgb', 'value': reflectance}}


def _vertex_normals(vertices: Floats, faces: NDArray[np.uint32]) -> Floats:
    """Return area-weighted vertex normals."""
    a, b, c = (vertices[faces[:, n]] for n in range(3))
    normal = np.cross(b - a, c - a)
    total = np.zeros(vertices.shape, np.float64)
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(
                faces[:, corner], weights=normal[:, axis], minlength=len(vertices)
            )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.maximum(length, 1e-20), np.float32)
