"""Exact dynamics of series-parallel robots; here the CAN bridge of sarrus under python-can."""

from sarrus._native import VERSION as __version__

__all__ = ["__version__"]
