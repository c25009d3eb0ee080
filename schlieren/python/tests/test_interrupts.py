"""Ctrl-C stops a long call before its end."""

import os

import interrupts

PREPARE = """
import schlieren
from flows import field, render
from schlieren._schlieren import count_stopped_calls

of = field(24)
render(of, size=(8, 8), layers=())
"""
CALL = 'render(of, size=(2048, 2048), samples=64, march="verlet", layers=())'
AFTER = "assert render(of, size=(8, 8), layers=()).brightness.shape == (8, 8)"


def test_ctrl_c_stops_a_long_call():
    interrupts.check([os.path.dirname(__file__)], PREPARE, CALL, AFTER)
