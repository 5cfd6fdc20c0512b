"""Parameters of segmentation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RegionParameters:
    """How the image is segmented into regions.

    Parameters
    ----------
    mean_shift_spatial_radius_px : float
        Spatial bandwidth of the mean shift. Set by the user.
    mean_shift_color_radius : float
        Grey-level bandwidth of the mean shift. Set by the user.
    min_region_size_px : int
        Smaller regions are merged into a neighbour, pixels of area. Set by the user.
    min_seed_points : int
        A region with so many 3D points is a seed region (T1). Set by the user.
    reduction : int
        Factor by which the image is reduced before it is segmented. Tuned for speed.
    bandwidth_per_texture : float
        Grey-level bandwidth over the image's texture. Derived: three standard deviations keep
        ground of one kind in one region.
    min_bandwidth_ratio, max_bandwidth_ratio : float
        Limits of that bandwidth over `mean_shift_color_radius`. Chosen by looking at the debug
        picture.
    """

    mean_shift_spatial_radius_px: float = 15.0
    mean_shift_color_radius: float = 20.0
    min_region_size_px: int = 50
    min_seed_points: int = 10
    reduction: int = 4
    bandwidth_per_texture: float = 3.0
    min_bandwidth_ratio: float = 0.25
    max_bandwidth_ratio: float = 2.0
