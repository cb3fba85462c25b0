"""The CAN bridge: the core of `sarrus-can` under python-can.

`python -m sarrus.can` runs it and has the commands for commissioning. Rules, codecs and
configuration are the core's, in Rust; buses, clock and people are this package's.
"""

from sarrus._native import (
    Bridge,
    Configuration,
    Controller,
    Drives,
    Frame,
    Service,
    Telemetry,
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
    "Telemetry",
    "open_bus",
    "protocols",
]
