"""Random numbers, colours, directions and rotations for scene generators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

T = TypeVar("T")
Rgb = tuple[float, float, float]


class Draws:
    """A stream of random values that depends on the integers `key` alone (PCG64, uniform draws only)."""

    def __init__(self, *key: int) -> None:
        self._generator = np.random.Generator(np.random.PCG64(list(key)))

    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """Return a float32 number of [low, high]."""
        return float(np.float32(low + (high - low) * self._generator.random()))

    def log_uniform(self, low: float, high: float) -> float:
        """Return a float32 number of [low, high] with a uniform logarithm."""
        return float(np.float32(low * (high / low) ** self._generator.random()))

    def array(self, *shape: int) -> NDArray[np.float64]:
        """Return uniform numbers of [0, 1) in an array."""
        return self._generator.random(shape)

    def integer(self, low: int, high: int) -> int:
        """Return an integer of [low, high], both included."""
        return low + int((high - low + 1) * self._generator.random())

    def chance(self, probability: float) -> bool:
        """Return True with a probability."""
        return self._generator.random() < probability

    def choice(self, options: Sequence[T]) -> T:
        """Return one of the options."""
        return options[self.integer(0, len(options) - 1)]

    def sample(self, options: Sequence[T], count: int) -> list[T]:
        """Return `count` different options, in random order."""
        return [options[i] for i in np.argsort(self.array(len(options)), kind="stable")[:count]]

    def color(self, low: float, high: float) -> Rgb:
        """Return a colour with all channels in [low, high]."""
        return self.uniform(low, high), self.uniform(low, high), self.uniform(low, high)

    def tint(self) -> Rgb:
        """Return the colour of a lamp: warm, white, cold or, seldom, saturated; its largest channel is 1."""
        if self.chance(0.3):
            return 1.0, 1.0, 1.0
        raw = self.color(0.02, 1.0) if self.chance(0.2) else self.color(0.6, 1.0)
        red, green, blue = (float(np.float32(value / max(raw))) for value in raw)
        return red, green, blue

    def turn(self, angle: float | None = None) -> NDArray[np.float64]:
        """Return a (3, 3) rotation about +Y, by a random angle if None (radians)."""
        angle = self.uniform(-math.pi, math.pi) if angle is None else angle
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])

    def rotation(self) -> NDArray[np.float64]:
        """Return a uniformly distributed (3, 3) rotation (Arvo 1992: a turn about Y, then a random half-turn)."""
        phi, z = 2 * math.pi * self._generator.random(), self._generator.random()
        v = np.array([math.cos(phi) * math.sqrt(z), math.sqrt(1 - z), math.sin(phi) * math.sqrt(z)])
        return (2 * np.outer(v, v) - np.eye(3)) @ self.turn()


def place(
    position: ArrayLike, scale: ArrayLike = 1.0, rotation: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the (4, 4) matrix that scales, rotates and then translates, rounded to float32."""
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if rotation is None else rotation) * np.broadcast_to(scale, 3)
    matrix[:3, 3] = position
    return matrix.astype(np.float32).astype(np.float64)


def unit(vector: Sequence[float] | NDArray[np.float64]) -> tuple[float, float, float]:
    """Return a vector of length 1 that does not change if it is normalised again."""
    v = np.asarray(vector, np.float64)
    for _ in range(4):
        v = v / np.linalg.norm(v)
    x, y, z = v.tolist()
    return x, y, z
