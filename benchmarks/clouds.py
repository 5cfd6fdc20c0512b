"""What the clouds cost: CPU time against stereo_image_proc's, and their size."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from benchmark_scenes import STANDARD, Pair, Scene, standard_scenes
from effort import Effort
from findings import Findings, Line
from numpy.typing import NDArray

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory

MESSAGES = ('obstacle_mask', 'obstacle_points', 'ground_points')
FACTORY = RosbagsFactory()
HEADER = make_header(0, 'camera', FACTORY)
FLOAT32 = 7
# Where reprojectImageTo3D puts pixels without disparity.
MISSING_Z = 10000.0


def cloud_findings(scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Compare CPU time with stereo_image_proc, and cloud sizes with and without thinning."""
    pairs = [scene.pair for scene in standard_scenes(scenes)]
    return Findings((cpu_line(pairs, effort.turns), *size_lines(pairs)))


def cpu_line(pairs: Sequence[Pair], turns: int) -> Line:
    """Compare the CPU seconds per frame of the detector with those of stereo_image_proc."""
    own, theirs = [], []
    for pair in pairs:
        detector = Detector(pair.camera)
        # The first turn is a warm-up.
        turn = [
            (cpu_seconds(own_messages, detector, pair), cpu_seconds(peer_cloud, pair))
            for _ in range(turns + 1)
        ][1:]
        own.append(min(each for each, _ in turn))
        theirs.append(min(each for _, each in turn))
    own_ms, their_ms = (1000 * statistics.fmean(each) for each in (own, theirs))
    return Line(
        f'CPU time per frame, mask and clouds, mean of {len(pairs)} scenes',
        f'{own_ms:.0f} ms; stereo_image_proc {their_ms:.0f} ms',
        'less than stereo_image_proc (SGBM and points2)',
        own_ms < their_ms,
    )


def cpu_seconds(work: Callable[..., Any], *arguments: Any) -> float:
    """CPU seconds of a call, in all threads."""
    began = time.process_time()
    work(*arguments)
    return time.process_time() - began


def own_messages(detector: Detector, pair: Pair) -> list[Any]:
    """Detect, and make the messages of the mask and both clouds."""
    found = detector.detect(pair.left, pair.right)
    return [OUTPUTS[name].encode(found, HEADER, FACTORY) for name in MESSAGES]


def peer_cloud(pair: Pair) -> Any:
    """Do what stereo_image_proc does: `disparity_node` with SGBM, then `point_cloud_node`.

    All parameters have stereo_image_proc's defaults. Sending the images and the disparity between
    the nodes is not included.
    """
    left, right = grey_pair(pair.left, pair.right, pair.camera)
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=64,
        blockSize=15,
        P1=200,
        P2=400,
        disp12MaxDiff=0,
        preFilterCap=31,
        uniquenessRatio=15,
        speckleWindowSize=100,
        speckleRange=4,
        mode=cv2.STEREO_SGBM_MODE_SGBM,
    )
    disparity = matcher.compute(left, right).astype(np.float32)
    disparity *= np.float32(1 / 16)
    disparity -= np.float32(pair.camera.disparity_offset)
    points = cv2.reprojectImageTo3D(disparity, reprojection(pair.camera), handleMissingValues=True)
    return organised_cloud(np.asarray(points, np.float32), left)


def reprojection(camera: StereoCamera) -> NDArray[np.float64]:
    """Return the matrix Q of disparities without the camera's offset."""
    q = np.zeros((4, 4))
    q[0, 0] = q[1, 1] = 1.0
    q[:3, 3] = -camera.cx, -camera.cy, camera.fx
    q[3, 2] = 1 / camera.baseline_m
    return q


def organised_cloud(points: NDArray[np.float32], grey: NDArray[np.uint8]) -> Any:
    """Pack x, y, z and rgb of each pixel, NaN where there is no point."""
    height, width = grey.shape
    cloud = np.empty((height, width, 4), np.float32)
    cloud[..., :3] = points
    depth = points[..., 2]
    cloud[(depth == MISSING_Z) | np.isinf(depth), :3] = np.nan
    rgb = cloud[..., 3:].view(np.uint8)
    rgb[..., :3] = grey[..., np.newaxis]
    rgb[..., 3] = 0
    fields = [
        FACTORY.make('sensor_msgs/msg/PointField', name=name, offset=at, datatype=FLOAT32, count=1)
        for at, name in zip((0, 4, 8, 12), ('x', 'y', 'z', 'rgb'), strict=True)
    ]
    return FACTORY.make(
        'sensor_msgs/msg/PointCloud2',
        header=HEADER,
        height=height,
        width=width,
        fields=fields,
        is_bigendian=False,
        point_step=16,
        row_step=16 * width,
        data=cloud.view(np.uint8).reshape(-1),
        is_dense=False,
    )


def size_lines(pairs: Sequence[Pair]) -> tuple[Line, ...]:
    """Compare `ground_points` as thinned by default with a point for each pixel."""
    name = f'`ground_points` at {STANDARD[0]} x {STANDARD[1]}, mean of {len(pairs)} scenes'
    configs = (
        (f'thinned to {DetectorConfig().ground_cell:g} m (default)', DetectorConfig()),
        ('a point for each pixel', DetectorConfig(ground_cell=0.0)),
    )
    return tuple(
        Line(f'{name}, {kind}', size_text([ground_cloud(config, pair) for pair in pairs]))
        for kind, config in configs
    )


def ground_cloud(config: DetectorConfig, pair: Pair) -> Any:
    """Make the message of the free ground."""
    found = Detector(pair.camera, config).detect(pair.left, pair.right)
    return OUTPUTS['ground_points'].encode(found, HEADER, FACTORY)


def size_text(clouds: Sequence[Any]) -> str:
    """Mean number of points and bytes."""
    points = statistics.fmean(cloud.width * cloud.height for cloud in clouds)
    size = statistics.fmean(len(cloud.data) for cloud in clouds)
    return f'{points:.0f} points, {size / 1000:.0f} kB'
