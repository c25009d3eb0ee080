"""Threads, forks, signals and memory."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import tracemalloc
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
import rt_core
from shapes import rays, sphere


def test_threads_share_a_scene_and_release_the_interpreter():
    scene = rt_core.Scene(*sphere())
    origins, directions = rays(20_000)
    expected = scene.cast(origins, directions)
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: scene.cast(origins, directions), range(32)))
    for hits in found:
        np.testing.assert_array_equal(hits.t, expected.t)

    large = rays(3_000_000)
    ticks = []
    done = threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.005)

    ticker = threading.Thread(target=tick)
    ticker.start()
    scene.count(*large)
    done.set()
    ticker.join()
    assert len(ticks) > 20, "no other thread ran during a long call"


def in_child(scene, origins, directions, expected):
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        same = np.array_equal(scene.cast(origins, directions).t, expected)
        os.write(write, b"1" if same else b"0")
        os._exit(0)
    os.close(write)
    for _ in range(600):
        if os.waitpid(child, os.WNOHANG)[0]:
            break
        time.sleep(0.05)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        pytest.fail("a forked child hangs")
    with os.fdopen(read, "rb") as pipe:
        assert pipe.read() == b"1"


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forked_children_have_threads_of_their_own():
    scene = rt_core.Scene(*sphere())
    origins, directions = rays(100_000)
    expected = scene.cast(origins, directions).t
    for _ in range(3):
        in_child(scene, origins, directions, expected)
    # And while another thread traces.
    busy = threading.Thread(target=lambda: scene.count(*rays(1_000_000)))
    busy.start()
    in_child(scene, origins, directions, expected)
    busy.join()
    np.testing.assert_array_equal(scene.cast(origins, directions).t, expected)


def cast_pickled(data):
    scene, origins, directions = pickle.loads(data)
    return scene.cast(origins, directions).t


def test_scenes_travel_to_other_processes():
    scene = rt_core.Scene(*sphere(8))
    origins, directions = rays(1000)
    data = pickle.dumps((scene, origins, directions))
    with ProcessPoolExecutor(2) as pool:
        for t in pool.map(cast_pickled, [data] * 4):
            np.testing.assert_array_equal(t, scene.cast(origins, directions).t)


INTERRUPTED = """
import signal, sys, threading, time, os
import numpy as np
sys.path.insert(0, {tests!r})
import rt_core
from shapes import sphere, rays
large = sphere({rings})
scene = rt_core.Scene(*sphere(256))
origins, directions = rays(4_000_000)
# Who starts the tests in the background may have told them to ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
def interrupt():
    time.sleep(0.2)
    global sent
    sent = time.perf_counter()
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    while True:
        {call}
except KeyboardInterrupt:
    late = time.perf_counter() - sent
    assert late < 1.5, late
    assert rt_core.Scene(*sphere(8)).occluded([[0, 0, 5]], [[0, 0, -1]])[0]
    print("stopped")
"""


@pytest.mark.parametrize(
    "call, rings",
    [
        ("scene.cast(origins, directions)", 8),
        ("scene.all_hits(origins, directions)", 8),
        ("scene.signed_distance(origins)", 8),
        ("rt_core.Scene(*large)", 500),
    ],
)
def test_ctrl_c_stops_long_calls(call, rings):
    tests = os.path.dirname(__file__)
    code = INTERRUPTED.format(tests=tests, call=call, rings=rings)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout == "stopped\n", done.stderr


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def test_calls_leave_no_memory_behind():
    scene = rt_core.Scene(*sphere(8))
    origins, directions = rays(4)

    def calls(count):
        for i in range(count):
            scene.cast(origins, directions)
            scene.all_hits(origins, directions)
            scene.occluded(origins, directions)
            if i % 8 == 0:
                scene.closest_point(origins)
                try:
                    scene.cast(origins, directions * 0)
                except ValueError:
                    pass
            if i % 100 == 0:
                rt_core.Scene(*sphere(4))

    calls(3000)
    tracemalloc.start()
    before, traced = resident(), tracemalloc.get_traced_memory()[0]
    calls(30_000)
    grown, kept = resident() - before, tracemalloc.get_traced_memory()[0] - traced
    tracemalloc.stop()
    # 100,000 calls: one byte of each would show.
    assert kept < 50_000, kept
    assert grown < 4_000_000, grown
