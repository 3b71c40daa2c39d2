"""The budget of a picture: `--time` and `--error`; and which `--time` is a time in the animation instead.

A `--time` with a unit is a budget. Without one, it is the time in the animation of a scene that has one, or the time
code of a USD file, as `--at` is; of other scenes, a budget in seconds.
"""

from __future__ import annotations

from argparse import Namespace

from ..budget.amounts import checked_seconds
from ..budget.request import Budget
from ..buffers import COMMON
from ..errors import GiError
from ..scene.load import is_usd
from ..scene.scene import Scene


def settle_time(arguments: Namespace, scene: Scene | None) -> None:
    """Take a `--time` that is a time in the animation for `--at`, as soon as that is known; `scene` None: not loaded.

    Raises GiError for a budget that is not above 0.
    """
    amount = getattr(arguments, "budget", None)
    if amount is None or amount.has_unit:
        return
    sequence = getattr(arguments, "frames", None) is not None
    if arguments.time is not None:
        animated = False
    elif scene is None:
        animated = is_usd(arguments.scene) or arguments.animation is not None or sequence
    else:
        animated = bool(scene.animations)
    if animated:
        arguments.time, arguments.budget, arguments.timed_by = amount.number, None, "--time"
    elif arguments.time is not None or scene is not None:
        arguments.budget = amount._replace(number=checked_seconds(amount.number), has_unit=True)


def flag_of_time(arguments: Namespace) -> str:
    """Return the flag that gave the time in the animation."""
    return str(getattr(arguments, "timed_by", "--at"))


def budget_of(arguments: Namespace) -> Budget | None:
    """Return the budget, None without one; `settle_time` has been called with the scene."""
    seconds = None if arguments.budget is None else arguments.budget.number
    if seconds is None and arguments.error is None:
        return None
    return Budget(seconds, arguments.error)


def check_budget(arguments: Namespace) -> None:
    """Raise GiError for flags that do not go with the budget, as far as it is known."""
    timed = arguments.budget is not None and arguments.budget.has_unit
    if not timed and arguments.error is None:
        return
    names = " and ".join([*(["--time"] if timed else []), *(["--error"] if arguments.error is not None else [])])
    of_others = {
        "--frames": arguments.frames is not None and "a budget is for one picture",
        "--check": arguments.check and "it reads back what every pass writes",
        "--timings": arguments.timings and "it measures every pass alone",
    }
    for flag, reason in of_others.items():
        if reason:
            raise GiError(f"{flag} does not go with {names}: {reason}; leave out one of them")
    for name in arguments.show if arguments.gi is None else ():
        if name not in COMMON and name != "help":
            raise GiError(
                f"--show {name} is a buffer of some techniques only; choose one by --gi, or leave out {names}"
            )
