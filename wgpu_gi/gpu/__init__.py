"""The GPU layer: device, shaders, render graph; it knows nothing of scenes or light."""
