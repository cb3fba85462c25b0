"""What a controller's command fills in, and what a bridge makes of it."""

import os
import tempfile
import time
import unittest
from pathlib import Path

from sarrus import Robot, _native
from sarrus.can import Controller

ROBOT = """
rate_hz: 250
buses:
- {name: one, interface: virtual, channel: sarrus-controller}
motors:
"""
MOTOR = """
- actuator: motor{id}
  bus: one
  drive: {{protocol: mit, variant: damiao, id: {id}, reply_id: {reply}, position_range: 12.5,
    velocity_range: 30, torque_range: 10, stiffness_range: 500, damping_range: 5}}
  offset: 0
  limits: {{effort: 2, velocity: 5, position: [-3, 3]}}
  damping: 0.1
  watchdog_ms: 100
"""


class Commands(unittest.TestCase):
    def setUp(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "robot.yml")
            path.write_text(ROBOT + "".join(MOTOR.format(id=i, reply=i + 16) for i in (1, 2)))
            configuration = _native.Configuration.load(path)
        self.fingerprint = configuration.fingerprint
        self.bridge = _native.Bridge(configuration)
        name = f"controller-{os.getpid()}"
        self.service = _native.Service(name)
        self.addCleanup(self.service.close)
        self.controller = Controller(name)
        self.addCleanup(self.controller.close)

    def state(self):
        """The bridge's state as the controller gets it."""
        self.assertTrue(self.service.publish(self.bridge))
        return self.controller.state()

    def taken(self):
        """The sequence of the newest command that the bridge has taken, and how many it took."""
        now = time.monotonic_ns()
        self.service.take(now, self.bridge)
        self.bridge.cycle(now)
        return self.state()["command"], self.bridge.counters()["accepted"]

    def test_sequence_stamp_fingerprint_and_zeros_are_filled_in(self):
        with self.assertRaisesRegex(ValueError, "fingerprint is not known before the first"):
            self.controller.command(position=[0.0, 0.0])
        self.assertEqual(self.state()["fingerprint"], self.fingerprint)
        for count in (1, 2, 3):
            self.assertTrue(self.controller.command(position=[0.1, 0.2]))
            self.assertEqual(self.taken(), (count, count))
        # a sequence that is given is counted on
        self.controller.command(sequence=10, effort=[0.0, 0.5])
        self.assertEqual(self.taken(), (10, 4))
        self.controller.command(damping=[1.0, 1.0])
        self.assertEqual(self.taken(), (11, 5))

    def test_a_bridge_with_a_robot_wants_the_fingerprint_of_the_commands_own(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "robot.yml")
            motor = MOTOR.format(id=1, reply=17).replace("motor1", "ElbowAct")
            path.write_text("robot: lambda\ncommissioning: none" + ROBOT + motor)
            bridge = _native.Bridge(_native.Configuration.load(path))
        for own, counted in (
            (Robot.bundled("lambda").fingerprint, "accepted"),
            (Robot.bundled("torso").fingerprint, "wrong_model"),
        ):
            name = f"controller-{os.getpid()}-{counted}"
            service = _native.Service(name)
            with_own = Controller(name, fingerprint=own)
            without = Controller(name, watch=True)
            service.publish(bridge)
            without.state()
            with self.assertRaisesRegex(ValueError, "give the `fingerprint` of the robot"):
                without.command(position=[0.0])
            with_own.command(position=[0.0])
            service.take(time.monotonic_ns(), bridge)
            self.assertEqual(bridge.counters()[counted], 1)
            for end in (with_own, without, service):
                end.close()

    def test_what_is_given_is_not_replaced(self):
        self.state()
        soon = time.monotonic_ns() + 60_000_000_000
        self.controller.command(stamp_ns=soon, position=[0.0, 0.0])
        self.controller.command(position=[0.0, 0.0], fingerprint=1)
        self.taken()
        # only the newest waits for the bridge
        self.assertEqual(self.bridge.counters()["wrong_model"], 1)
        self.controller.command(stamp_ns=soon, position=[0.0, 0.0])
        self.assertEqual(self.taken()[1], 0)
        self.assertEqual(self.bridge.counters()["ahead"], 1)

    def test_commands_that_mean_nothing_are_refused(self):
        self.state()
        with self.assertRaisesRegex(ValueError, "without any numbers"):
            self.controller.command()
        with self.assertRaisesRegex(ValueError, "a stiffness pulls to a position"):
            self.controller.command(stiffness=[1.0, 1.0])
        with self.assertRaises(ValueError):
            self.controller.command(position=[0.0, 0.0], effort=[0.0])


if __name__ == "__main__":
    unittest.main()
