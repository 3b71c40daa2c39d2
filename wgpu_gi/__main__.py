"""The command line: `wgpu-gi render` makes pictures, `view` shows them live, the others measure and test them."""

from __future__ import annotations

import atexit
import os
import re
import signal
import sys
from collections.abc import Sequence
from importlib import import_module

from .errors import GiError

LONGEST_WORD = 255  # characters of an argument in a message; file names have at most this many
FAILED = 2
READER_GONE = 141  # 128 + SIGPIPE


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Return 0, 2 after an error that the user can fix, 130 after Ctrl-C, or 143 after SIGTERM.

    Return 141 if the reader of the output has closed the pipe (`wgpu-gi render --set help | head`).
    """
    from .cli import interrupt

    with interrupt.interruptible():
        try:
            return _main(argv)
        except BaseException as error:
            # The interrupted code may have turned it into another error.
            if not (interrupt.came() or isinstance(error, KeyboardInterrupt)) or isinstance(error, SystemExit):
                raise
            print("wgpu-gi: interrupted; no file was left half-written", file=sys.stderr)
            return interrupt.exit_code()
        finally:
            # All is written: Ctrl-C during the interpreter's exit must not change the exit code.
            atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)


def _main(argv: Sequence[str] | None) -> int:
    """Run the command line; turn errors into messages."""
    from .cli import interrupt

    try:
        try:
            return _run(argv)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # The interpreter flushes stdout again at exit; /dev/null takes that.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    except (GiError, MemoryError) as error:
        interrupt.check()
        short = "not enough memory; use a smaller --size or a smaller scene"
        print(f"wgpu-gi: error: {_one_line(str(error)) if isinstance(error, GiError) else short}", file=sys.stderr)
        return FAILED


def _one_line(sentence: str) -> str:
    """Return a sentence with the values in it short and on one line: a mistyped argument may be anything."""
    line = "".join(character if character.isprintable() else repr(character)[1:-1] for character in sentence)
    return re.sub(rf"(\S{{{LONGEST_WORD}}})\S+", r"\1...", line)


def _run(argv: Sequence[str] | None) -> int:
    """Run the command: a function in the module of `cli` of the same name. No other is imported, to start fast."""
    from .cli.interrupt import held

    with held():
        from .cli.arguments import build_parser
    arguments = build_parser().parse_args(argv)
    with held():
        module = import_module(f".cli.{arguments.command}", __package__)
    code: int = getattr(module, arguments.command)(arguments)
    return code


if __name__ == "__main__":
    sys.exit(main())
