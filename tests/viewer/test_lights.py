"""Azimuth and elevation of a sun, as the viewer's panel shows them."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.scene.scene import DirectionalLight
from wgpu_gi.viewer.lights import angles_of, direction_from


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (90, 0), (-120, 35), (10, -80), (0, 90)])
def test_angles_round_trip(azimuth, elevation):
    found = angles_of(DirectionalLight(direction_from(azimuth, elevation)))
    assert np.allclose(direction_from(*found), direction_from(azimuth, elevation))
    assert found[1] == pytest.approx(elevation)


def test_the_sun_in_the_east_is_at_ninety_degrees():
    assert angles_of(DirectionalLight((-2.0, 0.0, 0.0))) == pytest.approx((90.0, 0.0))
    assert angles_of(DirectionalLight((0.0, -3.0, 0.0)))[1] == pytest.approx(90.0)
