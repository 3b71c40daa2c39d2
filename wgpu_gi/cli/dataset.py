"""`wgpu-gi dataset`: labelled frames of drawn scenes, as a .toml file describes them."""

from __future__ import annotations

import warnings
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..dataset.run import make
from ..errors import GiWarning
from ..sequence.shards import ALL
from .messages import Messages


def dataset(arguments: Namespace) -> int:
    """Run `wgpu-gi dataset` and return the exit code. Raises GiError for an error that the user can fix."""
    say = Messages(arguments.verbose, arguments.quiet)
    with _noting(say), say.progress("frames") as report:
        made = make(
            arguments.config,
            arguments.output,
            shards=arguments.shard or ALL,
            changes=arguments.set,
            adapter=arguments.adapter,
            progress=report,
        )
    say.result(made.sentence())
    return 0


@contextmanager
def _noting(say: Messages) -> Iterator[None]:
    """Print each GiWarning of the block as a note, once."""
    told: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if not issubclass(category, GiWarning):
            python(message, category, *where, **more)
        elif str(message) not in told:
            told.add(str(message))
            say.note(str(message))

    with warnings.catch_warnings():
        warnings.simplefilter("always", GiWarning)
        python, warnings.showwarning = warnings.showwarning, show
        yield
