"""An export as another logger writes it, of a cylinder that this program has never seen: no line of pitchleak is in it.

    python examples/foreign_logger.py Messung.csv

Motion, pressures and load are given, the flows follow from continuity: 0.9 L/min at 60 bar leave the rod side, the oil
has 1.1 GPa. Noise is white, one standard deviation of 0.1 mm, 0.15 bar, 0.08 L/min, 20 N.
"""

import datetime
import math
import random
import sys

AREA_A, AREA_B, STROKE = 38.5e-4, 18.9e-4, 0.5  # m², m
MASS, DAMPING = 120.0, 2500.0  # kg, N·s/m
DEAD_VOLUME = 0.2e-3  # m³
BULK_MODULUS = 1.1e9  # Pa
LEAK_B = 0.9 / 60e3 / 6e6  # m³/(s·Pa)
LPM = 60e3  # L/min in m³/s
SPAN_S, RATE_HZ = 90, 50
START = datetime.datetime(2026, 11, 19, 6, 30)
HEADER = """\
Messprotokoll Pitchzylinder;;;;;;
Anlage:;WEA 23, Blatt 1;;;;;
Bearbeiter:;Müller;;;;;
;;;;;;
Zeit;Kolbenweg;Druck Kolbenseite;Druck Stangenseite;Volumenstrom Kolbenseite;Volumenstrom Stangenseite;Lastkraft
;cm;MPa;MPa;l/min;l/min;kN
"""


def position(t):
    return 0.25 + 0.09 * math.sin(0.31 * t) + 0.035 * math.sin(0.83 * t + 1) + 0.012 * math.sin(2.1 * t + 2)


def pressure_b(t):
    return 5.5e6 + 1.1e6 * math.sin(0.47 * t + 0.3) + 0.4e6 * math.sin(1.7 * t)


def load(t):
    return 9e3 + 5e3 * math.sin(0.6 * t) + 2e3 * math.sin(1.3 * t + 2)


def rate(of, t, h=1e-3):
    return (of(t + h) - of(t - h)) / (2 * h)


def pressure_a(t, h=1e-3):
    acceleration = (position(t + h) - 2 * position(t) + position(t - h)) / h**2
    return (MASS * acceleration + load(t) + DAMPING * rate(position, t) + pressure_b(t) * AREA_B) / AREA_A


def flows(t):
    speed = rate(position, t)
    volume_a = DEAD_VOLUME + AREA_A * position(t)
    volume_b = DEAD_VOLUME + AREA_B * (STROKE - position(t))
    into_a = AREA_A * speed + volume_a / BULK_MODULUS * rate(pressure_a, t)
    into_b = -AREA_B * speed + volume_b / BULK_MODULUS * rate(pressure_b, t) + LEAK_B * pressure_b(t)
    return into_a, into_b


def row(index, noise):
    t = index / RATE_HZ
    into_a, into_b = flows(t)
    readings = [
        (position(t) * 100, 0.01, 3),
        (pressure_a(t) / 1e6, 0.015, 4),
        (pressure_b(t) / 1e6, 0.015, 4),
        (into_a * LPM, 0.08, 3),
        (into_b * LPM, 0.08, 3),
        (load(t) / 1e3, 0.02, 3),
    ]
    stamp = START + datetime.timedelta(seconds=t)
    cells = [f"{stamp:%d.%m.%Y %H:%M:%S}.{stamp.microsecond // 1000:03d}"]
    cells += [f"{value + noise.gauss(0, sigma):.{decimals}f}" for value, sigma, decimals in readings]
    date, clock = cells[0].split(" ")
    return ";".join([f"{date} {clock.replace('.', ',')}"] + [cell.replace(".", ",") for cell in cells[1:]])


noise = random.Random(20261122)
rows = [row(index, noise) for index in range(SPAN_S * RATE_HZ)]
with open(sys.argv[1], "w", encoding="cp1252", newline="\r\n") as file:
    file.write(HEADER + "\n".join(rows) + "\n")
