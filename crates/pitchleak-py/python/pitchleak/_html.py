"""Small tables for notebooks."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._pitchleak import Rig


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


def rig(shown: "Rig") -> str:
    """What a rig is, in units for people."""
    internal, external_a, external_b = shown.alarm_thresholds_lpm
    rows = [
        ("piston area A, rod-side area B", f"{1e4 * shown.area_a_m2:.4g} and {1e4 * shown.area_b_m2:.4g} cm²"),
        ("stroke", f"{1e3 * shown.stroke_m:.4g} mm"),
        ("moving mass", f"{shown.moving_mass_kg:.4g} kg"),
        ("dead volumes A, B", f"{1e6 * shown.dead_volume_a_m3:.4g} and {1e6 * shown.dead_volume_b_m3:.4g} cm³"),
        ("bulk modulus", f"{shown.bulk_modulus_pa / 1e9:.3g} ± {shown.bulk_modulus_std_pa / 1e9:.3g} GPa (1 σ)"),
        ("estimator", shown.estimator),
        ("alarms at (internal, external A, B)", f"{internal:.3g}, {external_a:.3g}, {external_b:.3g} L/min"),
        *((f"effect {name}", f"{value:.4g}") for name, value in shown.effects.items()),
    ]
    return page(f"Rig {shown.name}", table(("", ""), rows))
