"""A hundred thousand calls leave no memory behind."""

import contextlib
import warnings

import leaks
import pytest
import schlieren
from flows import field, warm

OF = field(4)
DENSITY = warm(4)
FEW = {"size": (2, 2), "tolerance_rad": 1e-3, "threads": 1}
FIELD = {"density": DENSITY, "spacing": 0.01}


def refused(call, *args, **options):
    with contextlib.suppress(ValueError, TypeError, OSError):
        call(*args, **options)
        raise AssertionError("it was not refused")


CALLS = {
    "index": (11_000, lambda: schlieren.index()),
    "render": (300, lambda: schlieren.render(OF, **FEW)),
    "render_all": (200, lambda: schlieren.render(OF, "bos", layers="all", **FEW)),
    "probe": (500, lambda: schlieren.probe(OF, (1, 1), tolerance_rad=1e-3, threads=1)),
    "fields": (1000, lambda: schlieren.Field(**FIELD)),
    "fields_and_render": (100, lambda: schlieren.render(schlieren.Field(**FIELD), **FEW)),
    # By a check of Python's files, by the native module, by the library.
    "refused_sizes": (70_000, lambda: refused(schlieren.render, OF, size=(0, 2))),
    "refused_names": (1000, lambda: refused(schlieren.render, OF, "schliern")),
    "refused_index": (10_000, lambda: refused(schlieren.index, species={"?": 1.0})),
    "refused_fields": (5000, lambda: refused(schlieren.Field, density=DENSITY, spacing=-1)),
    "refused_march": (500, lambda: refused(schlieren.render, OF, march="?", **FEW)),
    "refused_files": (400, lambda: refused(schlieren.Field.open, "?.vti", density="rho")),
}


@pytest.mark.parametrize("name", CALLS)
def test_calls_leave_no_memory_behind(name):
    count, call = CALLS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        leaks.check(call, count)


def test_they_are_a_hundred_thousand():
    assert sum(count for count, _ in CALLS.values()) >= 100_000
