"""The hash table of the radiance cache: every key gets one cell, look-ups find it, and votes can be undone."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph

KEYS = 3000
REQUESTS = 4  # of each key, by threads that run at the same time
CELLS = 8192  # 3 of 8 are taken: some buckets are full
FRAME = 5

KEY = """
fn key_of(i: u32) -> CellKey { return CellKey(hash(i), max(hash(~i), 1u)); }
"""
CLAIM = (
    """
#import "shared/radiance_cache/request.wgsl"
@group(1) @binding(0) var<storage, read_write> claimed: array<u32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&claimed)) { return; }
    claimed[id.x] = request_cell(key_of(id.x % KEYSu), id.x, vote_multiplier(FRAMEu, 1u));
}
"""
    + KEY
)
FIND = (
    """
#import "shared/radiance_cache/find.wgsl"
#import "shared/radiance_cache/votes.wgsl"
@group(1) @binding(0) var<storage, read_write> found: array<vec2u>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&found)) { return; }
    let cell = find_cell(key_of(id.x));
    let vote = table[2u * min(cell, arrayLength(&table) / 2u - 1u) + 1u];
    found[id.x] = vec2u(cell, hit_of_vote(vote, vote_multiplier(FRAMEu, 1u)));
}
"""
    + KEY
)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Return the cell of each request, (cell, elected hit) of each key and of as many others, and the list."""
    folder = tmp_path_factory.mktemp("shaders")
    for name, text in (("claim.wgsl", CLAIM), ("find.wgsl", FIND)):
        (folder / name).write_text(text.replace("KEYSu", f"{KEYS}u").replace("FRAMEu", f"{FRAME}u"))
    graph = Graph(open_device(), shader_root=folder)
    graph.begin()
    table = graph.buffer("table", dtype=np.uint32, count=2 * CELLS)
    requested = graph.buffer("requested", dtype=np.uint32, count=4 + CELLS)
    claimed = graph.buffer("claimed", dtype=np.uint32, count=REQUESTS * KEYS)
    found = graph.buffer("found", dtype=np.dtype((np.uint32, 2)), count=2 * KEYS)
    graph.compute(
        "claim",
        "claim.wgsl",
        over=(claimed.count,),
        writes={"claimed": claimed, "table": table, "requested": requested},
        clear=[requested],
    )
    graph.compute("find", "find.wgsl", over=(found.count,), reads={"table": table}, writes={"found": found})
    graph.compile([found])
    graph.run()
    return tuple(graph.read_back(b).reshape(-1) for b in (claimed, found, requested))


def test_requests_of_a_key_get_one_cell_of_their_own(tables):
    claimed = tables[0].reshape(REQUESTS, KEYS)
    assert (claimed == claimed[0]).all()
    assert claimed.max() < CELLS and len(np.unique(claimed[0])) == KEYS


def test_a_look_up_finds_the_claimed_cells_and_no_other(tables):
    found = tables[1].reshape(-1, 2)[:, 0]
    assert (found[:KEYS] == tables[0][:KEYS]).all()
    assert (found[KEYS:] == 0xFFFFFFFF).all()


def test_each_requested_cell_is_listed_once(tables):
    requested = tables[2]
    assert requested[:4].tolist() == [-(-KEYS // 64), 1, 1, KEYS]
    assert set(requested[4 : 4 + KEYS]) == set(tables[0][:KEYS])


def test_votes_elect_a_hit_of_their_cell(tables):
    hits = tables[1].reshape(-1, 2)[:KEYS, 1]
    assert (hits % KEYS == np.arange(KEYS)).all() and (hits < REQUESTS * KEYS).all()
