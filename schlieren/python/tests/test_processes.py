"""Threads, forks, signals and memory."""

import gc
import os
import signal
import subprocess
import sys
import threading
import time
import tracemalloc
import warnings
from concurrent.futures import ThreadPoolExecutor

import pytest
import schlieren
from flows import field, render, same


def test_threads_share_a_field_and_release_the_interpreter():
    of = field(24)
    expected = render(of)
    with ThreadPoolExecutor(4) as pool:
        assert all(same(i, expected) for i in pool.map(lambda _: render(of), range(8)))
    ticks = []
    done = threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(None)
            time.sleep(0.005)

    ticker = threading.Thread(target=tick)
    ticker.start()
    start, count = time.perf_counter(), 0
    while time.perf_counter() - start < 0.5 or count == 0:
        render(of, size=(256, 256))
        count += 1
    done.set()
    ticker.join()
    assert len(ticks) > 10, "no other thread ran during a long call"


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forked_children_have_threads_of_their_own():
    of = field(24)
    expected = render(of)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            code = 0 if same(render(of), expected) else 1
        finally:
            os._exit(code)
    for _ in range(1200):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            assert status == 0
            return
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    pytest.fail("a forked child hangs")


INTERRUPTED = """
import os, signal, sys, threading, time
sys.path.insert(0, {tests!r})
import schlieren
from flows import field, render
of = field(48)
render(of, size=(8, 8), layers=())
# Who starts the tests in the background may have told them to ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
def interrupt():
    time.sleep(0.3)
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    while True:
        render(of, size=(2048, 2048), samples=64, march="verlet", layers=())
except KeyboardInterrupt:
    assert render(of, size=(8, 8), layers=()).brightness.shape == (8, 8)
    print("stopped")
"""


def test_ctrl_c_stops_a_long_call():
    code = INTERRUPTED.format(tests=os.path.dirname(__file__))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout == "stopped\n", done.stderr


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def test_calls_leave_no_memory_behind():
    of = field(8)

    def calls(count):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for i in range(count):
                render(of, size=(8, 8), threads=1)
                if i % 10 == 0:
                    render(field(8), size=(8, 8), threads=1)
                    try:
                        render(of, march="none")
                    except ValueError:
                        pass
            schlieren.index()

    calls(100)
    tracemalloc.start()
    # What Python keeps of lines and of types that it has met is not ours.
    calls(100)
    gc.collect()
    before, traced = resident(), tracemalloc.get_traced_memory()[0]
    calls(400)
    gc.collect()
    grown, kept = resident() - before, tracemalloc.get_traced_memory()[0] - traced
    tracemalloc.stop()
    # A field of 8^3 nodes and an image have some kilobytes: a leak of each would show.
    assert kept < 100_000, kept
    assert grown < 8_000_000, grown
