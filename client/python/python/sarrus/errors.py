"""Exceptions of robots.

Arrays of a wrong shape raise `ValueError`, arrays without real numbers `TypeError`, and files that
cannot be opened `OSError`.
"""

from typing import Any

from sarrus import _native
from sarrus.status import Status


class Error(Exception):
    """Base class of the exceptions of sarrus."""


class LoadError(Error, ValueError):
    """Faulty files of a robot, or no bundled robot of this name.

    `diagnostics` has every fault, with the keys of `sarrus check --format json`: `file`, `line`,
    `column`, `found`, `expected`, `help`.
    """

    def __init__(self, message: str, diagnostics: list[dict[str, Any]]) -> None:
        super().__init__(message, diagnostics)
        self.diagnostics = diagnostics

    def __str__(self) -> str:
        return str(self.args[0])


class ConnectError(Error, ConnectionError):
    """A server is not there, has gone, or does not answer in time."""


class QueryError(Error, ValueError):
    """A query with unknown names, or one that cannot be planned."""


class StateError(Error, ValueError):
    """A state without an answer.

    `status` is the name of the reason, such as `unreachable`, and `code` its number. `answer` has
    the fields of a query: fields that survive a failure (`nearest_y`, `sigma_min`, …) hold their
    numbers, all others NaN.
    """

    def __init__(self, message: str, status: str, code: int, answer: object = None) -> None:
        super().__init__(message, status, code, answer)
        self.status = status
        self.code = Status(code)
        self.answer = answer

    def __str__(self) -> str:
        return str(self.args[0])


class StateWarning(RuntimeWarning):
    """States of a batch have no answer, so that their rows are NaN, or answers have warnings."""


def state_error(code: int, answer: object = None) -> StateError:
    """Give the exception of a status."""
    return StateError(_native.status_help(code), Status(code).name, code, answer)
