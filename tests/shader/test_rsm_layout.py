"""many_light/rsm/layout.wgsl: the texels of a map in the order of a Hilbert curve."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator

LAYOUT = "many_light/rsm/layout.wgsl"


@pytest.mark.parametrize("level", [0, 1, 2, 5])
def test_the_curve_visits_every_texel_from_neighbour_to_neighbour(tmp_path, level):
    evaluate = Evaluator(tmp_path)
    numbers = np.arange(4**level, dtype=np.uint32)
    texels = evaluate(LAYOUT, f"vec2f(texel_of_number(n(i), {level}u))", "vec2f", n=numbers).astype(np.int64)
    assert len(np.unique(texels, axis=0)) == 4**level
    assert texels.min() == 0 and texels.max() == 2**level - 1
    assert (np.abs(np.diff(texels, axis=0)).sum(1) == 1).all()
    columns, rows = texels.T.astype(np.uint32)
    back = evaluate(LAYOUT, f"number_of_texel(vec2u(x(i), y(i)), {level}u)", "u32", x=columns, y=rows)
    assert (back == numbers).all()
