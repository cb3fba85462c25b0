"""A robot as a page of a notebook."""

from __future__ import annotations

import html


class Page:
    """A page of HTML: `text`; a notebook shows it where it is a cell's value."""

    def __init__(self, text: str, height: int = 640) -> None:
        """Take the text of a page, and its height in a notebook [pixels]."""
        self.text = text
        self.height = height

    def _repr_html_(self) -> str:
        text = html.escape(self.text)
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe srcdoc="{text}" style="{style}" title="robot"></iframe>'
