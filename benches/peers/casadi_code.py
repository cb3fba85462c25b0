"""CasADi's C of Pinocchio's algorithms beside the code that sarrus generates: time and error.

    pip install ./client/python pin casadi numpy
    benches/peers/build.sh casadi_code
    cargo build --release -p sarrus-server
    python benches/peers/casadi_code.py --sarrus target/release/sarrus [--robots torso …]

The wheel of Pinocchio has no `pinocchio.casadi`, so a program of its headers writes the C:
`casadi_code.cpp` has the three functions. Both codes are compiled by cc, CasADi's with -O3
-march=native, ours by the flags of `sarrus generate`. Random states are within 0.25 of the zero
pose, 1/s and 5/s²; an error is the largest one of a state by the size of the answer, against the
plan of sarrus, which is exact to 1e-14. CasADi gets the closed q, q̇ and q̈, ours finds them from
y, ẏ and ÿ and checks the state. Times are medians of batches that take turns.
"""

import argparse
import ctypes
import importlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import pinocchio as pin
import sarrus

STATES, ROUNDS = 64, 200
FOLDER = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target")).absolute()
PROGRAM = FOLDER / "peers/casadi_code"
# one batch of each function: nanoseconds of a call; CasADi's functions and ours differ in form
DRIVER = r"""
#include <time.h>
static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * t.tv_sec + t.tv_nsec;
}
typedef int (*casadi)(const double **, double **, long long *, double *, int);
typedef int (*ours)(const double *, double *);
double batch(void *f, int is_casadi, const double *in, int n, double *out, int m, int states,
    int passes, double *w, long long *iw) {
    const double start = now();
    for (int p = 0; p < passes; p++)
        for (int k = 0; k < states; k++) {
            const double *arg[8] = {in + k * n};
            double *res[8] = {out + k * m};
            if (is_casadi) ((casadi)f)(arg, res, iw, w, 0);
            else ((ours)f)(arg[0], res[0]);
        }
    return (now() - start) / passes / states;
}
"""
QUESTIONS = {
    "inverse": ("inverse-dynamics", ["y", "yd", "ydd"], "tau_u"),
    "forward": ("forward-dynamics", ["y", "yd", "tau_u"], "ydd"),
}


def spoken(model, loops, gravity, active, robot):
    """The robot as the program reads it; a loop holds the directions that sarrus names."""
    text = [*gravity, model.njoints - 1]

    def add(*arrays):
        for array in arrays:
            text.extend(np.asarray(array, float).ravel())

    for j in range(1, model.njoints):
        name = model.joints[j].shortname()
        axes = dict(zip("XYZ", np.eye(3), strict=True))
        axis = axes[name[-1]] if name[-1] in axes else model.joints[j].extract().axis
        text += [model.parents[j], "R" if "JointModelR" in name else "P"]
        at, body = model.jointPlacements[j], model.inertias[j]
        add(axis, at.rotation, at.translation, body.mass, body.lever)
        add(body.inertia[np.triu_indices(3)])
    text += [len(active), *(model.getJointId(name) for name in active), len(loops)]
    for loop in loops:
        for joint, at in (
            (loop.joint1_id, loop.joint1_placement),
            (loop.joint2_id, loop.joint2_placement),
        ):
            text.append(joint)
            add(at.rotation, at.translation)
        rows = [row.split("/")[-1] for row in robot.loops if row.split("/")[0] == loop.name]
        text.append(len(rows))
        add(*(np.eye(3)["xyz".index(row)] for row in rows))
    return " ".join(map(str, text))


def compiled(source, name, flags):
    """A shared object of C text or of a file."""
    if isinstance(source, str):
        source = pathlib.Path(name).with_suffix(".c").write_text(source) and name + ".c"
    out = str(pathlib.Path(name).with_suffix(".so").absolute())
    subprocess.run(["cc", *flags, "-shared", "-fPIC", str(source), "-o", out, "-lm"], check=True)
    return ctypes.CDLL(out)


class Function:
    """A function of one of the two forms on some states."""

    def __init__(self, library, name, is_casadi, rows, n_out):
        self.call, self.is_casadi = getattr(library, name), is_casadi
        self.rows = np.ascontiguousarray(rows)
        self.out = np.zeros((len(rows), n_out))
        sizes = [ctypes.c_longlong() for _ in range(4)]
        if is_casadi:
            getattr(library, name + "_work")(*map(ctypes.byref, sizes))
        self.iw = np.zeros(sizes[2].value + 1, np.int64)
        self.w = np.zeros(sizes[3].value + 1)
        self.ns = []

    def batch(self, driver, passes):
        pointer = [x.ctypes.data_as(ctypes.c_void_p) for x in (self.rows, self.out)]
        work = [x.ctypes.data_as(ctypes.c_void_p) for x in (self.w, self.iw)]
        counts = self.rows.shape[1], self.out.shape[1]
        given = (ctypes.cast(self.call, ctypes.c_void_p), int(self.is_casadi), pointer[0])
        shape = (counts[0], pointer[1], counts[1], len(self.rows), passes)
        return driver.batch(*given, *shape, *work)


def generated(arguments, robot, question):
    """Our code: its library, its name and its operations."""
    request, given, want = QUESTIONS[question]
    sizes = {"y": len(robot.independents), "tau_u": len(robot.actuators)}
    line = {name: [0.0] * sizes.get(name, sizes["y"]) for name in given}
    query = json.dumps({"request": request, **line, "want": [want]})
    words = [arguments.sarrus, "generate", "--robot", robot.name, "--query", query]
    text = subprocess.run(
        [*words, "--out", "."], check=True, capture_output=True, text=True
    ).stdout.split("\n")
    said = {row.split()[0]: row.split()[1] for row in text if len(row.split()) > 1}
    path = next(row.split()[1] for row in text if row.endswith(".so"))
    return ctypes.CDLL(str(pathlib.Path(path).absolute())), pathlib.Path(path).stem, said


def measure(arguments, name, driver):
    """The rows of a robot."""
    robot = sarrus.Robot.bundled(name)
    words = [arguments.sarrus, "export", "--robot", name, "--to", "pinocchio", "--out", "."]
    subprocess.run(words, check=True, capture_output=True)
    module = importlib.import_module(name)
    model, loops = module.load()
    places = [model.joints[model.getJointId(joint)].idx_v for joint in robot.joints]
    text = spoken(model, loops, module.GRAVITY, robot.actuators, robot)
    said = subprocess.run([PROGRAM], input=text, check=True, capture_output=True, text=True).stdout
    library = compiled(pathlib.Path("casadi_code.c"), f"casadi_{name}", ["-O3", "-march=native"])

    # states, exact answers, and the rows of each function
    draw = np.random.default_rng(1).uniform
    n, m = len(robot.independents), len(robot.actuators)
    y, yd, ydd = (size * draw(-1, 1, (STATES, n)) for size in (0.25, 1, 5))
    tau_u = 10 * draw(-1, 1, (STATES, m))
    state = robot.state(y, yd, ydd)
    tree = []
    for ours in (state.q, state.qd, state.qdd):
        tree.append(np.zeros_like(ours))
        tree[-1][:, places] = ours
    of_tree = [pin.rnea(model, model.createData(), *row) for row in zip(*tree, strict=True)]
    cases = {"rnea": (np.hstack(tree), np.array(of_tree), None)}
    exact = robot.inverse_dynamics(y, yd, ydd)
    cases["inverse"] = np.hstack(tree), exact, np.hstack((y, yd, ydd))
    exact = robot.forward_dynamics(y, yd, tau_u)
    cases["forward"] = np.hstack((*tree[:2], tau_u)), exact, np.hstack((y, yd, tau_u))
    independents = [places[robot.joints.place(joint)] for joint in robot.independents]
    functions = []
    for question, (rows, exact, of_ours) in cases.items():
        n_out = exact.shape[1] if question != "forward" else model.nv
        pick = independents if question == "forward" else slice(None)
        function = Function(library, question, True, rows, n_out)
        functions.append((question, "CasADi", function, exact, pick, "-"))
        if of_ours is not None:
            ours, symbol, found = generated(arguments, robot, question)
            function = Function(ours, symbol, False, of_ours, exact.shape[1])
            count = found.get("operations", "-")
            functions.append((question, "sarrus", function, exact, slice(None), count))
    for _ in range(ROUNDS):
        for _, _, function, *_ in functions:
            function.batch(driver, 1)
            function.ns.append(function.batch(driver, 4))
    print(f"{name}: {said.strip()}, load {os.getloadavg()[0]:.1f}")
    for question, engine, function, exact, pick, count in functions:
        size = np.maximum(np.abs(exact).max(axis=1), 1)
        error = (np.abs(function.out[:, pick] - exact).max(axis=1) / size).max()
        time = np.median(function.ns)
        print(f"| {name} | {question} | {engine} | {time:.0f} ns | {error:.0e} | {count} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sarrus", default="target/release/sarrus", help="the program")
    parser.add_argument("--robots", nargs="*", default=["torso", "rh5v2_upper_body"])
    arguments = parser.parse_args()
    if not PROGRAM.exists():
        print("CasADi: not run, benches/peers/build.sh casadi_code builds its program")
        return
    arguments.sarrus = str(pathlib.Path(arguments.sarrus).absolute())
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        sys.path.insert(0, folder)
        driver = compiled(DRIVER, "driver", ["-O2"])
        driver.batch.restype = ctypes.c_double
        for name in arguments.robots:
            measure(arguments, name, driver)


if __name__ == "__main__":
    main()
