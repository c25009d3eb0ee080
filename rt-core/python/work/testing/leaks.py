"""What many calls leave behind, for the tests of both packages."""

import ctypes
import gc
import os
import tracemalloc

import pytest

#: What a kind of call may leave: blocks that threads keep for their next one.
KEPT_BYTES = 100_000
#: Pages that the system has given and not taken back: arenas grow in steps.
RESIDENT_BYTES = 6_000_000
#: Rounds that all have to leave more for a leak.
ROUNDS = 3


class _MallInfo(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd",
            "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
        )
    ]  # fmt: skip


def allocated():
    """Bytes that the C library has handed out, which the native modules allocate with."""
    try:
        info = ctypes.CDLL(None).mallinfo2
    except AttributeError:
        pytest.skip("this C library does not tell what it has handed out (mallinfo2 of glibc 2.33)")
    info.restype = _MallInfo
    found = info()
    return found.uordblks + found.hblkhd


def resident():
    """Bytes of the process that are in memory."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def left(call, count):
    """Bytes of Python, of the C library and of the process that so many calls leave."""
    gc.collect()
    before = tracemalloc.get_traced_memory()[0], allocated(), resident()
    for _ in range(count):
        call()
    gc.collect()
    after = tracemalloc.get_traced_memory()[0], allocated(), resident()
    return [b - a for a, b in zip(before, after)]


def check(call, count):
    """Calls `call` that often, and fails if memory of Python or of the C library stays.

    Threads keep blocks for a while, so the calls are repeated when much is left: a leak grows each
    time.
    """
    for _ in range(max(count // 10, 20)):
        call()
    tracemalloc.start()
    try:
        # What Python keeps of the lines that it runs for the first time while it traces.
        for _ in range(20):
            call()
        for _ in range(ROUNDS):
            python, native, pages = left(call, count)
            if python < KEPT_BYTES and native < KEPT_BYTES and pages < RESIDENT_BYTES:
                return
    finally:
        tracemalloc.stop()
    raise AssertionError(
        f"{count} calls leave {python} bytes of Python, {native} of the C library, {pages} resident"
    )
