"""The desktop viewer: a window with a scene, a panel of all settings, and what is inside a frame. Nobody imports it."""
