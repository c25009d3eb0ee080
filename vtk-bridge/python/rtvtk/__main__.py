"""`python -m rtvtk SCRIPT ARGUMENTS...`"""
import difflib
import os
import runpy
import sys

USAGE = """usage: python -m rtvtk [OPTIONS] SCRIPT [ARGUMENTS...]
       python -m rtvtk [OPTIONS] -m MODULE [ARGUMENTS...]
       python -m rtvtk doctor

Runs a VTK script with ray tracing; the script is not changed. `doctor` says what is there and what
is missing.

  python -m rtvtk plot.py
  python -m rtvtk --shadows --ao=16 plot.py
  RTV_SHADOWS=1 RTV_AO=16 python -m rtvtk plot.py   the same
  python -m rtvtk --report=report.json plot.py      what was traced, what not and why

Options, each also as RTV_NAME in the environment and as an argument of rtvtk.enable:
"""


def usage():
    """The text of --help."""
    from .options import RULES

    lines = []
    for name, rule in RULES.items():
        option = f"--{name.replace('_', '-')}"
        switch = rule == "True or False"
        lines.append(f"  {option}" if switch else f"  {option + '=VALUE':22} {rule}")
    return USAGE + "\n".join(lines) + "\n"


def options_of(arguments):
    """Options before the script, and the arguments from the script on.

    Raises `ValueError` for what is no option.
    """
    from .options import RULES

    options, rest = {}, list(arguments)
    while rest and rest[0].startswith("--") and rest[0] != "--":
        word = rest.pop(0)
        name, given, value = word[2:].partition("=")
        name = name.replace("-", "_")
        switch = RULES.get(name) == "True or False"
        if name not in RULES:
            near = difflib.get_close_matches(name, RULES, n=1)
            meant = f"; did you mean --{near[0].replace('_', '-')}?" if near else ""
            raise ValueError(f"{word} is no option{meant}")
        if switch == bool(given):
            cure = f"write --{word[2:].partition('=')[0]}" + ("" if switch else "=VALUE")
            raise ValueError(f"{word}: {cure}")
        options[name] = True if switch else value
    return options, rest


def main():
    arguments = sys.argv[1:]
    if arguments[:1] in (["-h"], ["--help"]):
        print(usage(), end="")
        return 0
    if arguments == ["doctor"]:
        from . import doctor

        return doctor.main()
    try:
        options, arguments = options_of(arguments)
    except ValueError as error:
        print(f"rtvtk: {error}; see python -m rtvtk --help", file=sys.stderr)
        return 2
    module = arguments[:1] == ["-m"]
    arguments = arguments[1:] if module else arguments
    if not arguments or arguments[0].startswith("-"):
        print(usage(), end="", file=sys.stderr)
        return 2
    if not module and not os.path.exists(arguments[0]):
        print(f"rtvtk: {arguments[0]}: no such script", file=sys.stderr)
        return 2
    from .library import RtvError

    try:
        from .renderer import install

        install()
        if options:
            from .options import enable

            enable(**options)
    except (RtvError, ImportError, TypeError, ValueError) as error:
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
