"""The command line `wgpu-gi`: one module per command; `common` holds what the commands share."""
