"""Every stage's parameters, made from what the user configured."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.parameters import (
    RESOLUTIONS,
    GroundCheckParameters,
    PlaneFitParameters,
    ResolutionParameters,
)
from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.regions.parameters import RegionParameters
from rover_obstacle_detection.detection.result.parameters import ResultParameters
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.study.parameters import StudyParameters
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters


@dataclass(frozen=True)
class DetectorParameters:
    """The parameters of all stages, one object for each sub-package.

    A user sets a `DetectorConfig`. An experiment that changes anything else replaces a field here
    and gives the result to the `Detector`.
    """

    config: DetectorConfig
    plane_fit: PlaneFitParameters
    ground_check: GroundCheckParameters
    resolution: ResolutionParameters
    images: ImageParameters
    rectification: RectificationParameters
    stereo: StereoParameters
    terrain: TerrainParameters
    rocks: RockParameters
    regions: RegionParameters
    study: StudyParameters
    result: ResultParameters

    @classmethod
    def from_config(cls, config: DetectorConfig) -> DetectorParameters:
        """Hand each stage its share of the configuration."""
        c = config
        return cls(
            config=config,
            plane_fit=PlaneFitParameters(
                tolerance_m=c.max_step / 2,
                max_range_m=c.max_range,
                max_pitch_deg=c.max_camera_pitch,
                max_roll_deg=c.max_camera_roll,
                known_height_m=c.camera_height,
            ),
            ground_check=GroundCheckParameters(max_tilt_deg=c.max_slope),
            resolution=replace(
                RESOLUTIONS[c.speed],
                max_step_m=c.max_step,
                max_range_m=c.max_range,
                scale=c.working_scale,
            ),
            images=ImageParameters(),
            rectification=RectificationParameters(),
            stereo=StereoParameters(
                min_range_m=c.min_range,
                min_disparity_px=c.min_disparity,
                disparity_range_px=c.disparity_range,
                block_size_px=c.block_size,
                p1=round(c.P1),
                p2=round(c.P2),
                smoothness=c.smoothness,
                uniqueness_percent=round(c.uniqueness_ratio),
                speckle_size_px=c.speckle_size,
                speckle_range_px=c.speckle_range,
                disp12_max_diff_px=c.disp12_max_diff,
                prefilter_cap=c.prefilter_cap,
                sgbm_mode=c.sgbm_mode,
            ),
            terrain=TerrainParameters(
                max_step_m=c.max_step,
                max_slope_deg=c.max_slope,
                max_roughness_m=c.max_roughness,
                max_range_m=c.max_range,
            ),
            rocks=RockParameters(
                max_step_m=c.max_step,
                max_range_m=c.max_range,
                core_share=c.core_share,
                core_noises=c.core_noises,
                outline_probability=c.outline_probability,
            ),
            regions=RegionParameters(
                mean_shift_spatial_radius_px=c.mean_shift_spatial_radius,
                mean_shift_color_radius=c.mean_shift_color_radius,
                min_region_size_px=c.min_region_size,
                min_seed_points=c.min_seed_points,
            ),
            study=_study_parameters(config),
            result=ResultParameters(
                method=c.method,
                max_step_m=c.max_step,
                block_size_px=c.block_size,
                min_confidence=c.min_confidence,
                ground_cell_m=c.ground_cell,
                grid_cell_m=c.grid_cell,
                grid_extent_m=c.grid_extent,
            ),
        )


def _study_parameters(config: DetectorConfig) -> StudyParameters:
    default = StudyParameters()
    return StudyParameters(
        disparities=config.disparity_range or default.disparities,
        window_size_px=config.window_size,
        max_range_m=config.max_range,
        max_roughness_m=config.study_max_roughness,
        max_step_m=config.study_max_step,
        dark_grey_level=config.dark_grey_level,
        morphology_size_px=config.morphology_size,
        morphology_iterations=config.morphology_iterations,
    )
