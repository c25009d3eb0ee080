"""What programs of all kinds turned out to do, as small programs: `traps.py CASE OUT`, like hard_cases.py."""
from math import cos, sin

from gl_by_ctypes import *


def lists():
    return F("glNewList", c_uint, c_uint), F("glEndList"), F("glCallList", c_uint), F("glGenLists", c_int)


def disc(r, n=24):
    begin(FAN)
    vertex(0, 0, 0)
    for k in range(n + 1):
        a = 6.2831853 * k / n
        vertex(r * cos(a), r * sin(a), 0.1)
    end()


def generated_lists_with_state_between_primitives():
    """Each list has several primitives with state between them, and names come from glGenLists after the first were compiled (xscreensaver's gears)."""
    simple()
    new, done, call, generate = lists()
    names = []
    for k in range(3):
        names.append(generate(1))
        new(names[-1], 0x1300)
        F("glPushMatrix")()
        scale(0.3, 0.3, 0.3)
        for turn, shade in ((0, 0.9), (20, 0.6), (40, 0.3)):
            F("glFrontFace", c_uint)(0x0901)
            color(shade, k / 3, 1 - k / 3, 1)
            rotate(turn, 0.3, 0.5, 0.1)
            bump(3)
        F("glPopMatrix")()
        done()
    assert len(set(names)) == 3
    for k, name in enumerate(names):
        F("glPushMatrix")()
        translate(k - 1, 0.8 * (k % 2), 0.1 * k)
        call(name)
        F("glPopMatrix")()


run(globals())
