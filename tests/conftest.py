"""The environment of every test: a quiet Vulkan driver, and this checkout's package in child processes."""

import os
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
