"""A controller of a test: commands one target at 250 Hz; lines on stdin make it misbehave.

`arm`, `disarm`, `reset` | `target NUMBER` (of all actuators, from their start positions) |
`nan PLACE`, `old`, `quiet`, `good`: commands with a NaN, old commands, no commands, valid ones
again | `state`: prints the bridge's newest state.
"""

import json
import math
import sys
import threading
import time

from sarrus.can import Controller


def clean(value):
    """JSON has no NaN."""
    if isinstance(value, list):
        return [clean(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def main():
    name, stiffness, damping = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
    controller = Controller(name)
    lines, lock = [], threading.Lock()

    def listen():
        for line in sys.stdin:
            with lock:
                lines.append(line.split())
        with lock:
            lines.append(["end"])

    threading.Thread(target=listen, daemon=True).start()
    state, start, sequence, target, mode, place = None, None, 0, 0.0, "good", 0
    wants_state = False
    deadline = time.monotonic()
    print("ready", flush=True)
    while True:
        deadline = max(deadline + 0.004, time.monotonic() - 0.004)
        time.sleep(max(0.0, deadline - time.monotonic()))
        fresh = controller.state()
        state = fresh or state
        with lock:
            todo, lines[:] = list(lines), []
        for order, *rest in todo:
            if order in ("arm", "disarm", "reset"):
                controller.operate(time.monotonic_ns(), order)
            elif order == "target":
                target = float(rest[0])
            elif order == "state":
                wants_state = True
            elif order == "end":
                return
            else:
                mode, place = order, int(rest[0]) if rest else 0
        if state is None:
            continue
        if start is None and all(math.isfinite(number) for number in state["position"]):
            start = state["position"]
        if wants_state and fresh:
            wants_state = False
            print(json.dumps({key: clean(value) for key, value in fresh.items()}), flush=True)
        if start is None or mode == "quiet":
            continue
        n = len(start)
        position = [place + target for place in start]
        if mode == "nan":
            position[place] = math.nan
        if mode != "old":
            sequence += 1
        stamp = time.monotonic_ns()
        zeros = [0.0] * n
        controller.command(
            sequence, stamp, state["fingerprint"], position, zeros, zeros, stiffness, damping
        )


main()
