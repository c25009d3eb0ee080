"""What an import loads, for the tests of both packages."""

import json
import subprocess
import sys

PROGRAM = """
import json, sys
import numpy
before = set(sys.modules)
import {name}
print(json.dumps(sorted(set(sys.modules) - before)))
"""
#: Parts of Python's library that take long to load, and that neither package needs.
HEAVY = {
    "asyncio", "concurrent", "ctypes", "email", "http", "logging", "multiprocessing", "socket",
    "sqlite3", "ssl", "subprocess", "tkinter", "unittest", "urllib", "xml",
}  # fmt: skip


def loaded(name):
    """The modules that the import of a package loads beyond numpy's."""
    run = [sys.executable, "-c", PROGRAM.format(name=name)]
    return json.loads(subprocess.check_output(run, text=True))


def heavy(name):
    """What a package's import loads beyond numpy and light parts of Python's library: packages of
    others, which may be installed, and `HEAVY`."""
    others = {module.partition(".")[0] for module in loaded(name)} - {name, "numpy"}
    foreign = {module for module in others if module not in sys.stdlib_module_names}
    return sorted(foreign | others & HEAVY)
