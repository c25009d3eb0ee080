"""Ray tracing inside unmodified VTK scripts, for the stock `vtk` wheel.

    python -m rtvtk script.py arguments...

runs a script in which every `vtkRenderer` ray traces what it can. Alternatively, `import rtvtk` before the first renderer is created. Options
are environment variables: RTV_AO=16, RTV_SHADOWS=1, RTV_REPORT=report.json and so on (`vtk-bridge --help` lists them).
"""
import sys

from .library import RtvError
from .renderer import install

__all__ = ["RtvError", "install"]
__version__ = "0.1.0"

# While `python -m rtvtk` imports this, argv is not set yet; the program installs rtvtk itself and reports errors without a traceback.
if sys.argv[:1] != ["-m"]:
    install()
