"""The methods that can be compared: names and what they are, without importing any."""

from __future__ import annotations

METHOD_DESCRIPTIONS = {
    'hybrid': "this package's default",
    'study': "the study's method, its errors mended",
    'listing': "the study's listing, repaired only to run",
    'wang': "Wang et al.'s sparse pipeline, as the study describes it",
    'image_only': '2D only: Canny edges and k-means regions',
    'depth_only': '3D only: robust ground plane plus height',
    'patchwork': 'Patchwork++ on the stereo cloud (extra peers)',
    'cloth': 'cloth simulation filter on the stereo cloud (extra peers)',
}
