"""A connected robot beside the same one in this process; stdout asks for what is to be done."""

import gc
import os
import pickle
import sys
import threading
import time
import warnings

import numpy as np
import sarrus


def do(order):
    """Ask the test for something, and wait until it is done."""
    print(order, flush=True)
    assert sys.stdin.readline() == "done\n"


def raises(error, words, f, *args, **keywords):
    """What is called raises this, with these words."""
    try:
        f(*args, **keywords)
    except error as found:
        assert words in str(found), found
        return
    raise AssertionError(f"{f} raised nothing")


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
        own = sarrus.Robot.connect(name)
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

# queries and robots that are dropped wait for no server, and for no thread that asks it
patient = sarrus.Robot.connect(name, timeout=600.0)
queries = [patient.query("kinematics", ["y"], [field]) for field in ("q", "u", "G")]
asked = queries.pop()
do("pause the server")
answers = []
thread = threading.Thread(target=lambda: answers.append(asked(y=[0.1])))
thread.start()
before = time.monotonic()
while queries:
    queries.pop()
    gc.collect()
assert time.monotonic() - before < 300 and not answers
do("resume the server")
thread.join()
assert np.isfinite(answers[0].G).all()
again = patient.query("kinematics", ["y"], ["q"])
np.testing.assert_array_equal(again(y=[0.1]).q, here.state([0.1]).q)

# what a connection cannot do
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
