"""Answers to states that come on stdin, one by one and as rows: all numbers as their bits."""

import json
import sys
import warnings

import numpy as np
import sarrus

# some states exceed limits
warnings.simplefilter("ignore", sarrus.StateWarning)

QUESTIONS = {
    "inverse_dynamics": ("y", "yd", "ydd"),
    "forward_dynamics": ("y", "yd", "tau_u"),
    "state": ("y", "yd", "ydd"),
    "to_actuators": ("y", "yd", "ydd"),
    "mass_matrix": ("y",),
    "bias_force": ("y", "yd"),
    "to_independent": ("u", "ud", "udd"),
}


def bits(answer, rows):
    """The bits of an answer's arrays, one after the other, state by state."""
    fields = answer if isinstance(answer, tuple) else (answer,)
    flat = [np.reshape(field, (rows, -1)) for field in fields if field is not None]
    return np.ascontiguousarray(np.hstack(flat)).view(np.uint64).tolist()


found = []
for asked in json.load(sys.stdin):
    robot = sarrus.Robot.bundled(asked["robot"])
    fields = {
        name: np.array([state[name] for state in asked["states"]], np.uint64).view(float)
        for name in asked["states"][0]
    }
    rows = len(asked["states"])
    answers = {}
    for question, given in QUESTIONS.items():
        ask = getattr(robot, question)
        arrays = [fields[name] for name in given]
        single = [bits(ask(*(array[k] for array in arrays)), 1)[0] for k in range(rows)]
        answers[question] = {"single": single, "rows": bits(ask(*arrays), rows)}
    found.append(answers)
print(json.dumps(found))
