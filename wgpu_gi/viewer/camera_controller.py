"""The camera controller of window and notebook: drags, wheel, pivot, other cameras, applied to a session."""

from __future__ import annotations

from ..camera import Camera
from ..errors import GiError
from . import navigation
from .session import Session

TURN = 3.0  # radians for a drag over the height of the picture: about half a turn
NOTCH = 0.85  # factor on the distance to the pivot for a notch of the wheel: four halve it


class CameraController:
    """Changes the camera and the pivot of a session."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def drag(self, kind: str, right: float, down: float) -> None:
        """Apply a drag "orbit", "pan" or "look"; lengths are shares of the picture's height."""
        session = self._session
        if kind == "look":
            session.camera = navigation.look(session.camera, right * TURN, down * TURN)
        elif kind == "pan":
            session.camera, session.pivot = navigation.pan(session.camera, session.pivot, right, down)
        else:
            session.camera = navigation.orbit(session.camera, session.pivot, right * TURN, down * TURN)

    def zoom(self, notches: float) -> None:
        """Move the camera towards the pivot by notches of the wheel."""
        session = self._session
        size = navigation.size_of(session.renderer.scene)
        session.camera = navigation.zoom(session.camera, session.pivot, NOTCH**notches, size)

    def take(self, camera: Camera) -> None:
        """Look through another camera."""
        self._session.camera = camera
        self._session.pivot = navigation.pivot_of(self._session.camera, self._session.renderer.scene)

    def frame_all(self) -> None:
        """Place the camera so that it sees the whole scene."""
        width, height = self._session.size
        self.take(navigation.frame_all(self._session.camera, self._session.renderer.scene, width / height))

    def set_pivot(self, x: float, y: float) -> str:
        """Set the pivot to the surface at (x, y), shares of width and height; return a message."""
        session = self._session
        try:
            found = session.point_at(x, y)
        except GiError as error:
            session.error = str(error)
            return ""
        if found is None:
            return "no surface there"
        session.pivot = found
        return "pivot at " + ", ".join(f"{length:.4g}" for length in found)
