"""The time that processes may take grows with the lateness of the machine, measured here."""

import threading
import time
from pathlib import Path

LATE = 0.005
"""A sleep that wakes so late is as late as can be with nothing else at work `[s]`."""
SLOWEST = 40.0


def slowness() -> float:
    """How many times longer things take here than with nothing else at work, at least 1.

    By how late sleeps wake, and by how long a thread that works waits for a processor.
    """
    late = 0.0
    for _ in range(4):
        begin = time.monotonic()
        time.sleep(LATE)
        late = max(late, time.monotonic() - begin - LATE)
    shares = [1.0]

    def work() -> None:
        account = Path("/proc/thread-self/schedstat")
        begin = time.monotonic()
        while account.exists():
            run, wait = map(int, account.read_text().split()[:2])
            if run > 20e6 or time.monotonic() - begin > 1:
                shares.append((run + wait) / max(run, 1))
                return

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    return min(max(late / LATE, *shares), SLOWEST)
