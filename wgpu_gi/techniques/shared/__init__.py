"""What several techniques stand on: G-buffer, denoising, accumulation over frames, composite, scene inputs."""
