"""Stages that several techniques share: G-buffer, denoising, accumulation over frames, composite, scene inputs."""
