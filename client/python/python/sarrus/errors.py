"""What can go wrong with a robot.

Arrays that do not fit are a `ValueError`, arrays of something else than numbers a `TypeError`,
files that cannot be opened an `OSError`.
"""

from typing import Any

from sarrus import _native
from sarrus.status import Status


class Error(Exception):
    """Everything that sarrus itself finds wrong."""


class LoadError(Error, ValueError):
    """Files that are no robot, or no bundled robot of this name.

    `diagnostics` has every fault, with the keys of `sarrus check --format json`: `file`, `line`,
    `column`, `found`, `expected`, `help`.
    """

    def __init__(self, message: str, diagnostics: list[dict[str, Any]]) -> None:
        super().__init__(message, diagnostics)
        self.diagnostics = diagnostics

    def __str__(self) -> str:
        return str(self.args[0])


class ConnectError(Error, ConnectionError):
    """A server that is not there, is gone, or does not answer in time."""


class QueryError(Error, ValueError):
    """A query with names that stand for nothing, or that cannot be planned."""


class StateError(Error, ValueError):
    """A state that has no answer.

    `status` is the word that all of sarrus has for the reason, such as `unreachable`, and `code`
    its number. `answer` has what was asked of a query all the same: fields that survive a failure
    (`nearest_y`, `sigma_min`, …) have their numbers there, all others are NaN.
    """

    def __init__(self, message: str, status: str, code: int, answer: object = None) -> None:
        super().__init__(message, status, code, answer)
        self.status = status
        self.code = Status(code)
        self.answer = answer

    def __str__(self) -> str:
        return str(self.args[0])


class StateWarning(RuntimeWarning):
    """Some states of a batch have no answer; their rows are NaN."""


def state_error(code: int, answer: object = None) -> StateError:
    """The error of a status."""
    return StateError(_native.status_help(code), Status(code).name, code, answer)
