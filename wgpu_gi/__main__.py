"""The command line: `wgpu-gi render` makes pictures, `view` shows them live, `compare` and `bench` measure them."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Sequence

from .cli.arguments import build_parser
from .errors import GiError

FAILED = 2
INTERRUPTED = 130  # 128 + SIGINT, the convention of shells
READER_GONE = 141  # 128 + SIGPIPE


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Return 0, 2 after an error that the user can fix, or 130 after Ctrl-C.

    Return 141 if the reader of the output has closed the pipe (`wgpu-gi render --set help | head`).
    """
    try:
        try:
            return _run(build_parser().parse_args(argv))
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # The interpreter flushes stdout again at exit; /dev/null takes that.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return READER_GONE
    except GiError as error:
        print(f"wgpu-gi: error: {error}", file=sys.stderr)
    except MemoryError:
        print("wgpu-gi: error: not enough memory; use a smaller --size or a smaller scene", file=sys.stderr)
    except KeyboardInterrupt:
        print("wgpu-gi: interrupted; no file was left half-written", file=sys.stderr)
        return INTERRUPTED
    return FAILED


def _run(arguments: Namespace) -> int:
    """Run the command. Imports only the module of this command, to start fast."""
    if arguments.command == "info":
        from .cli.info import info

        return info()
    if arguments.command == "compare":
        from .cli.compare import compare

        return compare(arguments)
    if arguments.command == "bench":
        from .cli.bench import bench

        return bench(arguments)
    if arguments.command == "view":
        from .cli.view import view

        return view(arguments)
    from .cli.render import render

    return render(arguments)


if __name__ == "__main__":
    sys.exit(main())
