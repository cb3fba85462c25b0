"""`python -m sarrus.can` as its users meet it.

What they get wrong is reported in one line, with an exit code, and never as a traceback.
"""

import contextlib
import io
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import can
from lateness import slowness
from sarrus.can.__main__ import main

TWO = "- {name: two, interface: virtual, channel: sarrus-two}"
MOTORS = f"""
rate_hz: 250
buses:
- {{name: one, interface: virtual, channel: sarrus-one}}
{TWO}
motors:
"""
MOTOR = """
- actuator: motor{id}
  bus: {bus}
  drive: {{protocol: mit, variant: damiao, id: {id}, reply_id: {reply}, position_range: 12.5,
    velocity_range: 30, torque_range: 10,
    stiffness_range: 500, damping_range: 5}}
  offset: 0
  limits: {{effort: 2, velocity: 5, position: [-3, 3]}}
  damping: 0.1
  watchdog_ms: 100
"""
MOVE = ("--distance", "0.1", "--stiffness", "1", "--damping", "1")
SHORT = ("--seconds", "0.02")


class Commands(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        motors = [
            MOTOR.format(id=i + 1, reply=i + 17, bus=bus) for i, bus in enumerate(("one", "two"))
        ]
        self.config = self.file("robot.yml", MOTORS + "".join(motors))
        self.alone = self.file("alone.yml", MOTORS.replace(TWO, "") + motors[0])

    def file(self, name, text):
        path = self.folder / name
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        return str(path)

    def can(self, *arguments):
        """Exit code, stdout and stderr; any other exception is a failure."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                code = main([str(argument) for argument in arguments])
            except SystemExit as end:
                code = end.code
        return code, out.getvalue(), err.getvalue()

    def refused(self, code, word, *arguments):
        with self.subTest(arguments=arguments):
            ended, _, err = self.can(*arguments)
            self.assertEqual(ended, code, err)
            self.assertIn(word, err)
            # usage, if it is shown, and one line that says what is wrong
            lines = [line for line in err.splitlines() if not line.startswith(("usage:", " "))]
            self.assertEqual(len(lines), 1, err)

    def test_every_command_has_its_help(self):
        code, out, _ = self.can("--help")
        self.assertEqual(code, 0)
        for command in ("run", "record", "replay", "scan", "read", "zero", "direction", "set-id"):
            self.assertIn(command, out)
            code, of_command, _ = self.can(command, "--help")
            self.assertEqual(code, 0)
            self.assertTrue(of_command.startswith(f"usage: python -m sarrus.can {command} "))

    def test_flags_that_cannot_be_meant_are_2(self):
        self.refused(2, "COMMAND")
        self.refused(2, "dance", "dance")
        for seconds, word in (
            ("0", "not greater"),
            ("nan", "not finite"),
            ("soon", "no number"),
            ("-1", "not greater"),
        ):
            self.refused(2, word, "run", self.config, "--seconds", seconds)
        self.refused(2, "--stiffness", "direction", self.config, "motor1", "--distance", "1")
        self.refused(
            2, "no distance", "direction", self.config, "motor1", "--distance", "0", *MOVE[2:]
        )
        self.refused(2, "--interface", "run", self.config, "--interface", "")
        for command, more in (
            ("scan", ()),
            ("read", ()),
            ("zero", ("--yes",)),
            ("direction", (*MOVE, "--yes")),
        ):
            self.refused(2, "motor1, motor2", command, self.config, "elbow", *more)
        for name in ("", "a/b", "x" * 65):
            self.refused(2, "is no name", "run", self.config, "--name", name, *SHORT)

    def test_channels_are_for_buses_that_there_are_one_each(self):
        for command in (
            ("run", *SHORT),
            ("scan", *SHORT),
            ("record", "--out", str(self.folder / "x.log"), *SHORT),
        ):
            command, *more = command
            for channel in ("three=x", "x", "one", "one=", ""):
                self.refused(
                    2,
                    "one of the buses one, two",
                    command,
                    self.config,
                    *more,
                    "--channel",
                    channel,
                )
            self.refused(
                2,
                "already",
                command,
                self.config,
                *more,
                "--channel",
                "one=x",
                "--channel",
                "one=y",
            )
        self.refused(2, "did you mean `two`?", "scan", self.config, "--channel", "tow=x")
        # one is meant without its name where there is only one
        self.refused(
            2,
            "/nothing/port",
            "scan",
            self.alone,
            "--interface",
            "slcan",
            "--channel",
            "/nothing/port",
        )
        self.refused(2, "already", "scan", self.alone, "--channel", "x", "--channel", "y")
        self.refused(
            2,
            "/nothing/left",
            "scan",
            self.config,
            "--interface",
            "slcan",
            "--channel",
            "one=/nothing/left",
        )

    def test_files_that_cannot_be_opened_are_2_and_faulty_ones_1(self):
        commands = {
            "run": SHORT,
            "record": ("--out", "x.log"),
            "replay": ("log",),
            "scan": (),
            "zero": ("motor1",),
            "direction": ("motor1", *MOVE),
        }
        for command, more in commands.items():
            self.refused(2, "/nothing/robot.yml", command, "/nothing/robot.yml", *more)
            self.refused(1, "not UTF-8", command, self.file("bytes.yml", "\udcff\udcfe\0"), *more)
            self.refused(2, "directory", command, self.folder, *more)
        self.refused(2, "/nothing/log", "replay", self.config, "/nothing/log")
        self.refused(
            2,
            "/nothing/x.log",
            "run",
            self.config,
            "--no-realtime",
            "--record",
            "/nothing/x.log",
            *SHORT,
        )
        self.refused(2, "/nothing/x.log", "record", self.config, "--out", "/nothing/x.log", *SHORT)
        for command, flag in (("run", "--record"), ("record", "--out")):
            self.refused(
                2, ".blf, .asc, .log", command, self.config, flag, self.folder / "x.csv", *SHORT
            )

    def test_a_recording_stays_when_its_buses_cannot_be_opened(self):
        earlier = self.file("earlier.log", "of before")
        elsewhere = ("--interface", "slcan", "--channel", "one=/nothing/port")
        for command, flag in (("run", "--record"), ("record", "--out")):
            self.refused(
                2, "/nothing/port", command, self.config, flag, earlier, *elsewhere, *SHORT
            )
        self.assertEqual(Path(earlier).read_text(), "of before")

    def test_interfaces_that_are_not_there_are_2_whatever_their_drivers_say(self):
        def refused(interface, word):
            self.refused(
                2,
                f"one: {interface} nothing0 {word}",
                "scan",
                self.alone,
                "--interface",
                interface,
                "--channel",
                "nothing0",
            )

        for interface in ("nonsense", "pcan", "kvaser", "serial", "robotell", "seeedstudio"):
            refused(interface, "cannot be opened: ")
        for error in (
            NameError("name is\nnot defined"),
            AttributeError(),
            RuntimeError("no\tdriver"),
            can.CanInitializationError("no device", -3),
        ):
            with mock.patch("can.Bus", side_effect=error):
                refused(
                    "usb2can",
                    f"cannot be opened: {' '.join(str(error).split()) or type(error).__name__}",
                )

    def test_lines_of_a_log_that_are_none_are_1_with_their_file_and_number(self):
        for line in (
            "5",
            "[" * 100_000,
            '{"t": 1e400, "cycle": 1}',
            '{"t": -1, "cycle": 1}',
            '{"t": 99999999999999999999999, "cycle": 1}',
            '{"t": 1, "event": "dropped", "bus": "one", "count": 99999999999}',
            '{"t": 1, "frame": "123#00", "bus": ["one"]}',
        ):
            log = self.file("log.jsonl", '{"t": 0, "cycle": true}\n' + line)
            self.refused(1, f"{log}:2:1: ", "replay", self.config, log)
        log = self.file("bytes.jsonl", "\udcff\udcfe")
        self.refused(2, f"cannot read {log}", "replay", self.config, log)

    def test_motors_that_do_not_answer_are_1(self):
        code, out, err = self.can("scan", self.config, *SHORT)
        self.assertEqual((code, out.count("no answer"), err), (1, 2, ""))
        for command, more in (
            ("read", ()),
            ("zero", ("--yes",)),
            ("zero", ("--at", "1")),
            ("direction", (*MOVE, "--yes")),
        ):
            self.refused(1, "does not answer", command, self.config, "motor1", *more)

    def process(self, *arguments, **streams):
        command = [sys.executable, "-m", "sarrus.can", *map(str, arguments)]
        return subprocess.Popen(
            command, env={**os.environ, "SARRUS_ROOT": str(self.folder / "domain")}, **streams
        )

    def test_whoever_reads_may_have_enough(self):
        log = self.file(
            "long.jsonl",
            "".join(
                f'{{"t": {time}, "cycle": true}}\n' for time in range(0, 8_000_000_000, 4_000_000)
            ),
        )
        process = self.process(
            "replay", self.config, log, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        self.assertIn(b" one 001#", process.stdout.readline())
        process.stdout.close()
        self.assertEqual((process.stderr.read(), process.wait(20 * slowness())), (b"", 0))
        process.stderr.close()

    def test_the_bridge_goes_on_when_nobody_reads_what_it_says(self):
        reader, writer = os.pipe()
        os.close(reader)
        recording = self.folder / "all.log"
        process = self.process(
            "run",
            self.config,
            "--no-realtime",
            "--seconds",
            str(0.5 * slowness()),
            "--record",
            recording,
            stdout=writer,
            stderr=writer,
        )
        os.close(writer)
        self.assertEqual(process.wait(20 * slowness()), 0)
        # it sent to both motors to the end
        self.assertGreater(recording.read_text().count("one 001#"), 5)


if __name__ == "__main__":
    unittest.main()
