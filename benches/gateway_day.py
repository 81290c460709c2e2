#!/usr/bin/env python3
"""A day of service in two hours and a half: memory, what goes to the disk, and what the service says of its own accord.

    pip install paho-mqtt && cargo build --release -p pitchleak-cli -p pitchleak-gateway
    python benches/gateway_day.py [--hours 24] [--speed 10]

The broker and the gateway are those of `gateway_bursts.py`. Three sound cylinders and one with an internal leak of
0.3 L/min send their samples of 100 Hz, a message a second of samples, so many times faster than the clock. Each hour
is another simulated one, and begins two seconds after the one before. What is printed each hour: the service's memory,
what it wrote since the begin, and how often it told of what; at the end every alarm.
"""

import argparse
import collections
import json
import pathlib
import re
import subprocess
import tempfile
import time

from gateway_bounds import Service
from gateway_bursts import BUILT

SOUND, LEAKING = ("S1", "S2", "S3"), "L1"
HOUR_S, SEAM_S, RATE_HZ = 3600, 2, 100
WINDS = ("5", "13", "21", "30")


def simulated_hour(folder, number, leak):
    """Names and rows of an hour, as they stand in the file."""
    path = folder / "hour.csv"
    plan = ["simulate", "--wind", WINDS[number % len(WINDS)], "--seed", str(1000 + number), "--noise", "rig"]
    command = [BUILT / "pitchleak", *plan, *leak, "--duration", f"{HOUR_S} s", "--out", path]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    names, *rows = (line.split(",", 1) for line in path.read_text().splitlines())
    # Position, pressures and flows: what a gateway measures.
    return names[1].split(",")[:5], [cells.split(",")[:5] for _, cells in rows]


def message(names, rows, first_s):
    """Rows of a second as JSON, the first of them at this time."""
    samples = []
    for k, cells in enumerate(rows):
        fields = ",".join(f'"{name}":{cell}' for name, cell in zip(names, cells, strict=True) if cell)
        samples.append(f'{{"t_s":{first_s + k / RATE_HZ:.2f},{fields}}}')
    return ("[" + ",".join(samples) + "]").encode()


class Day(Service):
    """The service, and all that it says."""

    def __init__(self, folder):
        self.alarms, self.notices = collections.Counter(), collections.Counter()
        super().__init__(folder, 10)
        self.client.subscribe([("pitchleak/+/alarm", 1), ("pitchleak/+/notice/#", 1)])

    def hear(self, _client, _data, message):
        said = json.loads(message.payload)
        if "/notice/" in message.topic:
            self.notices[message.topic] += 1
        elif "/alarm" in message.topic:
            self.alarms[said["id"]] += 1

    def written_mb(self):
        told = pathlib.Path(f"/proc/{self.gateway.pid}/io").read_text()
        return int(re.search(r"^write_bytes: (\d+)", told, re.MULTILINE)[1]) / 1e6


def send_an_hour(service, hours, begin_s, due, speed):
    """All cylinders' messages, each when it is due; gives the time at which the next hour is."""
    for second in range(HOUR_S):
        time.sleep(max(0.0, due - time.monotonic()))
        due += 1 / speed
        rows = slice(second * RATE_HZ, (second + 1) * RATE_HZ)
        for cylinders, (names, cells) in zip((SOUND, (LEAKING,)), hours, strict=True):
            said = message(names, cells[rows], begin_s + second)
            for cylinder in cylinders:
                service.send(cylinder, said)
    return due


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--hours", type=int, default=24)
    arguments.add_argument("--speed", type=float, default=10.0)
    arguments = arguments.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        service = Day(folder)
        try:
            begun = due = time.monotonic()
            for hour in range(arguments.hours):
                kinds = ([], ["--leak-internal", "0.3 L/min"])
                hours = [simulated_hour(folder, hour % len(WINDS), leak) for leak in kinds]
                due = max(due, time.monotonic())
                due = send_an_hour(service, hours, hour * (HOUR_S + SEAM_S), due, arguments.speed)
                service.catch_up()
                wall_s = time.monotonic() - begun
                a_day = service.written_mb() / wall_s * 86_400 / (len(SOUND) + 1)
                print(
                    f"{hour + 1:3} h after {wall_s:6.0f} s: {service.memory_mb('VmRSS'):.1f} MB, "
                    f"{service.written_mb():.1f} MB written ({a_day:.0f} MB a cylinder and day of the clock), "
                    f"{len(service.alarms)} alarms, notices {dict(service.notices)}",
                    flush=True,
                )
            for alarm, times in service.alarms.items():
                print(f"{alarm}: sent {times} times")
        finally:
            service.end()


if __name__ == "__main__":
    main()
