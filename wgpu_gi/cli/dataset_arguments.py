"""The arguments of `wgpu-gi dataset`."""

from __future__ import annotations

from argparse import ArgumentParser

from .argument_types import parse_shards
from .picture_arguments import ADAPTER_HELP


def add_dataset_arguments(parser: ArgumentParser) -> None:
    """Add the configuration, where its frames go, and which of them."""
    add = parser.add_argument
    add("config", metavar="CONFIG.toml", help="what to draw, which data to store, and in which formats")
    add("-o", "--output", default="data", metavar="FOLDER", help="the folder of the data set, default data")
    add("--shard", type=parse_shards, metavar="I/N", help="make part I of N of the frames, or parts I-J/N")
    add(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting of the technique, repeatable"
    )
    add("--adapter", metavar="NAME", help=ADAPTER_HELP)
