"""Rows of states on the workers of dask.distributed.

Answers are pure functions of model and rows: any worker answers any block of rows with the robot's
files, and another worker answers a lost block again. Needs
`pip install 'sarrus[distributed]'` here and `sarrus` of the same version on every worker.
"""

from __future__ import annotations

import importlib
import pickle
import threading
import time
import uuid
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from sarrus import __version__, _native
from sarrus.errors import Error
from sarrus.query import Answer, Array, Progress, Query, RequestName
from sarrus.robot import Robot, restored

BLOCKS_OF_A_THREAD = 8
"""Blocks for each thread of the cluster: many finish together and lose little work."""
LEAST_ROWS, MOST_NUMBERS = 1024, 1 << 20
"""Least rows of a block, below which its transfer dominates, and most numbers."""
AHEAD = 3
"""Blocks under way for each thread, so that the next one is at hand."""
LOOK = 1.0
"""Time between two counts of the cluster's threads [s]."""
BLOCKS = 64
"""Least number of blocks, if there are rows enough, for workers that come later."""
ROBOTS, QUERIES = 8, 16
"""Robots that a worker keeps, and queries of each robot."""


def map(
    robot: Robot,
    rows: Mapping[str, npt.ArrayLike],
    client: Any,
    *,
    request: RequestName = "inverse-dynamics",
    want: Sequence[str] | None = None,
    rows_of_a_block: int | None = None,
    progress: Progress | None = None,
    timeout: float | None = None,
    **options: Any,
) -> Answer:
    """Answer rows of states on the workers of a `dask.distributed.Client`.

    `rows` has an array (n, …) for each given field, such as `y`, `yd` and `ydd`; `want` names the
    fields of the answer, by default the request's usual ones; `options` are those of `Robot.query`.
    The answer has rows in the given order, including `status` and `warnings`, with the bits of
    `robot.query(request, rows, want)(**rows)`.

    The robot travels as its files; each worker compiles it once, and raises a `LoadError` if its
    fingerprint differs. `progress` gets the number of finished rows and of all rows. An exception
    of `progress` or of a block, and Ctrl-C, end the call: blocks that no worker has begun are
    withdrawn. A lost worker costs only the time of its blocks, until one block has lost too many
    workers (`distributed.KilledWorker`). Without a worker the call waits for the first, at most
    `timeout` [s] if given (`TimeoutError`); later workers get blocks too.
    """
    if timeout is not None and not timeout >= 0:
        raise ValueError(f"`timeout` is {timeout}, expected seconds")
    if progress is not None and not callable(progress):
        raise TypeError(f"`progress` is {progress!r}, expected a function")
    dask = _dask()
    if not isinstance(client, dask.Client):
        raise TypeError(f"`client` is {client!r}, expected a `dask.distributed.Client`")
    if client.asynchronous:
        raise TypeError("`client` is asynchronous, expected one that waits for its answers")
    query = robot.query(request, list(rows), want, **options)
    given = _arrays(query, rows)
    n = len(given[0])
    answer = _empty(query, n)
    if n == 0:
        if progress is not None:
            progress(0, 0)
        return answer

    # the robot is also a task, whose recipe dask keeps: it survives the end of any worker
    key = f"sarrus-{robot.fingerprint:016x}-{uuid.uuid4().hex}"
    recipe = Recipe(robot.origin.contents(), robot.fingerprint, (request, [*rows], want, options))
    shared = client.submit(_passed_on, pickle.dumps(recipe), key=f"{key}-robot", pure=False)
    # after that task, which makes an adaptive cluster start a worker
    client.wait_for_workers(1, timeout=timeout)

    def submit(block: slice) -> Any:
        arrays = [array[block] for array in given]
        name = f"{key}-{block.start}"
        return client.submit(_answered, __version__, shared, *arrays, key=name, pure=False)

    threads = _threads(client)
    if rows_of_a_block is None:
        rows_of_a_block = _usual_rows(query, n, threads())
    blocks = _blocks(n, rows_of_a_block)
    under_way: dict[Any, slice] = {}
    ended = dask.as_completed(loop=client.loop)
    reached = 0

    def fill() -> None:
        nonlocal reached
        if threads() > reached:
            # blocks go to workers that have the robot: every worker gets it, even a late one
            client.replicate(shared)
            reached = threads()
        # only as many as the workers can take: the scheduler holds the rows of each
        while len(under_way) < AHEAD * threads() and (block := next(blocks, None)) is not None:
            future = submit(block)
            under_way[future] = block
            ended.add(future)

    try:
        fill()
        done = 0
        for future in ended:
            fields, status, warnings = future.result()
            block = under_way.pop(future)
            for name, field in zip(query.want, fields, strict=True):
                answer[name][block] = field
            answer.status[block], answer.warnings[block] = status, warnings
            future.release()
            done += block.stop - block.start
            fill()
            if progress is not None:
                progress(done, n)
    finally:
        for future in (*under_way, shared):
            future.release()
    return answer


class Recipe(NamedTuple):
    """A query for a worker: the robot's files and fingerprint, and the request."""

    files: tuple[bytes, bytes | None, _native.Parts]
    fingerprint: int
    query: tuple[RequestName, list[str], Sequence[str] | None, dict[str, Any]]


# --- on a worker ----------------------------------------------------------------------------------

_robots: OrderedDict[int, tuple[Robot, OrderedDict[str, Query]]] = OrderedDict()
_lock = threading.Lock()


def _passed_on(recipe: bytes) -> bytes:
    """Return the pickled recipe, as a result that workers pass on to each other."""
    return recipe


def _answered(version: str, recipe: bytes, *given: Array) -> tuple[list[Array], Any, Any]:
    """Answer a block: its fields, statuses and warnings."""
    # before the recipe is read: other versions may use other recipes
    if version != __version__:
        raise Error(
            f"this worker has sarrus {__version__}, and rows came from sarrus {version}; "
            "install the same version on both"
        )
    # one thread: dask runs one block per thread of a worker
    answer = _prepared(pickle.loads(recipe)).ask(given, threads=1)
    return list(answer.values()), answer.status, answer.warnings


def _prepared(recipe: Recipe) -> Query:
    """The query of a recipe; its robot is compiled once and cached."""
    with _lock:
        if recipe.fingerprint not in _robots:
            robot = restored(Robot, *recipe.files, recipe.fingerprint)
            _robots[recipe.fingerprint] = robot, OrderedDict()
        _robots.move_to_end(recipe.fingerprint)
        while len(_robots) > ROBOTS:
            _robots.popitem(last=False)
        robot, queries = _robots[recipe.fingerprint]
        key = repr(recipe.query)
        if key not in queries:
            request, given, want, options = recipe.query
            queries[key] = robot.query(request, given, want, **options)
        queries.move_to_end(key)
        while len(queries) > QUERIES:
            queries.popitem(last=False)
        return queries[key]


# --- within ---------------------------------------------------------------------------------------


def _dask() -> Any:
    """The package `distributed`, which only this module needs."""
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise ImportError(
            "`sarrus.distributed` needs dask: pip install 'sarrus[distributed]'"
        ) from error


def _arrays(query: Query, rows: Mapping[str, npt.ArrayLike]) -> list[Array]:
    """The rows of each field, in the order of the query; refuse rows that do not fit."""
    given = [np.asarray(rows[name]) for name in query.given]
    for name, array in zip(query.given, given, strict=True):
        if array.shape[1:] != tuple(query.given[name]) or array.ndim == 0:
            raise ValueError(
                f"`{name}` has the shape {array.shape}, expected rows of states, "
                f"(n{''.join(f', {size}' for size in query.given[name])})"
            )
        _native.refuse_masked(rows[name], name)
        if len(array) != len(given[0]):
            first = next(iter(query.given))
            raise ValueError(
                f"`{first}` has {len(given[0])} rows and `{name}` has {len(array)} rows; give "
                "equally many rows of each"
            )
    # zero rows of each: the core checks shapes and types, with its messages
    query.ask([array[:0] for array in given])
    return [np.require(array, np.float64, ["C", "A"]) for array in given]


def _empty(query: Query, n: int) -> Answer:
    """Arrays for the answer of this many rows."""
    fields = {name: np.empty((n, *shape)) for name, shape in query.want.items()}
    return Answer(fields, np.empty(n, np.uint32), np.empty(n, np.uint32))


def _usual_rows(query: Query, n: int, threads: int) -> int:
    """Rows of a block: several blocks per thread, within bounds of size."""
    shapes = [*query.given.values(), *query.want.values()]
    numbers = sum(int(np.prod(shape)) for shape in shapes)
    rows = max(LEAST_ROWS, -(-n // max(BLOCKS, BLOCKS_OF_A_THREAD * threads)))
    return max(1, min(rows, MOST_NUMBERS // max(1, numbers)))


def _blocks(n: int, rows: int) -> Iterator[slice]:
    """Divide this many rows into blocks."""
    if rows < 1:
        raise ValueError(f"`rows_of_a_block` is {rows}, expected 1 or more")
    return (slice(start, min(start + rows, n)) for start in range(0, n, rows))


def _threads(client: Any) -> Callable[[], int]:
    """The number of threads of the cluster, at least one, recounted from time to time."""
    count, next_look = 1, 0.0

    def threads() -> int:
        nonlocal count, next_look
        if time.monotonic() >= next_look:
            count = max(1, sum(client.nthreads().values()))
            next_look = time.monotonic() + LOOK
        return count

    return threads
