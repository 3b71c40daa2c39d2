"""Converts the cameras of a stage (UsdGeomCamera)."""

from __future__ import annotations

import math

from ...camera import Camera
from ...float_limits import LARGEST_HEIGHT, LARGEST_YFOV, SMALLEST_HEIGHT, SMALLEST_YFOV
from ..transforms import rigid
from .prims import Placed
from .stage import Stage, number

_APERTURE_UNITS = 0.1  # apertures and focal lengths are in tenths of the stage's unit of length


def cameras_of(stage: Stage, placed: list[Placed]) -> list[Camera]:
    """Return the cameras that see something; the vertical aperture gives the angle, whatever the picture's shape."""
    from pxr import UsdGeom

    cameras = []
    for prim, stage_from_prim in placed:
        source = UsdGeom.Camera(prim)
        matrix = stage.world_from_stage @ stage_from_prim
        pose = rigid(matrix)
        aperture = number(source.GetVerticalApertureAttr(), stage.time, 0.0)
        if pose is None or not aperture > 0:
            stage.damage(f"the camera {prim.GetPath()} was left out: it sees nothing")
            continue
        for attribute in (source.GetHorizontalApertureOffsetAttr(), source.GetVerticalApertureOffsetAttr()):
            if number(attribute, stage.time, 0.0) != 0.0:
                stage.note(f"the aperture offset of the camera {prim.GetPath()} is not used")
        if source.GetProjectionAttr().Get(stage.time) == UsdGeom.Tokens.orthographic:
            scale = float(sum(matrix[:3, 1] ** 2) ** 0.5)
            height = min(max(aperture * _APERTURE_UNITS * scale, SMALLEST_HEIGHT), LARGEST_HEIGHT)
            cameras.append(Camera(pose, orthographic_height=height, name=prim.GetName()))
            continue
        focal = number(source.GetFocalLengthAttr(), stage.time, 50.0, low=1e-12)
        yfov = min(max(2.0 * math.atan(0.5 * aperture / focal), SMALLEST_YFOV), LARGEST_YFOV)
        cameras.append(Camera(pose, yfov, name=prim.GetName()))
    return cameras
