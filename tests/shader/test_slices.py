"""ssdo/slice.wgsl: azimuths, shares and angles of slices against integrals over the hemisphere."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.wgsl_evaluator import Evaluator

SLICE = "ssdo/slice.wgsl"
AXIS = (0.0, 0.0, 1.0)
AT = f"slice_at(vec3f{AXIS}, n(i), vec3f(0.0, 1.0, 0.0), u(i))"


@pytest.fixture
def evaluate(tmp_path):
    return Evaluator(tmp_path)


def normals(cosines):
    """Return unit normals at these cosines to the axis, of arbitrary azimuths, (n, 3)."""
    azimuths = np.arange(len(cosines)) * 2.4
    sines = np.sqrt(1 - cosines**2)
    return np.stack([sines * np.cos(azimuths), sines * np.sin(azimuths), cosines], 1).astype(np.float32)


@pytest.mark.parametrize("cosine", [1.0, 0.3, 0.05])
def test_azimuths_have_their_share_of_the_measure(evaluate, cosine):
    """The measure of a slice at azimuth a is cosine + tilt sin(normal) cos(a), tan(tilt) = tan(normal) cos(a)."""
    u = np.linspace(0, 1, 101).astype(np.float32)
    got = evaluate(SLICE, "slice_azimuth(c(i), u(i))", "f32", c=np.full_like(u, cosine), u=u)
    a = np.linspace(0, np.pi, 100_001)
    sine = np.sqrt(1 - cosine**2)
    measure = cosine + np.arctan2(sine * np.cos(a), cosine) * sine * np.cos(a)
    sums = np.concatenate([[0], np.cumsum((measure[1:] + measure[:-1]) / 2)]) * (a[1] - a[0])
    assert sums[-1] == pytest.approx(np.pi, rel=1e-4)  # the hemisphere's
    assert np.allclose(np.interp(got, a, sums) / np.pi, u, atol=1e-4)


def test_angles_invert_shares(evaluate):
    """Shares rise from 0 to 1 between both horizons."""
    u, c, share = (g.ravel() for g in np.meshgrid([0.1, 0.5, 0.77], [0.05, 0.6, 1.0], np.linspace(0, 1, 41)))
    arrays = {"n": normals(c), "u": u.astype(np.float32), "f": share.astype(np.float32)}
    back = evaluate(
        SLICE,
        "back(i)",
        "f32",
        functions=f"""fn back(i: u32) -> f32 {{
            let slice = {AT};
            let angle = slice_angle(slice, f(i));
            return share_up_to(slice, cos(angle), sin(angle));
        }}""",
        **arrays,
    )
    assert np.allclose(back, share, atol=2e-3)


@pytest.mark.parametrize("cosine", [1.0, 0.1])
def test_equal_shares_of_slices_integrate_the_hemisphere(evaluate, cosine):
    """Means over slices and shares: of w . n it is 2 / 3, of a quarter of the sky beside a wall its form factor."""
    u, share = (
        g.ravel().astype(np.float32) for g in np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(64) + 0.5) / 64)
    )
    n = normals(np.full(len(u), cosine))
    n[:] = n[0]
    w = evaluate(
        SLICE,
        "direction(i)",
        "vec3f",
        functions=f"""fn direction(i: u32) -> vec3f {{
            let slice = {AT};
            let angle = slice_angle(slice, f(i));
            return cos(angle) * slice.axis + sin(angle) * slice.tangent;
        }}""",
        n=n,
        u=u,
        f=share,
    ).astype(np.float64)
    assert np.allclose(np.linalg.norm(w, axis=1), 1, atol=1e-5)
    cosines = w @ n[0].astype(np.float64)
    assert cosines.min() >= -1e-3
    assert cosines.mean() == pytest.approx(2 / 3, rel=2e-3)
    # A half-plane wall at 45 degrees of elevation hides (1 - cos 45) / 2.
    across = np.cross(n[0], (0.3, -0.8, 0.5))
    across /= np.linalg.norm(across)
    hidden = (w @ across > cosines).mean()
    assert hidden == pytest.approx((1 - np.sqrt(0.5)) / 2, abs=5e-3)
