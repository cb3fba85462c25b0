"""Every way out of a program that has power on motors."""

import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from lateness import slowness
from sarrus.can.leaving import IGNORED

SCRIPT = """
import os, signal, sys, time
from sarrus.can.leaving import Leave, at_the_end, ending
kind, log = sys.argv[1:]
def note(word):
    with open(log, "a") as file:
        file.write(word + "\\n")
def safe():
    # long enough for everything that comes meanwhile
    time.sleep(0.1)
    note("safe")
def many():
    # so that the interpreter sees all of them at once
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(os.getpid(), number)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
try:
    if kind == "loop":
        with ending() as stop, at_the_end(safe):
            print("ready", flush=True)
            while not stop:
                time.sleep(0.01)
    elif kind == "people":
        with ending(deferred=False) as stop:
            try:
                print("ready", flush=True)
                time.sleep(60)
            finally:
                safe()
    elif kind == "several":
        with ending(deferred=False) as stop:
            try:
                many()
                time.sleep(60)
            finally:
                safe()
    elif kind == "several under power":
        with ending(deferred=False) as stop:
            stop.defer()
            with at_the_end(safe):
                many()
                many()
                stop.check()
    elif kind == "exception":
        with at_the_end(safe):
            raise RuntimeError
    else:
        with at_the_end(safe):
            sys.exit(3)
except Leave as why:
    note(f"left: {why}")
"""


def ends(kind, *numbers):
    """Run the script and give its log."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        process = subprocess.Popen(
            [sys.executable, "-c", SCRIPT, kind, str(log)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        for place, number in enumerate(numbers):
            if place == 0:
                process.stdout.readline()
            process.send_signal(number)
        process.communicate(timeout=20 * slowness())
        return log.read_text() if log.exists() else f"nothing; exit code {process.returncode}"


class Ends(unittest.TestCase):
    def test_every_way_out_makes_it_safe_once(self):
        for kind in ("loop", "exception", "exit"):
            with self.subTest(kind=kind):
                self.assertEqual(
                    ends(kind, *([signal.SIGTERM] if kind == "loop" else [])), "safe\n"
                )

    def test_every_signal_that_would_end_or_stop_it_is_an_orderly_end(self):
        named = (
            "INT",
            "TERM",
            "HUP",
            "QUIT",
            "TSTP",
            "USR1",
            "USR2",
            "ALRM",
            "VTALRM",
            "PROF",
            "XCPU",
            "PWR",
            "IO",
        )
        for number in (
            *(getattr(signal, f"SIG{name}") for name in named),
            signal.SIGRTMIN,
            signal.SIGRTMAX,
        ):
            with self.subTest(signal=number):
                self.assertEqual(ends("loop", number), "safe\n")

    def test_signals_that_reads_and_writes_tell_anyway_change_nothing(self):
        self.assertEqual(ends("loop", *IGNORED, signal.SIGTERM), "safe\n")

    def test_who_waits_for_people_is_interrupted_at_once(self):
        for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTSTP):
            with self.subTest(signal=number):
                self.assertEqual(ends("people", number), f"safe\nleft: {number.name}\n")

    def test_several_signals_at_once_cannot_cut_short_what_makes_it_safe(self):
        for kind in ("several", "several under power"):
            with self.subTest(kind=kind):
                log = ends(kind)
                self.assertTrue(log.startswith("safe\nleft: SIG") and log.count("safe") == 1, log)

    def test_the_end_of_the_parent_is_noticed(self):
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "log"
            middle = (
                "import subprocess, sys; "
                "p = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE); p.stdout.readline()"
            )
            subprocess.run(
                [sys.executable, "-c", middle, sys.executable, "-c", SCRIPT, "loop", str(log)],
                check=True,
                timeout=20 * slowness(),
            )
            end = time.monotonic() + 10 * slowness()
            while not log.exists() and time.monotonic() < end:
                time.sleep(0.02)
            self.assertEqual(log.read_text(), "safe\n")


if __name__ == "__main__":
    unittest.main()
