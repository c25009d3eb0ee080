"""Ray tracing inside unmodified VTK scripts, for the stock `vtk` wheel.

    python -m rtvtk script.py arguments...

runs a script in which every `vtkRenderer` ray traces what it can. Alternatively, `import rtvtk`
before the first renderer is created. Options are environment variables (RTV_AO=16, RTV_SHADOWS=1,
RTV_REPORT=report.json), or keyword arguments:

    rtvtk.enable(shadows=True, ao=16, samples=4)
    rtvtk.enable(plotter, ao=64)
    rtvtk.disable()

`python -m rtvtk --help` lists them, and `python -m rtvtk doctor` says what is missing.
"""
import sys

from .library import RtvError
from .options import disable, enable
from .renderer import install

__all__ = ["RtvError", "disable", "enable", "install"]
__version__ = "0.1.0"

# While `python -m rtvtk` imports this, argv is not set yet; the program installs rtvtk itself and reports errors without a traceback.
if sys.argv[:1] != ["-m"]:
    install()
