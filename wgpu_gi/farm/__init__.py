"""Frames by many processes and machines: Dask workers render the blocks of a sequence (extra `farm`)."""
