"""What a farm does unless told otherwise."""

# Cores per worker process where a CPU renders: one thread each gives the most frames per second, see tools/README.md.
THREADS = 1
