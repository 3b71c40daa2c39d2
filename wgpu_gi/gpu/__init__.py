"""The GPU layer: device, shaders, render graph. It does not depend on scenes or light."""
