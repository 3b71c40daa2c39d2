"""Functions of the shader libraries against numpy, and what the driver must get right for them.

Each function returns its largest deviation; its docstring is the sentence of the report.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...gpu.graph import Graph
from ...scene.built_in.shapes import sphere
from ...scene.scene import Instance, Scene
from ..wgsl_evaluator import Evaluator

U32 = 0xFFFFFFFF
GROUPS, WIDTH = 64, 256  # of `workgroup.wgsl`
RAYS = 2000
FAR = 3.0e38
TRACE = """
fn traced(i: u32) -> vec2f {
    let hit = trace(Ray(origins(i), directions(i)), 3.0e38);
    return vec2f(hit.distance, select(0.0, 1.0, hit.triangle != NONE));
}
fn shadowed(i: u32) -> f32 {
    return select(0.0, 1.0, trace_shadow(Ray(origins(i), directions(i)), limits(i)).occluded_a);
}
"""


def _hash(values: NDArray[np.uint64]) -> NDArray:
    """Return PCG hashes of 32-bit numbers (Jarzynski and Olano 2020)."""
    state = (values * 747796405 + 2891336453) & U32
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & U32
    return (word >> 22) ^ word


def hashes(evaluate: Evaluator) -> float:
    """Hashes of 4096 numbers equal integer arithmetic, bit for bit."""
    numbers = np.random.default_rng(0).integers(0, 2**32, 4096).astype(np.uint64)
    got = evaluate("common/random.wgsl", "hash(number(i))", "u32", number=numbers.astype(np.uint32))
    return float((got != _hash(numbers)).sum())


def sobol_points(evaluate: Evaluator) -> float:
    """256 scrambled Sobol points have one point in each of 256 boxes of every shape."""
    points = evaluate("common/random.wgsl", "sobol_2d(i, 12345u)", "vec2f", count=256)
    missing = 0
    for wide in range(9):
        cells = (points * [2**wide, 2 ** (8 - wide)]).astype(int)
        missing += 256 - len(np.unique(cells[:, 0] * 256 + cells[:, 1]))
    return float(missing)


def workgroups(evaluate: Evaluator) -> float:
    """Prefix sums in workgroups with barriers, and atomic sums and maxima, equal integer arithmetic."""
    graph = Graph(evaluate.device)
    graph.begin()
    try:
        count = GROUPS * WIDTH
        prefix = graph.buffer("prefix", dtype=np.uint32, count=count)
        total = graph.buffer("total", dtype=np.uint32, count=2)
        graph.compute(
            "sums", "measure/workgroup.wgsl", over=count, writes={"prefix": prefix, "total": total}, clear=(total,)
        )
        graph.compile([prefix, total])
        graph.run()
        got, sums = graph.read_back(prefix), graph.read_back(total)
    finally:
        graph.release()
    values = _hash(np.arange(count, dtype=np.uint64)) >> 8
    expected = np.cumsum(values.reshape(GROUPS, WIDTH), axis=1) & U32
    whole = np.array([values.sum() & U32, values.max()])
    return float((got.reshape(GROUPS, WIDTH) != expected).sum() + (sums != whole).sum())


def not_finite(evaluate: Evaluator) -> float:
    """Infinity and NaN are recognised by their bits, and denormal numbers are finite."""
    values = np.array([0.0, 1.0, -1e38, 1e-40, np.inf, -np.inf, np.nan, -np.nan], np.float32)
    got = evaluate("common/math.wgsl", "select(0u, 1u, is_finite(vec3f(1.0, value(i), 0.0)))", "u32", value=values)
    return float((got != np.isfinite(values)).sum())


def half_floats(evaluate: Evaluator) -> float:
    """Packing two half floats keeps 11 bits."""
    values = np.float32(np.random.default_rng(1).uniform(1, 2, (512, 2)) * 2.0 ** np.arange(-13, 3).repeat(32)[:, None])
    got = evaluate("common/math.wgsl", "unpack2x16float(pack2x16float(value(i)))", "vec2f", value=values)
    return float(np.abs(got / values - 1).max())


def sine_and_cosine(evaluate: Evaluator) -> float:
    """Sine and cosine are right to 2^-11 from -pi to pi, as WGSL demands."""
    angles = np.linspace(-np.pi, np.pi, 4096).astype(np.float32)
    got = evaluate("common/math.wgsl", "vec2f(sin(angle(i)), cos(angle(i)))", "vec2f", angle=angles)
    exact = np.stack([np.sin(angles.astype(np.float64)), np.cos(angles.astype(np.float64))], -1)
    return float(np.abs(got - exact).max())


def octahedral_codes(evaluate: Evaluator) -> float:
    """Directions survive their octahedral code."""
    directions = np.random.default_rng(2).normal(size=(4096, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    call = "octahedral_decode(octahedral_encode(direction(i)))"
    return float(np.abs(evaluate("common/math.wgsl", call, "vec3f", direction=directions) - directions).max())


def reciprocity(evaluate: Evaluator) -> float:
    """A rough metal's BRDF is the same with light and eye exchanged (Helmholtz reciprocity)."""
    rng = np.random.default_rng(3)
    pairs = [np.abs(rng.normal(size=(1024, 3))) + 0.05 for _ in range(2)]
    w_o, w_i = (np.float32(p / np.linalg.norm(p, axis=1, keepdims=True)) for p in pairs)
    call = "evaluate_brdf(brdf_metallic_roughness(vec3f(0.9, 0.5, 0.1), 1.0, 0.6), {}(i), {}(i))"
    there = evaluate("common/brdf.wgsl", call.format("a", "b"), "vec4f", a=w_o, b=w_i)[:, :3]
    back = evaluate("common/brdf.wgsl", call.format("a", "b"), "vec4f", a=w_i, b=w_o)[:, :3]
    return float(np.abs(there / back - 1).max())


def _spheres() -> Scene:
    """Return five balls, smooth enough for a closed form: two baked, three instances of one mesh, one mirrored."""
    scene = Scene([Instance(sphere(centre, 0.4, 5)) for centre in ((0.0, 0.0, 0.0), (1.2, 0.3, 0.0))])
    shared = sphere((0.0, 0.0, 0.0), 0.4, 5)
    for number, place in enumerate(((-1.2, 0.0, 0.4), (0.0, 1.1, -0.5), (0.3, -1.0, 0.8))):
        matrix = np.diag([-1.0 if number == 2 else 1.0, 1.0, 1.0, 1.0])
        matrix[:3, 3] = place
        scene.instances.append(Instance(shared, matrix))
    return scene


CENTRES = np.array([(0.0, 0.0, 0.0), (1.2, 0.3, 0.0), (-1.2, 0.0, 0.4), (0.0, 1.1, -0.5), (0.3, -1.0, 0.8)])
RADIUS = 0.4
GRAZING = 0.02  # of the radius: rays this near to a silhouette may hit the facets or miss them


def _rays() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return origins, unit directions, and distances to the first ball (inf: none), of rays away from silhouettes."""
    rng = np.random.default_rng(4)
    origins = rng.normal(size=(RAYS, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-1.5, 1.5, (RAYS, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    way = CENTRES - origins[:, None]
    along = np.einsum("rck,rk->rc", way, directions)
    beside = np.sqrt(np.maximum((way**2).sum(-1) - along**2, 0.0))
    clear = (np.abs(beside / RADIUS - 1) > GRAZING).all(1)
    reach = along - np.sqrt(np.maximum(RADIUS**2 - beside**2, 0.0))
    distance = np.where(beside < RADIUS, reach, np.inf).min(1)
    return origins[clear], directions[clear], distance[clear]


def _traced(evaluate: Evaluator, call: str, returns: str, limits: ArrayLike = FAR) -> NDArray:
    """Return the value of a call of TRACE for each of `_rays`."""
    scene = _spheres()
    origins, directions, _ = _rays()
    # Positions on the device are relative to the middle of the scene.
    return evaluate(
        "scene/trace.wgsl",
        call,
        returns,
        functions=TRACE,
        scene=scene,
        origins=origins - scene.bounds().mean(0),
        directions=directions,
        limits=np.broadcast_to(np.asarray(limits, np.float32), len(origins)),
    )


def first_hits(evaluate: Evaluator) -> float:
    """Rays hit balls, baked and instanced, where the quadratic equation says; the facets are 2e-4 off."""
    got = _traced(evaluate, "traced(i)", "vec2f")
    _, _, distance = _rays()
    hit = np.isfinite(distance)
    if not np.array_equal(got[:, 1] > 0, hit):
        return float(np.inf)
    # Facets are off by their sagitta along the normal, more where the ray is oblique: the median tells.
    return float(np.median(np.abs(got[hit, 0] - distance[hit])))


def any_hits(evaluate: Evaluator) -> float:
    """Shadow rays that end before, or behind, the first ball are free, or blocked."""
    _, _, distance = _rays()
    wrong = 0
    for factor in (0.9, 1.1):
        limits = np.where(np.isfinite(distance), factor * distance, FAR)
        got = _traced(evaluate, "shadowed(i)", "f32", limits)
        wrong += int(((got > 0) != (np.isfinite(distance) & (factor > 1))).sum())
    return float(wrong)
