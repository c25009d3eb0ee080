"""Threads and forks."""

import threading
from concurrent.futures import ThreadPoolExecutor

import forks
import pytest
import schlieren
from flows import field, render, same

OF = field(16)


def test_eight_threads_at_once_get_the_same_bits():
    expected = render(OF), render(OF, "bos"), schlieren.index(temperature_c=[0, 20]).n_minus_1
    together = threading.Barrier(8)

    def work(number):
        together.wait()
        own = field(16) if number % 2 else OF
        threads = (None, 1, 2, 5)[number % 4]
        found = render(own, threads=threads), render(own, "bos", threads=threads)
        return *found, schlieren.index(temperature_c=[0, 20]).n_minus_1

    with ThreadPoolExecutor(8) as pool:
        for one, bos, index in pool.map(work, range(8)):
            assert same(one, expected[0]) and same(bos, expected[1])
            assert (index == expected[2]).all()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forked_children_have_threads_of_their_own():
    expected = render(OF)
    forks.check(lambda: same(render(OF), expected))
    # And while other threads render the same field.
    done = threading.Event()

    def busy():
        while not done.is_set():
            render(OF, size=(8, 8))

    others = [threading.Thread(target=busy) for _ in range(2)]
    for other in others:
        other.start()
    try:
        for _ in range(10):
            forks.check(lambda: same(render(OF), expected))
    finally:
        done.set()
        for other in others:
            other.join()


def brightness(_):
    return render(OF).brightness.tobytes()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_multiprocessing_may_fork_after_use():
    assert forks.results(brightness, range(4)) == [brightness(0)] * 4
