"""Screen-space directional occlusion and one bounce (Ritschel et al. 2009)."""
