"""common/random.wgsl against plain numpy: hashes, Owen-scrambled Sobol points and their stratification."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.statistics import chi_square_z

from wgpu_gi.measure.wgsl_evaluator import Evaluator

RANDOM = "common/random.wgsl"
U32 = 0xFFFFFFFF


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def hash_(value):
    """PCG: a linear step and its output permutation (Jarzynski and Olano 2020)."""
    state = (value * 747796405 + 2891336453) & U32
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & U32
    return (word >> 22) ^ word


def reversed_bits(value):
    return int(f"{value:032b}"[::-1], 2)


def owen_scramble(value, seed):
    """Laine and Karras 2011 with N. Vegdahl's constants; of a number whose bits are not reversed."""
    x = reversed_bits(value)
    x ^= (x * 0x3D20ADEA) & U32
    x = (x + seed) & U32
    x = (x * ((seed >> 16) | 1)) & U32
    x ^= (x * 0x05526C56) & U32
    x ^= (x * 0x53A22864) & U32
    return reversed_bits(x)


def sobol_directions():
    """Direction numbers of the first two dimensions: identity, and x + 1 (Pascal's triangle mod 2)."""
    first = [1 << (31 - k) for k in range(32)]
    second = [1 << 31]
    for _ in range(31):
        second.append(second[-1] ^ (second[-1] >> 1))
    return first, second


def sobol(index, directions):
    x = 0
    for k in range(32):
        if index >> k & 1:
            x ^= directions[k]
    return x


def sobol_2d(index, seed):
    """Burley 2020: shuffle the index, take the Sobol point, scramble each coordinate."""
    shuffled = owen_scramble(index, hash_(seed))
    salts = (0x68BC21EB, 0x02E5BE93)
    return [
        owen_scramble(sobol(shuffled, directions), hash_(seed ^ salt))
        for directions, salt in zip(sobol_directions(), salts, strict=True)
    ]


def test_hash_agrees_with_numpy(evaluate):
    random = np.random.default_rng(0).integers(0, 2**32, 1000)
    values = np.concatenate([np.arange(1000), random, [U32]]).astype(np.uint32)
    got = evaluate(RANDOM, "hash(value(i))", "u32", value=values)
    assert got.tolist() == [hash_(int(v)) for v in values]
    pairs = evaluate(RANDOM, "hash2(value(i), 7u + i)", "u32", value=values)
    assert pairs.tolist() == [hash_(int(v) ^ hash_(7 + i)) for i, v in enumerate(values)]


def test_hash2_of_a_picture_has_no_pattern(evaluate):
    """Seeds of neighbouring pixels: all different, every bit half of the time, bits of neighbours uncorrelated."""
    expression = "hash2(i % 256u, hash2(i / 256u, 0u))"
    got = evaluate(RANDOM, expression, "u32", count=65536)
    assert len(np.unique(got)) > 65536 - 10  # 2^32 / 2^32 / 2: 0.5 collisions are expected
    bits = (got[:, None] >> np.arange(32, dtype=np.uint32) & 1).astype(np.float64)
    assert np.abs(bits.mean(0) - 0.5).max() < 4.5 * 0.5 / 256
    picture = bits.reshape(256, 256, 32) - 0.5
    for other in (np.roll(picture, 1, 0), np.roll(picture, 1, 1)):
        assert np.abs((picture * other).mean((0, 1)) * 4).max() < 4.5 / 256


def test_unit_float_is_below_one(evaluate):
    bits = np.array([0, 1, 2**31, U32 - 256, U32 - 128, U32 - 127, U32 - 1, U32], np.uint32)
    got = evaluate(RANDOM, "unit_float(bits(i))", "f32", bits=bits)
    assert got.min() == 0.0 and got.max() < 1.0 and np.array_equal(np.sort(got), got)
    assert np.allclose(got, bits / 2**32, atol=1e-7)


def points(evaluate, count, seed):
    return evaluate(RANDOM, f"sobol_2d(i, {seed}u)", "vec2f", count=count)


@pytest.mark.parametrize("seed", [0, 1, 0xDEADBEEF])
def test_sobol_2d_is_the_scrambled_sobol_sequence(evaluate, seed):
    indices = np.concatenate([np.arange(300), [2**16, 2**31, U32]]).astype(np.uint32)
    got = evaluate(RANDOM, f"sobol_2d(index(i), {seed}u)", "vec2f", index=indices)
    expected = np.array([sobol_2d(int(k), seed) for k in indices]) / 2**32
    assert np.abs(got - expected).max() <= 2**-24


@pytest.mark.parametrize("seed", [0, 12345, U32])
@pytest.mark.parametrize("power", [4, 7, 10])
def test_each_elementary_interval_holds_its_share(evaluate, seed, power):
    """A (0, 2)-sequence: of 2^k points, each of the 2^k boxes of area 2^-k of every shape holds exactly one."""
    for first in (0, 2**power, 5 * 2**power):
        xy = evaluate(RANDOM, f"sobol_2d({first}u + i, {seed}u)", "vec2f", count=2**power)
        for wide in range(power + 1):
            cells = (xy * [2**wide, 2 ** (power - wide)]).astype(int)
            assert len(np.unique(cells[:, 0] * 2**power + cells[:, 1])) == 2**power


def test_seeds_are_independent(evaluate):
    """Points of the same index and different seeds fill the square like random ones."""
    seeds = np.random.default_rng(0).integers(0, 2**32, 4096).astype(np.uint32)
    xy = evaluate(RANDOM, "sobol_2d(0u, seed(i))", "vec2f", seed=seeds)
    cells = (xy * 16).astype(int)
    assert chi_square_z(np.bincount(cells[:, 0] * 16 + cells[:, 1], minlength=256), np.full(256, 16.0)) < 4
    # Padding: x of one pair and y of another, for the same indices.
    for pair in (("1u", "2u"), ("hash2(5u, 0u)", "hash2(5u, 1u)")):
        expression = f"vec2f(sobol_2d(i, {pair[0]}).x, sobol_2d(i, {pair[1]}).x)"
        xy = evaluate(RANDOM, expression, "vec2f", count=4096)
        correlation = ((xy[:, 0] - 0.5) * (xy[:, 1] - 0.5)).mean() * 12
        assert abs(correlation) < 4 / 64
        cells = (xy * 16).astype(int)
        assert np.abs(chi_square_z(np.bincount(cells[:, 0] * 16 + cells[:, 1], minlength=256), np.full(256, 16.0))) < 4


def test_scrambled_points_are_uniform_in_every_bit(evaluate):
    """Over seeds, every bit of a point is 0 or 1 with equal probability."""
    seeds = np.random.default_rng(1).integers(0, 2**32, 8192).astype(np.uint32)
    for index in (0, 1, 77):
        xy = evaluate(RANDOM, f"sobol_2d({index}u, seed(i))", "vec2f", seed=seeds)
        bits = (xy[..., None] * 2.0 ** np.arange(1, 17)).astype(int) & 1
        assert np.abs(bits.mean(0) - 0.5).max() < 4.5 * 0.5 / np.sqrt(len(seeds))
