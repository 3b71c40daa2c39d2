"""The command line `wgpu-gi`: a module for each command, and what they share in `common`."""
