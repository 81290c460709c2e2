#!/usr/bin/env python3
"""What the gateway takes of memory and disk in an hour, over a payload of 100 MB and over months.

    pip install paho-mqtt && cargo build --release -p pitchleak-cli -p pitchleak-gateway
    python benches/gateway_bounds.py

The broker and the gateway are those of `gateway_bursts.py`. The hour: a second's samples of 20 cylinders each, as fast
as the service takes them. The payload: 100 MB that are no samples. The months: 100 days of a leak that grows by
0.005 L/min a day, ten seconds of samples an hour; what the service then says of its trend.
"""

import argparse
import contextlib
import datetime
import json
import pathlib
import re
import subprocess
import tempfile
import threading
import time

from gateway_bursts import BUILT, free_port, get, messages, start_broker, start_gateway, wait_for
from paho.mqtt import client as mqtt

HOUR_S = 3600
DAYS = 100
FIRST_LPM, GROWTH_LPM = 0.3, 0.005
# Messages that wait at the most.
AHEAD = 2000


class Service:
    """A broker, the gateway, and who sends and listens."""

    def __init__(self, folder, cylinders):
        tls_port, port, self.http_port = free_port(), free_port(), free_port()
        self.broker = start_broker(folder, tls_port, port)
        self.gateway = None
        wait_for(lambda: mqtt.Client(mqtt.CallbackAPIVersion.VERSION2).connect("127.0.0.1", port) == 0)
        self.gateway = start_gateway(folder, tls_port, self.http_port, cylinders)
        wait_for(lambda: self.metric("connected") == 1)
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self.client.max_inflight_messages_set(0)
        self.client.max_queued_messages_set(0)
        self.client.on_message = self.hear
        self.client.connect("127.0.0.1", port)
        self.client.subscribe("pitchleak/+/day", qos=1)
        self.client.loop_start()
        self.sent, self.day, self.heard = 0, None, threading.Event()

    def hear(self, _client, _data, message):
        self.day = json.loads(message.payload)
        self.heard.set()

    def metric(self, name):
        found = re.search(rf"^pitchleak_{name} (\S+)$", get(self.http_port, "/metrics"), re.MULTILINE)
        return float(found[1])

    def send(self, cylinder, payload):
        self.client.publish(f"pitch/{cylinder}/samples", payload, qos=1)
        self.sent += 1
        if self.sent % 200 == 0:
            self.catch_up(AHEAD)

    def catch_up(self, ahead=0):
        while self.metric("messages_total") < self.sent - ahead:
            time.sleep(0.02)

    def memory_mb(self, what):
        status = pathlib.Path(f"/proc/{self.gateway.pid}/status").read_text()
        return int(re.search(rf"{what}:\s*(\d+) kB", status)[1]) / 1e3

    def end(self):
        for process in filter(None, (self.gateway, self.broker)):
            process.terminate()
            process.wait()


@contextlib.contextmanager
def service(cylinders):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        running = Service(folder, cylinders)
        try:
            yield folder, running
        finally:
            running.end()


def an_hour():
    """Memory while an hour's worth of samples passes, and a payload of 100 MB after it."""
    with service(20) as (folder, running):
        begun = time.monotonic()
        for at_s, payload in enumerate(messages(folder, HOUR_S)):
            for cylinder in range(20):
                running.send(f"B{cylinder}", payload)
            if (at_s + 1) % 300 == 0:
                running.catch_up()
                print(f"{(at_s + 1) // 60:3} min: {running.memory_mb('VmRSS'):.1f} MB", flush=True)
        print(f"an hour of 20 cylinders in {time.monotonic() - begun:.0f} s")
        before = running.memory_mb("VmHWM")
        running.send("B0", b"[" * 100_000_000)
        running.catch_up()
        after = running.memory_mb("VmRSS")
        peak = running.memory_mb("VmHWM")
        print(f"a payload of 100 MB: at most {peak:.0f} MB ({before:.0f} before), {after:.1f} MB afterwards")


def trace(folder, day):
    """Names and rows of a leak as it is on that day."""
    path = folder / "day.csv"
    leak = f"{FIRST_LPM + GROWTH_LPM * day:.3f} L/min"
    plan = ["simulate", "--wind", "13", "--seed", f"{day}", "--leak-internal", leak, "--noise", "rig"]
    command = [BUILT / "pitchleak", *plan, "--duration", "60 s", "--out", path]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    names, *rows = (line.split(",") for line in path.read_text().splitlines())
    return names, rows


def hour_of(names, rows, begin):
    """Ten seconds as a message, with time stamps."""
    samples = []
    for k, row in enumerate(rows):
        stamp = begin + datetime.timedelta(milliseconds=10 * k)
        cells = ",".join(f'"{name}":{cell}' for name, cell in zip(names[1:6], row[1:6], strict=True))
        samples.append(f'{{"timestamp":"{stamp.isoformat(timespec="milliseconds")}Z",{cells}}}')
    return ("[" + ",".join(samples) + "]").encode()


def months():
    """What a hundred days leave on the disk, and in the trend."""
    with service(1) as (folder, running):
        first = datetime.datetime(2026, 1, 1)
        for day in range(DAYS):
            names, rows = trace(folder, day)
            for hour in range(24):
                begin = first + datetime.timedelta(days=day, hours=hour)
                running.send("B0", hour_of(names, rows[1000 * (hour % 6) :][:1000], begin))
            if day in (9, 49, DAYS - 1):
                running.catch_up()
                print(f"day {day + 1:3}: {running.memory_mb('VmRSS'):.1f} MB of memory", flush=True)
        running.catch_up()
        time.sleep(11)
        files = sorted((folder / "state" / "summaries").iterdir())
        size = sum(file.stat().st_size for file in files)
        state = sum(file.stat().st_size for file in (folder / "state/cylinders").iterdir())
        print(f"{len(files)} files of hours and days, {files[0].stem} to {files[-1].stem}, {size / 1e6:.2f} MB")
        print(f"state {state / 1e3:.0f} kB (two generations)")
        leak = running.day["leakage"]["internal"]
        last_lpm = FIRST_LPM + GROWTH_LPM * (DAYS - 2)
        print(f"sent: {last_lpm:.3f} L/min on the last whole day, {GROWTH_LPM} L/min more each day; told: {leak}")


PARTS = {"hour": an_hour, "months": months}


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("part", nargs="*", choices=[[], *PARTS], help="hour, months; both")
    for part in arguments.parse_args().part or PARTS:
        PARTS[part]()


if __name__ == "__main__":
    main()
