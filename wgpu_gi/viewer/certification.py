"""Certifies the view: completes the picture at rest, then states its errors by path-traced pixels."""

from __future__ import annotations

from collections.abc import Callable

from ..budget.certificate import certify
from .session import Interrupted, Session


def certify_view(session: Session, tick: Callable[[float], None]) -> None:
    """Set `session.certificate`; leave it None if the view changes meanwhile, which `tick` finds out.

    Raises GiError if the truth is black.
    """
    session.render_full_size()
    while session.step(tick):
        pass
    if session.error or not session.at_rest:
        return

    def progress(fraction: float) -> None:
        tick(fraction)
        if session.interrupted:
            raise Interrupted

    try:
        session.certificate = certify(session.renderer, progress=progress)
    except Interrupted:
        session.certificate = None
