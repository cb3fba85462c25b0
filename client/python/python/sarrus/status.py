"""Statuses and warnings of answers, by their numbers."""

from enum import IntEnum, IntFlag


class Status(IntEnum):
    """The outcome of the request for one state; the names are those of scripts."""

    ok = 0
    bad_request = 1
    non_finite_input = 2
    wrong_size = 3
    wrong_model = 4
    unknown_request = 5
    not_converged = 6
    branch_changed = 7
    unreachable = 8
    singular_closure = 9
    singular_independents = 10
    singular_actuation = 11
    mass_not_positive = 12
    overloaded = 13
    shutting_down = 14
    corrupt_answer = 15
    unknown_status = 16
    other_process = 17
    late = 18
    not_reached = 19
    infeasible = 20

    def __str__(self) -> str:
        return self.name


class Warnings(IntFlag):
    """Remarks that change neither status nor numbers."""

    limits_exceeded = 1
    ill_conditioned = 2
    loop_open = 4
    input_projected = 8
    no_limit = 16

    def __str__(self) -> str:
        return ", ".join(bit.name or "" for bit in Warnings if bit in self) or "none"
