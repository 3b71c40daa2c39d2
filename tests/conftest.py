"""What every test sees: a quiet Vulkan driver, and the package of this checkout in child processes."""

import os
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
