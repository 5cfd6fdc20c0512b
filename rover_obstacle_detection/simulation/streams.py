"""Random streams of a scene: ``numpy.random.default_rng([seed, STREAM, ...])``.

Each part of a scene draws from its own stream, so changing one leaves the others as they are.
"""

TERRAIN = 1
ROCK_FIELD = 2
ROCK_TEXTURE = 3
ROCK_POSE = 4
ROCK_SHAPE = 5
SOIL = 6
SENSOR = 7
LIGHT_PATHS = 8
LANDFORMS = 9
SOIL_PATCHES = 10
SHADE = 11
