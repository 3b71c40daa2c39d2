"""Hierarchical screen-space indirect light with voxel visibility (Soler et al. 2010)."""
