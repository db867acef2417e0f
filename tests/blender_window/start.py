"""Runs inside a windowed Blender: has a script beside it drive the window.

``blender --factory-startup --python start.py -- ZIP FOLDER DRIVER [ARGUMENT ...]``. Without a zip (``-``) the extension is installed.
Answers and screenshots are written into the folder.
"""

import importlib
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import window_steps as steps


def drive():
    """Have the driver begin its steps; what is wrong with it is said there, too."""
    try:
        importlib.import_module(steps.DRIVER)
    except Exception:
        steps.fail()


bpy.app.timers.register(drive, first_interval=0.1)
