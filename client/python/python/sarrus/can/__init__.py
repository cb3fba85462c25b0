"""The CAN bridge over python-can.

`python -m sarrus.can` runs the loop of `sarrus-can` on adapters of python-can, and has the commands
for commissioning. `Bridge` is the core without a loop, a bus or a clock, for loops of your own.
"""

from sarrus._native import (
    Bridge,
    Configuration,
    Controller,
    Drives,
    Frame,
    Service,
    protocols,
)
from sarrus.can.adapters import Adapter, Address, BusError, open_bus

__all__ = [
    "Adapter",
    "Address",
    "Bridge",
    "BusError",
    "Configuration",
    "Controller",
    "Drives",
    "Frame",
    "Service",
    "open_bus",
    "protocols",
]
