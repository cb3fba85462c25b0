"""A log of a bridge as MCAP, opened again; a robot and the log in viser."""

import json
import sys
from pathlib import Path

from mcap.reader import make_reader
from sarrus import _native, show

folder = Path(sys.argv[1])
config = folder / "bridge.yml"
config.write_text(
    "rate_hz: 500\nbuses:\n- {name: x, channel: can0}\nmotors:\n"
    "- {actuator: ElbowAct, bus: x, drive: {protocol: cybergear, id: 1, position_range: 12.5},\n"
    "   offset: 0, limits: {position: [-9, 9], velocity: 5, effort: 1}, watchdog_ms: 50}\n"
)
lines = []
for k in range(500):
    t = 2_000_000 * (k + 1)
    command = {"sequence": k + 1, "stamp_ns": t, "position": [1e-5 * k]}
    lines += [{"t": t, "command": command}, {"t": t, "cycle": True}]
    if k == 100:
        lines.insert(-1, {"t": t, "operate": "arm"})
    if k == 300:
        lines.insert(-1, {"t": t, "event": "bus_off", "bus": "x"})
log = folder / "bridge.jsonl"
log.write_text("".join(json.dumps(line) + "\n" for line in lines))

out = folder / "bridge.mcap"
flags = ["--log", str(log), "--config", str(config)]
assert show.main([*flags, "--mcap", str(out)]) == 0
found = {}
with out.open("rb") as file:
    for schema, channel, message in make_reader(file).iter_messages():
        assert schema.encoding == "jsonschema" and channel.message_encoding == "json"
        found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
assert {topic: len(of) for topic, of in found.items()} == {
    "/measured": 500,
    "/commanded": 500,
    "/mechanisms": 500,
    "/faults": 1,
}
assert found["/commanded"][100][1] == {
    "name": ["ElbowAct"],
    "position": [1e-5 * 100],
    "velocity": [],
    "effort": [],
}
time, fault = found["/faults"][0]
assert time == 600_000_000 and fault == {"fault": "ElbowAct: bus_off"}, (time, fault)
assert found["/mechanisms"][-1][1] == {"states": ["fault"], "reasons": ["bus_off"]}

# y of the measured position, and the words of a mechanism that is not armed
lambda_ = show.Robot.bundled("lambda")
y = show.independent(lambda_, ["ElbowAct"], [0.01])
assert abs(lambda_.to_actuators(y).u[0] - 0.01) < 1e-12
bridge = _native.Bridge(_native.Configuration.load(str(config)))
bridge.cycle(1_000_000)
assert "ElbowAct" in show.state_text(["ElbowAct"], bridge.state())
assert show.main(["lambda", *flags, "--port", "0", "--seconds", "0.5"]) == 0
assert show.main(["lambda", "--port", "0", "--seconds", "0.5"]) == 0
