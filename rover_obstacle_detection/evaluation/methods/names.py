"""Names and descriptions of the methods, without importing them."""

from __future__ import annotations

METHOD_DESCRIPTIONS = {
    'hybrid': "this package's default",
    'study': "the study's method with its errors corrected",
    'listing': "the study's listing as printed, fixed only to run",
    'wang': "Wang et al.'s sparse pipeline, as the study describes it",
    'image_only': '2D only: Canny edges and k-means regions',
    'cascade': '2D only: boxes of a cascade of boosted features',
    'depth_only': '3D only: height above a robust ground plane',
    'patchwork': 'Patchwork++ on the stereo cloud (extra peers)',
    'cloth': 'cloth simulation filter on the stereo cloud (extra peers)',
}
