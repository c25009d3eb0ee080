"""`python -m rtvtk SCRIPT ARGUMENTS...`"""
import os
import runpy
import sys

USAGE = """usage: python -m rtvtk SCRIPT [ARGUMENTS...]
       python -m rtvtk -m MODULE [ARGUMENTS...]

Runs a VTK script with ray tracing; the script is not changed.

  python -m rtvtk plot.py
  RTV_SHADOWS=1 RTV_AO=16 python -m rtvtk plot.py
  RTV_REPORT=report.json python -m rtvtk plot.py    what was traced, what not and why
"""


def main():
    arguments = sys.argv[1:]
    if arguments[:1] in (["-h"], ["--help"]):
        print(USAGE, end="")
        return 0
    module = arguments[:1] == ["-m"]
    arguments = arguments[1:] if module else arguments
    if not arguments or arguments[0].startswith("-"):
        print(USAGE, end="", file=sys.stderr)
        return 2
    if not module and not os.path.exists(arguments[0]):
        print(f"rtvtk: {arguments[0]}: no such script", file=sys.stderr)
        return 2
    from .library import RtvError

    try:
        from .renderer import install

        install()
    except (RtvError, ImportError) as error:
        print(f"rtvtk: {error}", file=sys.stderr)
        return 2
    sys.argv = arguments
    if module:
        runpy.run_module(arguments[0], run_name="__main__", alter_sys=True)
    else:
        # As Python does for a script, its own folder comes first.
        sys.path[0] = os.path.dirname(os.path.abspath(arguments[0]))
        runpy.run_path(arguments[0], run_name="__main__")
    return 0


if __name__ == "__main__":
    sys.exit(main())
