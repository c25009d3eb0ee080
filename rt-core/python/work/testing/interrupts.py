"""Ctrl-C in the middle of long calls, for the tests of both packages."""

import subprocess
import sys

#: Presses Ctrl-C again and again, until a call has been stopped before its end. The calls would
#: take minutes or hours. No time is measured: a package that does not look for Ctrl-C does not end.
#: A thread of Python's presses, so the interpreter must be free meanwhile.
PROGRAM = """
import os, signal, sys, threading
sys.path[:0] = {paths!r}
{prepare}
calling = False

def on_signal(*_):
    global calling
    if calling:
        calling = False
        raise KeyboardInterrupt

def press():
    while not done.wait(0.2):
        os.kill(os.getpid(), signal.SIGINT)

signal.signal(signal.SIGINT, on_signal)
done = threading.Event()
presses = threading.Thread(target=press)
presses.start()
interrupted = 0
while count_stopped_calls() == 0:
    try:
        calling = True
        {call}
        calling = False
    except KeyboardInterrupt:
        interrupted += 1
done.set()
presses.join()
assert interrupted >= 1
{after}
print("stopped")
"""
#: Seconds after which a call counts as hanging.
HANGS = 300


def check(paths, prepare, call, after=""):
    """Runs `prepare`, and `call` until Ctrl-C has stopped one; then `after`."""
    code = PROGRAM.format(paths=paths, prepare=prepare, call=call, after=after)
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, capture_output=True, text=True, timeout=HANGS)
    assert done.stdout == "stopped\n", done.stderr
