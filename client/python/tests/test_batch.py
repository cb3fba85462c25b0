"""Rows of states: the bits of single answers, threads, statuses, signals, and processes."""

import _thread
import multiprocessing
import os
import signal
import threading
import time
import unittest
import warnings

import numpy as np
import sarrus

ROBOTS = ("lambda", "torso", "stewart", "rh5v2_upper_body", "rh5v2_full")


def bits(array):
    """The bits of numbers, which NaN has too."""
    return np.ascontiguousarray(array).view(np.uint64)


# random motions exceed some limits
warnings.filterwarnings("ignore", ".*limits_exceeded", sarrus.StateWarning)


def motions(robot, rows):
    """Random states near the zero pose."""
    random = np.random.default_rng(3)
    return 0.1 * random.standard_normal((3, rows, len(robot.independents)))


def forked_answer(robot, motion):
    """What a worker of a pool does with a robot."""
    return robot.inverse_dynamics(*motion)


def fork():
    """As `os.fork`; later Pythons warn of threads, of which numpy has some."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


class Batches(unittest.TestCase):
    def setUp(self):
        # whatever was started in the background of a shell ignores it
        self.addCleanup(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
        signal.signal(signal.SIGINT, signal.default_int_handler)

    def test_rows_have_the_bits_of_single_answers_on_any_number_of_threads(self):
        for name in ROBOTS:
            robot = sarrus.Robot.bundled(name)
            y, yd, ydd = motions(robot, 600)
            tau_u = robot.inverse_dynamics(y, yd, ydd)
            back = robot.forward_dynamics(y, yd, tau_u)
            for k in range(0, 600, 7):
                single = robot.inverse_dynamics(y[k], yd[k], ydd[k])
                np.testing.assert_array_equal(bits(tau_u[k]), bits(single))
                single = robot.forward_dynamics(y[k], yd[k], tau_u[k])
                np.testing.assert_array_equal(bits(back[k]), bits(single))
            for threads in (1, 2, 5):
                other = robot.inverse_dynamics(y, yd, ydd, threads=threads)
                np.testing.assert_array_equal(bits(other), bits(tau_u))

    def test_every_question_takes_rows(self):
        robot = sarrus.Robot.bundled("rh5v2_upper_body")
        y, yd, ydd = motions(robot, 5)
        link = robot.links[-1]
        whole = [
            robot.state(y, yd, ydd),
            robot.frames([link], y, yd, ydd),
            [robot.jacobian(link, y), robot.mass_matrix(y), robot.bias_force(y, yd)],
            robot.to_actuators(y, yd, ydd, tau_y=yd, stiffness=np.ones(len(robot.independents))),
        ]
        for k in range(5):
            single = [
                robot.state(y[k], yd[k], ydd[k]),
                robot.frames([link], y[k], yd[k], ydd[k]),
                [
                    robot.jacobian(link, y[k]),
                    robot.mass_matrix(y[k]),
                    robot.bias_force(y[k], yd[k]),
                ],
                robot.to_actuators(y[k], yd[k], ydd[k], tau_y=yd[k]),
            ]
            for rows, one in zip(whole[:3], single[:3], strict=True):
                for field, other in zip(rows, one, strict=True):
                    np.testing.assert_array_equal(bits(field[k]), bits(other))
            for field, other in zip(whole[3][:4], single[3][:4], strict=True):
                np.testing.assert_array_equal(bits(field[k]), bits(other))
        gains = whole[3].stiffness
        self.assertEqual(gains.shape, (5, len(robot.actuators), len(robot.actuators)))

    def test_no_rows_are_no_answers(self):
        robot = sarrus.Robot.bundled("torso")
        empty = np.zeros((0, 2))
        self.assertEqual(robot.inverse_dynamics(empty, empty, empty).shape, (0, 2))
        self.assertEqual(robot.mass_matrix(empty).shape, (0, 2, 2))

    def test_rows_without_an_answer_are_nan_and_leave_the_others_alone(self):
        robot = sarrus.Robot.bundled("torso")
        y, yd, ydd = motions(robot, 700)
        good = robot.inverse_dynamics(y, yd, ydd)
        y[[3, 500]] = np.nan
        tau_u, statuses = robot.inverse_dynamics(y, yd, ydd, return_status=True)
        self.assertEqual(statuses.dtype, np.uint32)
        failed = np.flatnonzero(statuses)
        np.testing.assert_array_equal(failed, [3, 500])
        self.assertTrue((statuses[failed] == sarrus.Status.non_finite_input).all())
        self.assertTrue(np.isnan(tau_u[failed]).all())
        rest = np.flatnonzero(statuses == 0)
        np.testing.assert_array_equal(bits(tau_u[rest]), bits(good[rest]))
        words = "2 of 700 states have no answer and are NaN, the first in row 3: non_finite_input"
        with self.assertWarnsRegex(sarrus.StateWarning, words):
            robot.inverse_dynamics(y, yd, ydd)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            answer = robot.query("map", ["y"], ["u"])(y=y)
        np.testing.assert_array_equal(np.flatnonzero(answer.status), [3, 500])

    def test_out_is_written_in_place_and_shares_no_memory_with_what_is_read(self):
        robot = sarrus.Robot.bundled("torso")
        y, yd, ydd = motions(robot, 50)
        out = np.zeros((50, 2))
        self.assertIs(robot.inverse_dynamics(y, yd, ydd, out=out), out)
        np.testing.assert_array_equal(out, robot.inverse_dynamics(y, yd, ydd))
        with self.assertRaisesRegex(ValueError, "shares memory with an input"):
            robot.inverse_dynamics(y, yd, ydd, out=y)

    def test_progress_is_given_and_may_end_it(self):
        robot = sarrus.Robot.bundled("rh5v2_full")
        given = motions(robot, 20_000)
        seen = []
        robot.inverse_dynamics(*given, progress=lambda *state: seen.append(state))
        self.assertEqual(seen[-1], (20_000, 20_000))
        self.assertEqual(seen, sorted(seen))

        def stop(done, total):
            raise TimeoutError(f"{done} of {total}")

        with self.assertRaisesRegex(TimeoutError, "of 20000"):
            robot.inverse_dynamics(*given, progress=stop)

    def test_other_threads_run_meanwhile_and_a_signal_ends_a_batch(self):
        robot = sarrus.Robot.bundled("rh5v2_full")
        few = motions(robot, 1)
        given = np.zeros((3, 300_000, len(robot.independents)))
        started, sent, ticks = threading.Event(), threading.Event(), []

        def interrupt():
            started.wait()
            for _ in range(5):
                time.sleep(0.02)
                ticks.append(robot.inverse_dynamics(*few[:, 0]))
            _thread.interrupt_main()
            sent.set()

        thread = threading.Thread(target=interrupt)
        thread.start()
        progress = []

        def note(done, total):
            started.set()
            progress.append(done)
            if done > total // 2:
                sent.wait()

        with self.assertRaises(KeyboardInterrupt):
            robot.inverse_dynamics(*given, threads=1, progress=note)
        thread.join()
        self.assertEqual(len(ticks), 5)
        self.assertLess(progress[-1], given.shape[1])

    def test_a_signal_ends_a_simulation_whose_progress_is_given(self):
        robot = sarrus.Robot.bundled("lambda")
        started, seen = threading.Event(), []

        def interrupt():
            started.wait()
            _thread.interrupt_main()

        def note(reached, duration):
            seen.append(reached)
            self.assertEqual(duration, 1e4)
            started.set()

        thread = threading.Thread(target=interrupt)
        thread.start()
        with self.assertRaises(KeyboardInterrupt):
            robot.simulate(1e4, [0.3], method="rk4", step=1e-3, every=1.0, progress=note)
        thread.join()
        self.assertEqual(seen, sorted(seen))
        self.assertLess(seen[-1], 1e4)

    def test_memory_that_is_shared_by_other_ways_is_refused(self):
        robot = sarrus.Robot.bundled("torso")
        n, m = 6, len(robot.independents)
        memory = bytearray(8 * m * (n + 1))
        y = np.frombuffer(memory, float, m * n).reshape(n, m)
        out = np.frombuffer(memory, float, m * n, 8 * m).reshape(n, m)
        with self.assertRaisesRegex(ValueError, "shares memory"):
            robot.inverse_dynamics(y, y.copy(), y.copy(), out=out)

    def test_what_a_batch_is_writing_is_neither_read_nor_written_by_others(self):
        robot = sarrus.Robot.bundled("rh5v2_full")
        n = len(robot.independents)
        given, out, state = np.zeros((3, 100_000, n)), np.zeros((100_000, n)), np.zeros(n)
        begun, asked, faults = threading.Event(), threading.Event(), []

        def ask():
            begun.wait()
            for words, arguments in (
                ("`y` is being written by a batch", {"y": out[0]}),
                ("`y` is being written by a batch", {"y": out}),
                ("cannot be written", {"y": state, "out": out[0]}),
            ):
                rest = np.zeros_like(arguments["y"])
                try:
                    robot.inverse_dynamics(yd=rest, ydd=rest, **arguments)
                except ValueError as error:
                    if words not in str(error):
                        faults.append(error)
                else:
                    faults.append(arguments)
            asked.set()

        thread = threading.Thread(target=ask)
        thread.start()

        def wait(done, total):
            begun.set()
            self.assertTrue(done < total or asked.is_set())
            asked.wait(60)

        robot.inverse_dynamics(*given, out=out, threads=1, progress=wait)
        thread.join()
        self.assertEqual(faults, [])
        # and are as ever once it is done
        robot.inverse_dynamics(out[0] * 0, state, state, out=out[1])

    def test_rows_without_an_answer_are_said_by_every_method(self):
        robot = sarrus.Robot.bundled("torso")
        y = np.array([[0.1, 0.2], [np.nan, 0.0], [0.0, 0.1]])
        asked = [
            lambda: robot.mass_matrix(y),
            lambda: robot.bias_force(y),
            lambda: robot.state(y).q,
            lambda: robot.frames(robot.links[-1], y).pose,
            lambda: robot.jacobian(robot.links[-1], y),
            lambda: robot.to_actuators(y).u,
            lambda: robot.to_actuators(y, stiffness=[5.0, 5.0]).stiffness,
        ]
        for ask in asked:
            with self.assertWarnsRegex(sarrus.StateWarning, "1 of 3 .* row 1: non_finite_input"):
                found = ask()
            good = np.isfinite(found.reshape(3, -1)).all(axis=1)
            self.assertEqual(list(good), [True, False, True])

    def test_threads_share_a_robot(self):
        robot = sarrus.Robot.bundled("torso")
        given = motions(robot, 400)
        expected = robot.inverse_dynamics(*given)
        faults = []

        def work(k):
            for _ in range(20):
                if not np.array_equal(robot.inverse_dynamics(*given, threads=2), expected):
                    faults.append(k)
                single = robot.inverse_dynamics(*given[:, k])
                if not np.array_equal(single, expected[k]):
                    faults.append(k)

        threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(faults, [])


class Processes(unittest.TestCase):
    def test_a_robot_in_process_goes_on_after_a_fork(self):
        robot = sarrus.Robot.bundled("torso")
        given = motions(robot, 3000)
        expected = robot.inverse_dynamics(*given, threads=2)
        child = fork()
        if child == 0:
            same = False
            try:
                same = np.array_equal(robot.inverse_dynamics(*given, threads=2), expected)
            finally:
                os._exit(0 if same else 1)
        self.assertEqual(os.waitpid(child, 0)[1], 0)

    def test_arrays_of_a_batch_that_a_fork_cuts_off_are_usable_in_the_child(self):
        robot = sarrus.Robot.bundled("rh5v2_full")
        n = len(robot.independents)
        given, out = np.zeros((3, 100_000, n)), np.zeros((100_000, n))
        begun, forked, seen = threading.Event(), threading.Event(), []

        def wait(done, total):
            begun.set()
            forked.wait(60)
            seen.append((done, total))

        def batch():
            robot.inverse_dynamics(*given, out=out, threads=1, progress=wait)

        thread = threading.Thread(target=batch)
        thread.start()
        begun.wait()
        child = fork()
        if child == 0:
            same = False
            try:
                signal.alarm(60)
                rest, zero = np.zeros((2, n)), np.zeros(n)
                single = robot.inverse_dynamics(zero, zero, zero)
                out[:8] = 0
                # written as rows, as one state, and read
                robot.inverse_dynamics(rest, rest, rest, out=out[:2])
                robot.inverse_dynamics(zero, zero, zero, out=out[2])
                robot.inverse_dynamics(out[6:8], rest, rest, out=out[3:5])
                same = all(np.array_equal(row, single) for row in out[:5])
            finally:
                os._exit(0 if same else 1)
        forked.set()
        self.assertEqual(os.waitpid(child, 0)[1], 0)
        thread.join()
        self.assertEqual(seen[-1], (100_000, 100_000))

    def test_workers_of_a_pool_get_robots_by_their_files(self):
        robot = sarrus.Robot.bundled("torso")
        given = motions(robot, 4)
        with multiprocessing.get_context("spawn").Pool(2) as pool:
            tasks = [(robot, given[:, k]) for k in range(4)]
            found = pool.starmap(forked_answer, tasks)
        np.testing.assert_array_equal(np.array(found), robot.inverse_dynamics(*given))


if __name__ == "__main__":
    unittest.main()
