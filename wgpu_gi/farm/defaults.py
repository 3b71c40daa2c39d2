"""What a farm does unless told otherwise."""

# Cores per worker process where a CPU renders. CPU time per frame is that of two threads, see tools/README.md, and the
# work of Python and of building hierarchies, which has one thread, leaves no core idle.
THREADS = 1
FARM_TILE = (1024, 1024)  # pixels, most of a tile of `--farm-tiles`: 64 tiles of the largest picture
