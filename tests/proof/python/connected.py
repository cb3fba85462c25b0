"""A connected robot beside the same one in this process; stdout asks the test for actions."""

import _thread
import contextlib
import gc
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import sarrus
from checks import raises


def do(order):
    """Ask the test for something, and wait until it is done."""
    print(order, flush=True)
    assert sys.stdin.readline() == "done\n"


def plans():
    """How many plans the server's clients hold, by its own count."""
    print("count the plans", flush=True)
    return int(sys.stdin.readline())


@contextlib.contextmanager
def waiting(call):
    """A thread is within a call of the extension that waits; it ends after this."""
    begun = threading.Event()

    def run():
        begun.set()
        call()

    thread = threading.Thread(target=run)
    # from `begun` on it has Python's lock until the extension gives that away
    interval = sys.getswitchinterval()
    sys.setswitchinterval(600.0)
    try:
        thread.start()
        begun.wait()
        # `S` behind the name: it sleeps
        stat = Path(f"/proc/self/task/{thread.native_id}/stat")
        while stat.read_text().rpartition(")")[2].split()[0] != "S":
            time.sleep(0.001)
        yield
    finally:
        sys.setswitchinterval(interval)
    thread.join()


name = sys.argv[1]
here = sarrus.Robot.bundled("lambda")
there = sarrus.Robot.connect(name, timeout=5.0, deadline=4.0, fingerprint=here.fingerprint)
assert there.is_connected and there.joints == here.joints
assert f"connected to {name}" in repr(there)

# the same answers, one by one and as rows
y, yd, ydd = 0.1 * np.random.default_rng(4).standard_normal((3, 300, 1))
expected = here.inverse_dynamics(y, yd, ydd)
for _ in range(2):
    np.testing.assert_array_equal(there.inverse_dynamics(y, yd, ydd), expected)
    np.testing.assert_array_equal(there.inverse_dynamics(y[7], yd[7], ydd[7]), expected[7])
    np.testing.assert_array_equal(there.mass_matrix(y), here.mass_matrix(y))
    for found, same in zip(there.state(y[3], yd[3]), here.state(y[3], yd[3]), strict=True):
        np.testing.assert_array_equal(found, same)
    raises(sarrus.StateError, "non_finite_input", there.mass_matrix, [np.nan])
    do("stop the server")
    gone = sarrus.Robot.connect
    raises(sarrus.ConnectError, f"no server named `{name}`", gone, name)
    do("start the server")

# a fork leaves the parent's connection alone
with warnings.catch_warnings():
    # later Pythons warn of threads, of which numpy has some
    warnings.simplefilter("ignore", DeprecationWarning)
    child = os.fork()
if child == 0:
    code = 1
    try:
        raises(sarrus.ConnectError, "connect again after a fork", there.mass_matrix, [0.1])
        raises(sarrus.ConnectError, "connect again after a fork", there.mass_matrix, [[0.1]])
        own = sarrus.Robot.connect(name, timeout=30.0)
        np.testing.assert_array_equal(own.mass_matrix([0.1]), here.mass_matrix([0.1]))
        del own, there
        gc.collect()
        code = 0
    finally:
        sys.stderr.flush()
        os._exit(code)
assert os.waitpid(child, 0)[1] == 0
np.testing.assert_array_equal(there.inverse_dynamics(y, yd, ydd), expected)

# threads take turns, rows and single states
found, questions = [], [(y, yd, ydd), (y[7], yd[7], ydd[7])] * 3
threads = [
    threading.Thread(target=lambda asked=asked: found.append(there.inverse_dynamics(*asked)))
    for asked in questions
]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert sorted(map(len, found)) == [1, 1, 1, 300, 300, 300]
for answer in found:
    np.testing.assert_array_equal(answer, expected if len(answer) == 300 else expected[7])

# progress of rows, and its exception, which ends them
seen = []
there.inverse_dynamics(y, yd, ydd, progress=lambda *state: seen.append(state))
assert seen[-1] == (300, 300), seen
raises(ZeroDivisionError, "", there.inverse_dynamics, y, yd, ydd, progress=lambda *_: 1 / 0)

# dropping a query waits neither for the server nor for a thread that asks it: a wait with Python's
# lock held would never end, since the server continues only after it
patient = sarrus.Robot.connect(name, timeout=600.0, wait="polite")
fields = ("q", "u", "G", "qd", "ud")
queries = [patient.query("kinematics", ["y", "yd"], [field]) for field in fields]
asked = queries.pop()
held = plans()
do("pause the server")
answers = []
with waiting(lambda: answers.append(asked(y=[0.1], yd=[0.0]))):
    queries.pop()
    queries.pop()
    gc.collect()
    assert not answers
    do("resume the server")
assert np.isfinite(answers[0].ud).all()
assert plans() == held
# the next query releases both before it is prepared, which another thread's drop does not wait for
do("pause the server")
with waiting(lambda: answers.append(patient.query("kinematics", ["y"], ["q"]))):
    queries.pop()
    gc.collect()
    assert len(answers) == 1
    do("resume the server")
assert plans() == held - 2 + 1
np.testing.assert_array_equal(answers[1](y=[0.1]).q, here.state([0.1]).q)
last = patient.query("kinematics", ["y"], ["u"])
assert plans() == held - 3 + 2

# Ctrl-C ends every wait for a server, long before its time-out, and the robot asks again after it
signal.signal(signal.SIGINT, signal.default_int_handler)
for transport in ("lane", "service"):
    stuck = sarrus.Robot.connect(name, timeout=600.0, wait="polite", transport=transport)
    for call in (
        lambda: stuck.mass_matrix([0.1]),
        lambda: stuck.mass_matrix([[0.1]] * 300),
        lambda: stuck.bias_force([0.1]),
        lambda: sarrus.Robot.connect(name, timeout=600.0),
    ):
        np.testing.assert_array_equal(stuck.mass_matrix([[0.1]]), here.mass_matrix([[0.1]]))
        do("pause the server")
        timer = threading.Timer(0.2, _thread.interrupt_main)
        begun = time.monotonic()
        timer.start()
        raises(KeyboardInterrupt, "", call)
        assert 0.1 < time.monotonic() - begun < 10.0
        timer.join()
        do("resume the server")
    np.testing.assert_array_equal(stuck.bias_force([0.1]), here.bias_force([0.1]))

# a handler that comes meanwhile is refused the same robot, and may ask others; the wait goes on
refused, others = [], []


def handler(*_):
    others.append(here.mass_matrix([0.1]))
    try:
        stuck.mass_matrix([0.1])
    except sarrus.ConnectError as error:
        refused.append(str(error))
    handled.set()


handled = threading.Event()
signal.signal(signal.SIGALRM, handler)
do("pause the server")
# standard output and input are the main thread's until then
resume = threading.Thread(target=lambda: (handled.wait(), do("resume the server")))
resume.start()
signal.setitimer(signal.ITIMER_REAL, 0.2)
np.testing.assert_array_equal(stuck.mass_matrix([0.1]), here.mass_matrix([0.1]))
resume.join()
assert len(others) == 1 and "this robot is being asked" in refused[0], refused

# calls that a connection refuses
raises(TypeError, "connect anew", pickle.dumps, there)
raises(sarrus.QueryError, "a server does not simulate", there.simulate, 1.0, [0.1])
raises(sarrus.ConnectError, "expected", sarrus.Robot.connect, name, fingerprint=1)
raises(ValueError, "transport is `tcp`", sarrus.Robot.connect, name, transport="tcp")
assert there.late == 0 and here.late == 0
service = sarrus.Robot.connect(name, transport="service", wait="polite")
np.testing.assert_array_equal(service.mass_matrix([0.1]), here.mass_matrix([0.1]))

# a server that is gone is an error, after the time-out
hasty = sarrus.Robot.connect(name, timeout=2.0)
hasty.mass_matrix([0.1])
do("stop the server")
raises(sarrus.ConnectError, "is gone", hasty.mass_matrix, [0.1])
raises(sarrus.ConnectError, "is gone", hasty.mass_matrix, [[0.1]] * 3)
