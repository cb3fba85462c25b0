"""`sarrus.distributed` where dask is not: the rest, with a cluster, is a test of the workspace."""

import subprocess
import sys
import unittest
from unittest import mock

import sarrus
import sarrus.distributed


class WithoutDask(unittest.TestCase):
    def test_a_missing_dask_is_reported_with_what_to_install(self):
        robot = sarrus.Robot.bundled("lambda")
        rows = {"y": [[0.1]], "yd": [[0.0]], "ydd": [[0.0]]}
        with (
            mock.patch.dict(sys.modules, {"distributed": None}),
            self.assertRaisesRegex(ImportError, r"pip install 'sarrus\[distributed\]'"),
        ):
            sarrus.distributed.map(robot, rows, object())

    def test_importing_sarrus_and_its_distribution_imports_no_dask(self):
        script = (
            "import sys, sarrus.distributed; "
            "sys.exit(any(name in sys.modules for name in ('dask', 'distributed')))"
        )
        self.assertEqual(subprocess.run([sys.executable, "-c", script], check=False).returncode, 0)


if __name__ == "__main__":
    unittest.main()
