"""Decodes our frames with moteus, canopen and cantools, and encodes frames of theirs.

JSON lines in, JSON lines out, one for one.
"""

import json
import sys

import canopen
import cantools
import moteus
from canopen.profiles.p402 import State402


def whole(message: str, length: int, signals: str) -> str:
    return f"BO_ 1 {message}: {length} Host\n{signals}"


def scaled(name: str, start: int, bits: int, low: float, high: float) -> str:
    """A Motorola signal from its highest bit, over a range with both ends."""
    factor = (high - low) / (2**bits - 1)
    return f' SG_ {name} : {start}|{bits}@0+ ({factor!r},{low!r}) [0|0] "" Motor\n'


HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: Host Motor\n'
MIT = cantools.database.load_string(
    HEAD
    + whole(
        "Command",
        8,
        scaled("position", 7, 16, -12.5, 12.5)
        + scaled("velocity", 23, 12, -45, 45)
        + scaled("stiffness", 27, 12, 0, 500)
        + scaled("damping", 47, 12, 0, 5)
        + scaled("torque", 51, 12, -18, 18),
    ),
    "dbc",
)
CYBERGEAR = cantools.database.load_string(
    HEAD
    + whole(
        "Command",
        8,
        scaled("position", 7, 16, -12.5, 12.5)
        + scaled("velocity", 23, 16, -30, 30)
        + scaled("stiffness", 39, 16, 0, 500)
        + scaled("damping", 55, 16, 0, 5),
    ),
    "dbc",
)
ODRIVE = cantools.database.load_string(
    HEAD
    + whole(
        "Command",
        8,
        ' SG_ position : 0|32@1- (1,0) [0|0] "" Motor\n'
        ' SG_ velocity : 32|16@1- (0.001,0) [0|0] "" Motor\n'
        ' SG_ torque : 48|16@1- (0.001,0) [0|0] "" Motor\n',
    )
    + "SIG_VALTYPE_ 1 position : 1;\n",
    "dbc",
)


def mit(data: bytes) -> dict:
    return MIT.decode_message(1, data)


def cybergear(data: bytes) -> dict:
    return CYBERGEAR.decode_message(1, data)


def odrive(data: bytes) -> dict:
    return ODRIVE.decode_message(1, data)


def moteus_reply(request: dict) -> dict:
    """The registers of a reply, scaled by the client."""
    parsed = moteus.parse_registers(bytes.fromhex(request["data"]))
    return {str(int(register)): value for register, value in parsed.response.items()}


def moteus_command(data: bytes) -> dict:
    """The registers that a command of ours writes, scaled by the client."""
    parsed = moteus.parse_registers(data)
    assert not parsed.errors, parsed.errors
    return {str(int(register)): value for register, value in parsed.command.items()}


def state402(request: dict) -> dict:
    """The state that canopen sees in a status word."""
    word = request["word"]
    for state, (mask, bits) in State402.SW_MASK.items():
        if word & mask == bits:
            return {"state": state}
    return {"state": ""}


def control402(_request: dict) -> dict:
    table = State402.TRANSITIONTABLE
    return {"commands": {state: command for (_, state), command in table.items()}}


def sdo(request: dict) -> dict:
    """An expedited download as canopen's server takes it into a dictionary."""
    dictionary = canopen.ObjectDictionary()
    variable = canopen.objectdictionary.ODVariable("thing", request["index"], request["sub"])
    variable.data_type = {1: 0x05, 2: 0x06, 4: 0x07}[request["bytes"]]
    if request["sub"] == 0:
        dictionary.add_object(variable)
    else:
        record = canopen.objectdictionary.ODRecord("things", request["index"])
        record.add_member(variable)
        dictionary.add_object(record)
    # a node makes its PDOs of the whole dictionary: here it has one object
    node = canopen.LocalNode(5, canopen.ObjectDictionary())
    node.object_dictionary = node.sdo.od = dictionary
    sent = []

    class Network:
        def send_message(self, can_id, data, remote=False):
            sent.append((can_id, bytes(data)))

    node.sdo.network = Network()
    node.sdo.on_request(0x605, bytearray.fromhex(request["data"]), 0.0)
    entry = node.sdo[request["index"]]
    value = entry.raw if request["sub"] == 0 else entry[request["sub"]].raw
    return {"value": value, "answer": sent[0][1].hex(), "id": sent[0][0]}


def dbc(request: dict) -> dict:
    """Values of a DBC file's message in bytes, by cantools."""
    database = cantools.database.load_string(request["file"], "dbc")
    return {"values": database.decode_message(request["id"], bytes.fromhex(request["data"]))}


DECODERS = {"mit": mit, "cybergear": cybergear, "odrive": odrive, "moteus": moteus_command}
QUESTIONS = {
    "moteus_reply": moteus_reply,
    "state402": state402,
    "control402": control402,
    "sdo": sdo,
    "dbc": dbc,
}


def main() -> None:
    for line in sys.stdin:
        request = json.loads(line)
        question = request["ask"]
        if question in DECODERS:
            answer = DECODERS[question](bytes.fromhex(request["data"]))
        else:
            answer = QUESTIONS[question](request)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
