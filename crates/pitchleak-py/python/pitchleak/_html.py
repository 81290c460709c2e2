"""Small tables for notebooks."""

from collections.abc import Iterable, Sequence
from html import escape


def table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts."""
    head = "".join(f"<th>{escape(header)}</th>" for header in headers)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def page(title: str, *parts: str, footer: str = "") -> str:
    """A sentence, tables below it, small print at the end."""
    small = f"<p><small>{escape(footer)}</small></p>" if footer else ""
    return f"<div><p><b>{escape(title)}</b></p>{''.join(parts)}{small}</div>"


def number(value: float | None, std: float | None = None) -> str:
    """A value and its 95 % interval in the digits that it deserves."""
    if value is None:
        return "–"
    if not std:
        return f"{value:.4g}"
    half = 1.96 * std
    decimals = 1
    while half < 10 ** (1 - decimals) and decimals < 12:
        decimals += 1
    return f"{value:.{decimals}f} ± {half:.{decimals}f}"
