"""Blocks of a sequence: shards deal them out once each; blocks stay whole."""

from __future__ import annotations

import pytest

from wgpu_gi.cli.argument_types import parse_shards
from wgpu_gi.sequence.blocks import BLOCK, blocks_of


@pytest.mark.parametrize("has_history", [False, True])
@pytest.mark.parametrize("texts", [["1/1"], ["2/3", "1/3", "3/3"], ["1-2/5", "3-3/5", "4-5/5"], ["1-400/400"]])
def test_shards_share_out_every_block_once(texts, has_history):
    frames = range(3, 700, 2)
    whole = list(blocks_of(frames, has_history))
    parts = [block for text in texts for block in blocks_of(frames, has_history, parse_shards(text))]
    assert sorted(parts, key=lambda block: block[0]) == whole
    assert [frame for block in whole for frame in block] == list(frames)
    assert {len(block) for block in whole[:-1]} == {BLOCK if has_history else 1}


def test_shards_take_turns():
    """So parts of an animation that takes longer in the end still take equally long."""
    starts = [block[0] for block in blocks_of(range(12), False, parse_shards("2/4"))]
    assert starts == [1, 5, 9]
