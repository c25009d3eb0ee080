"""Threads and forks."""

import pickle
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import forks
import numpy as np
import pytest
import rt_core
from shapes import rays, sphere

SCENE = rt_core.Scene(*sphere())
RAYS = rays(20_000)


def answers(scene, threads=None):
    """The bits of all kinds of calls."""
    few = RAYS[0][:500]
    every = [
        *scene.cast(*RAYS, threads=threads),
        scene.occluded(*RAYS, threads=threads),
        scene.count(*RAYS, threads=threads),
        *scene.all_hits(*RAYS, threads=threads),
        scene.contains(few, threads=threads),
        *scene.closest_point(few, threads=threads),
        scene.signed_distance(few, threads=threads),
    ]
    return [array.tobytes() for array in every]


def picture(number):
    ball = rt_core.Spheres([[0, 0, 0]], 1.0)
    shade = {"ambient_occlusion": (1.0, 4), "samples": 2, "seed": number % 2}
    return rt_core.render(ball, size=(40, 30), **shade).color.tobytes()


def test_eight_threads_at_once_get_the_same_bits():
    expected = answers(SCENE)
    pictures = [picture(0), picture(1)]
    together = threading.Barrier(8)

    def work(number):
        together.wait()
        own = rt_core.Scene(*sphere()) if number % 2 else SCENE
        # Different numbers of threads work at once too.
        return answers(own, threads=(None, 1, 2, 5)[number % 4]), picture(number)

    with ThreadPoolExecutor(8) as pool:
        for _ in range(2):
            for number, (found, shown) in enumerate(pool.map(work, range(8))):
                assert found == expected and shown == pictures[number % 2]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forked_children_have_threads_of_their_own():
    expected = answers(SCENE)
    for _ in range(3):
        forks.check(lambda: answers(SCENE) == expected)
    # And while another thread traces, builds and renders.
    done = threading.Event()

    def busy():
        while not done.is_set():
            answers(rt_core.Scene(*sphere()))
            picture(0)

    others = [threading.Thread(target=busy) for _ in range(2)]
    for other in others:
        other.start()
    try:
        for _ in range(10):
            forks.check(lambda: answers(SCENE) == expected)
    finally:
        done.set()
        for other in others:
            other.join()
    assert answers(SCENE) == expected


def answers_here(_):
    return answers(SCENE)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_multiprocessing_may_fork_after_use():
    expected = answers(SCENE)
    assert forks.results(answers_here, range(4)) == [expected] * 4


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
