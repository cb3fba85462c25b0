"""Names in the order of arrays."""

import difflib
from typing import Any


class Names(tuple[str, ...]):
    """Names in the order of an array; each is also an attribute with its index in the array.

    `robot.joints[2]` is the name of the third joint, `robot.joints.elbow` the index of the joint
    `elbow`. Use `robot.joints.place("base/rx")` for names that are not identifiers, that begin with
    two underscores, or that are methods (`index`, `count`, `place`).
    """

    __slots__ = ()

    def place(self, name: str) -> int:
        """Give the index of a name; a `KeyError` suggests the nearest one."""
        try:
            return self.index(name)
        except ValueError:
            near = difflib.get_close_matches(name, self, n=1)
            hint = f"; did you mean `{near[0]}`?" if near else f"; there are {', '.join(self)}"
            raise KeyError(f"no name `{name}` among these {len(self)}{hint}") from None

    def __getattr__(self, name: str) -> int:
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            return self.place(name)
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(name for name in self if name.isidentifier())]

    def __reduce__(self) -> tuple[Any, ...]:
        return (Names, (tuple(self),))
