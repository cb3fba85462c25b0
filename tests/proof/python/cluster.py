"""Rows on workers of dask: the bits of one process, a worker killed, faults, and an early end."""

import itertools
import os
import signal
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import sarrus
import sarrus.distributed
from checks import raises
from dask.distributed import Client, LocalCluster

ROWS, BLOCK = 40_000, 500


def bits(array):
    """The bits of numbers, which NaN has too."""
    return np.ascontiguousarray(array).view(np.uint64)


def queries():
    """How many queries a worker keeps of each robot."""
    return [len(queries) for _, queries in sarrus.distributed._robots.values()]


def kept():
    """Fingerprints of a worker's robots, and which objects they are."""
    return {key: id(entry) for key, entry in sarrus.distributed._robots.items()}


def call_yourself(version):
    """Make a worker another version."""
    sarrus.distributed.__version__ = version


def motions(robot, rows):
    """Random states near the zero pose, two of them without an answer."""
    y, yd, ydd = 0.1 * np.random.default_rng(5).standard_normal((3, rows, len(robot.independents)))
    y[[3, rows // 2]] = np.nan
    return {"ydd": ydd, "y": y, "yd": yd}


def killed(client, robot, rows, expected):
    """A worker dies after the first block; nothing is lost, and all is as in one process."""
    before = client.run(os.getpid)
    assert len(before) == 2, before
    seen = []

    def kill(done, total):
        if not seen:
            os.kill(next(iter(before.values())), signal.SIGKILL)
        seen.append((done, total))

    answer = sarrus.distributed.map(robot, rows, client, rows_of_a_block=BLOCK, progress=kill)
    assert seen[0] == (BLOCK, ROWS) and seen[-1] == (ROWS, ROWS), (seen[0], seen[-1])
    assert seen == sorted(seen) and len(seen) == ROWS // BLOCK
    np.testing.assert_array_equal(bits(answer.tau_u), bits(expected.tau_u))
    np.testing.assert_array_equal(answer.status, expected.status)
    np.testing.assert_array_equal(answer.warnings, expected.warnings)
    assert sorted(np.flatnonzero(answer.status)) == [3, ROWS // 2]
    # it was one of the two, and another one has its place
    client.wait_for_workers(2)
    after = client.run(os.getpid)
    assert len(set(before.values()) & set(after.values())) == 1, (before, after)


def whole(client, robot, rows):
    """Any request, in blocks of the usual size; each worker compiles the robot once."""
    few = {name: array[:9_000] for name, array in rows.items() if name != "ydd"}
    want = ["M_y", "sigma_min"]
    expected = robot.query("inverse-dynamics", list(few), want)(**few)
    there = {}
    # until a worker that began late has had blocks as well
    while len(there) < 2 or not all(robot.fingerprint in one for one in there.values()):
        answer = sarrus.distributed.map(robot, few, client, request="inverse-dynamics", want=want)
        for name in want:
            np.testing.assert_array_equal(bits(answer[name]), bits(expected[name]))
        there = client.run(kept)
    link = robot.links[-1]
    y = {"y": rows["y"][:2_100]}
    options = {"request": "kinematics", "want": ["frame_pose"], "frames": [link]}
    poses = sarrus.distributed.map(robot, y, client, rows_of_a_block=700, **options)
    expected = robot.query("kinematics", ["y"], ["frame_pose"], frames=[link])(**y)
    np.testing.assert_array_equal(bits(poses.frame_pose), bits(expected.frame_pose))
    assert client.run(kept) == there and all(robot.fingerprint in one for one in there.values())
    # other constants are another robot
    moon = sarrus.Robot.bundled(robot.name, gravity=(0, 0, -1.62))
    light = sarrus.distributed.map(moon, few, client, want=["C_y"])
    np.testing.assert_array_equal(
        bits(light.C_y), bits(moon.query("inverse-dynamics", list(few), ["C_y"])(**few).C_y)
    )
    # of many queries a worker keeps the last ones: one of two gets more than half of these
    few = {"y": rows["y"][:1]}
    pairs = itertools.combinations(robot.links, 2)
    for pair in itertools.islice(pairs, 2 * sarrus.distributed.QUERIES + 1):
        options["frames"] = list(pair)
        sarrus.distributed.map(robot, few, client, **options)
    counts = [max(counts) for counts in client.run(queries).values()]
    assert max(counts) == sarrus.distributed.QUERIES, counts
    empty = {name: rows[name][:0] for name in ("y", "yd")}
    assert sarrus.distributed.map(robot, empty, client).tau_y.shape[0] == 0


def faults(client, robot, rows):
    """Invalid calls are refused here, and errors of a worker are raised here."""
    ask = sarrus.distributed.map
    raises(sarrus.QueryError, "nonsense", ask, robot, {"y": rows["y"], "nonsense": [[1.0]]}, client)
    raises(ValueError, "expected rows of states", ask, robot, {"y": [0.1, 0.2]}, client)
    raises(ValueError, "equally many rows", ask, robot, {**rows, "yd": rows["yd"][1:]}, client)
    raises(ValueError, "`y` has the shape", ask, robot, {**rows, "y": np.zeros((ROWS, 3))}, client)
    raises(TypeError, "real numbers", ask, robot, {**rows, "y": rows["y"] * 1j}, client)
    masked = np.ma.masked_greater(rows["y"], 0.1)
    raises(ValueError, "`y` has masked elements", ask, robot, {**rows, "y": masked}, client)
    raises(ValueError, "`rows_of_a_block` is 0", ask, robot, rows, client, rows_of_a_block=0)
    raises(TypeError, "expected a `dask.distributed.Client`", ask, robot, rows, "tcp://there")
    # changed files make another robot, which a worker must not mistake for this one
    with tempfile.TemporaryDirectory() as folder:
        urdf, submechanisms, _ = robot.origin.contents()
        paths = Path(folder, "robot.urdf"), Path(folder, "robot.yml")
        paths[0].write_bytes(urdf)
        paths[1].write_bytes(submechanisms)
        changed = sarrus.Robot.load(*paths, gravity=(0, 0, -1))
        paths[0].write_bytes(urdf.replace(b'mass value="', b'mass value="1'))
        raises(sarrus.LoadError, f"expected {changed.fingerprint:016x}", ask, changed, rows, client)
    # another version of sarrus may have other bits
    client.run(call_yourself, "0.0.1")
    raises(sarrus.Error, "this worker has sarrus 0.0.1", ask, robot, rows, client)
    client.run(call_yourself, sarrus.__version__)


def ended(client, robot, rows):
    """An exception of `progress` ends the map, and blocks that have not begun are withdrawn."""

    def stop(done, total):
        raise TimeoutError(f"{done} of {total}")

    try:
        sarrus.distributed.map(robot, rows, client, rows_of_a_block=BLOCK, progress=stop)
    except TimeoutError as error:
        assert str(error) == f"{BLOCK} of {ROWS}", error
    else:
        raise AssertionError("it went on")
    # blocks in progress run to their end
    while client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)):
        time.sleep(0.05)


def late():
    """Without a worker the map waits, and a later one computes all rows."""
    robot = sarrus.Robot.bundled("lambda")
    rows = {"y": np.full((3_000, 1), 0.1)}
    cluster = LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None)
    with cluster, Client(cluster) as client:
        raises(TimeoutError, "", sarrus.distributed.map, robot, rows, client, timeout=0.1)
        timer = threading.Timer(0.5, lambda: cluster.scale(1))
        timer.start()
        answer = sarrus.distributed.map(robot, rows, client, want=["tau_u"])
        timer.join()
    expected = robot.query("inverse-dynamics", ["y"], ["tau_u"])(**rows)
    np.testing.assert_array_equal(bits(answer.tau_u), bits(expected.tau_u))


def main():
    late()
    robot = sarrus.Robot.bundled("rh5v2_upper_body")
    rows = motions(robot, ROWS)
    expected = robot.query("inverse-dynamics", list(rows), ["tau_u"])(**rows)
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, Client(cluster) as client:
        killed(client, robot, rows, expected)
        whole(client, robot, rows)
        faults(client, robot, rows)
        ended(client, robot, rows)


if __name__ == "__main__":
    main()
