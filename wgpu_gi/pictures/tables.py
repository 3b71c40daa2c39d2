"""Texts that a notebook displays as tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


class Table(str):
    """A text to print; a notebook displays `rows` under `head` instead."""

    rows: list[Sequence[object]]
    head: Sequence[str]

    def __new__(cls, text: str, head: Sequence[str] = (), rows: Iterable[Sequence[object]] = ()) -> Table:
        """Return the text."""
        table = super().__new__(cls, text)
        table.head, table.rows = head, list(rows)
        return table

    def _repr_html_(self) -> str:
        return html_table(self.head, self.rows)


def html_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in HTML; cells are text."""
    titles = "".join(f"<th style='text-align:left'>{escape(title)}</th>" for title in head)
    lines = [f"<tr>{titles}</tr>"] if head else []
    for row in rows:
        lines.append("<tr>" + "".join(f"<td style='text-align:left'>{escape(str(c))}</td>" for c in row) + "</tr>")
    return f"<table>{''.join(lines)}</table>"
