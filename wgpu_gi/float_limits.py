"""The largest and smallest values that the shaders' 32-bit floats take, so that squares and products stay finite."""

import math

# Coordinates beyond this, a tenth of a light-year in metres, are damage: squared distances must stay finite.
MAX_COORDINATE = 1e15

# Radiance, candela or lux, with all factors: its irradiance at a micrometre stays below float32's 3.4e38. The sun's
# disc has a radiance of 2e7 W/(m2 sr).
LARGEST_LIGHT = 1e20
SMALLEST_LIGHT = 1e-30  # any less counts as none

# Full vertical angles, radians, from 0.2 seconds of arc to just below 180 degrees. Beyond, projections degenerate.
SMALLEST_YFOV, LARGEST_YFOV = 1e-6, math.pi - 1e-5

# Heights of orthographic pictures, metres.
SMALLEST_HEIGHT, LARGEST_HEIGHT = 1e-12, MAX_COORDINATE

# Texture transforms, and scales of normal maps: products with texture coordinates stay finite.
LARGEST_FACTOR = 1e9

# Index of refraction: dielectrics have at most 5.
LARGEST_IOR = 100.0

# Distance in which a volume absorbs light, metres: absorption over any path stays finite.
SMALLEST_DISTANCE = 1e-12
