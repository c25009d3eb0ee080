"""Forked children, for the tests of both packages."""

import multiprocessing
import os
import signal
import time

#: Seconds after which a child counts as hanging.
HANGS = 120


def check(work):
    """Runs `work` in a child that is forked now; fails if it is wrong there, raises or hangs."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            code = 0 if work() else 1
        finally:
            os._exit(code)
    for _ in range(20 * HANGS):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            assert status == 0, "the forked child fails"
            return
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    raise AssertionError("the forked child hangs")


def results(work, items, processes=2):
    """`work` of each item, in processes that multiprocessing forks."""
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        return pool.map_async(work, items).get(timeout=HANGS)
