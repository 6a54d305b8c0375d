"""Solvers observed: what is reported of an iterate, and which of them is kept."""

from __future__ import annotations

import contextlib
import signal
import time
import weakref

import casadi
import numpy as np
import pytest

from shapephase.optimal_control.solver_callback import BestIterate, heard_interrupts, ipopt_callback


def test_the_cheapest_of_the_nearly_feasible_is_kept():
    best = BestIterate(None, float)
    iterates = [(5.0, 0.5), (1.0, 0.2), (3.0, 1e-5), (2.0, 2e-4), (2.5, 0.0), (0.1, 0.1)]
    for number, (cost, infeasibility) in enumerate(iterates):
        assert not best.report(np.array([float(number)]), cost, infeasibility)
    assert (best.unknowns[0], best.cost, best.infeasibility) == (3.0, 2.0, 2e-4)
    assert best.iterations == 6


def test_the_least_infeasible_is_kept_where_none_is_feasible():
    best = BestIterate(None, float)
    for number, infeasibility in enumerate((0.5, 0.2, 0.4)):
        best.report(np.array([float(number)]), -infeasibility, infeasibility)
    assert best.unknowns[0] == 1.0


def test_an_iterate_is_reported_with_its_largest_violation():
    """x^2 between 4 and 9 and x y = 1 exactly: violated on either side, each reported as it is."""
    low, high = np.array([4.0, 1.0]), np.array([9.0, 1.0])
    reported = []
    best = BestIterate(lambda *now: reported.append(now) or now[0] == 1, lambda unknowns: float(unknowns[1]))
    callback = ipopt_callback(best, 2, low, high)
    nothing = np.zeros(2), np.zeros(2), np.zeros(0)
    for rows, expected in (([3.5, 1.2], 0.5), ([9.25, 0.9], 0.25)):
        stop = callback(np.array([1.0, 2.0]), 7.0, np.array(rows), *nothing)
        assert reported[-1][1:] == (7.0, pytest.approx(expected, abs=1e-15), 2.0)
    assert int(casadi.DM(stop)) == 1
    assert best.stopped


class Interrupted:
    """An argument in the middle of whose conversion Ctrl-C is pressed."""

    def __init__(self):
        self.presses = 0

    @property
    def tocsc(self):
        self.presses += 1
        if self.presses == 1:
            signal.raise_signal(signal.SIGINT)
        raise AttributeError


class Ending:
    """Something in whose end Ctrl-C is pressed."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)


class Asked:
    """Something in whose use Ctrl-C is pressed."""

    def __bool__(self):
        signal.raise_signal(signal.SIGINT)
        return False


def forgotten_weakly():
    """The end of a key of a weak dictionary, in whose own callback Ctrl-C is pressed."""
    known = weakref.WeakKeyDictionary()
    key = BestIterate(None, float)
    known[key] = 1
    known._iterating = Asked()
    del key
    known._iterating = set()


@pytest.mark.usefixtures("heard_ctrl_c")
@pytest.mark.parametrize("end", [Ending, forgotten_weakly])
def test_ctrl_c_in_the_end_of_an_object_comes_a_moment_later(end):
    def ended():
        end()
        time.sleep(30.0)

    with pytest.raises(KeyboardInterrupt), heard_interrupts():
        ended()


@pytest.mark.usefixtures("heard_ctrl_c")
def test_ctrl_c_of_which_a_library_made_another_error_is_ctrl_c():
    def half_imported():
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise AttributeError

    with pytest.raises(KeyboardInterrupt), heard_interrupts():
        half_imported()
    with pytest.raises(AttributeError), heard_interrupts():
        raise AttributeError


@pytest.mark.usefixtures("heard_ctrl_c")
def test_ctrl_c_while_casadi_asks_what_an_argument_is_comes_a_moment_later():
    argument = Interrupted()

    def converted():
        with contextlib.suppress(NotImplementedError):
            casadi.sin(argument)
        time.sleep(30.0)

    with pytest.raises(KeyboardInterrupt), heard_interrupts():
        converted()
    assert argument.presses
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
