#!/usr/bin/env python3
"""Time to the estimate where many cylinders send their second's samples in the same moment.

    pip install paho-mqtt && cargo build --release -p pitchleak-cli -p pitchleak-gateway
    python benches/gateway_bursts.py [--cylinders 200] [--seconds 60] [--over 0]

A mosquitto on loopback (TLS and password for the gateway), the gateway on one core, broker and sender on another where
there is one. Every second each cylinder sends a JSON array of 100 samples: all back to back, or spread over so many
seconds. What is printed: the time from the moment in which a message is due (the burst's begin, where it is one) to its
estimate at a subscriber, the service's own time (`pitchleak_latency_seconds`), the processor time of each thread and
program, and the service's memory.
"""

import argparse
import os
import pathlib
import re
import socket
import subprocess
import tempfile
import threading
import time
import urllib.request

from paho.mqtt import client as mqtt

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILT = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
CERTIFICATES = ROOT / "crates/pitchleak-gateway/tests/certificates"
CORES = sorted(os.sched_getaffinity(0))
WARM_UP = 5


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def messages(folder, seconds):
    """A second of samples each, of a simulated leak."""
    trace = folder / "leak.csv"
    plan = [
        "simulate",
        "--wind",
        "13",
        "--leak-internal",
        "0.5 L/min",
        "--noise",
        "rig",
        "--duration",
        f"{seconds + 1} s",
    ]
    subprocess.run([BUILT / "pitchleak", *plan, "--out", trace], check=True, stderr=subprocess.DEVNULL)
    names, *rows = (line.split(",") for line in trace.read_text().splitlines())
    samples = [
        "{" + ",".join(f'"{name}":{cell}' for name, cell in zip(names, row, strict=True) if cell) + "}" for row in rows
    ]
    return [("[" + ",".join(samples[at : at + 100]) + "]").encode() for at in range(0, 100 * seconds, 100)]


def start_broker(folder, tls_port, port):
    (folder / "mosquitto.conf").write_text(
        f"per_listener_settings true\nuser root\nlistener {tls_port} 127.0.0.1\ncafile {CERTIFICATES}/authority.pem\n"
        f"certfile {CERTIFICATES}/broker.pem\nkeyfile {CERTIFICATES}/broker.key\nallow_anonymous false\n"
        f"password_file {CERTIFICATES}/passwords\nset_tcp_nodelay true\nlistener {port} 127.0.0.1\n"
        "allow_anonymous true\nset_tcp_nodelay true\nmax_queued_messages 20000\nmax_inflight_messages 5000\n"
    )
    path = os.environ | {"PATH": os.environ["PATH"] + ":/usr/sbin"}
    command = ["taskset", "-c", str(CORES[-1]), "mosquitto", "-c", folder / "mosquitto.conf"]
    return subprocess.Popen(command, env=path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def start_gateway(folder, tls_port, http_port, cylinders):
    (folder / "password").write_text("correct\n")
    (folder / "gateway.toml").write_text(
        f'state = "state"\n[broker]\nhost = "localhost"\nport = {tls_port}\nca_file = "{CERTIFICATES}/authority.pem"\n'
        f'user = "tester"\npassword_file = "password"\nin_flight = 5000\n[[samples]]\ntopic = "pitch/+/samples"\n'
        f'format = "json"\n[http]\nlisten = "127.0.0.1:{http_port}"\n'
        f'[watch]\nrig = "{ROOT}/data/traces/rig.toml"\nmost_cylinders = {cylinders}\n'
    )
    program = os.environ.get("GATEWAY", BUILT / "pitchleak-gateway")
    command = ["taskset", "-c", str(CORES[0]), program, folder / "gateway.toml"]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)


def get(port, path):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=5) as answer:
        return answer.read().decode()


def wait_for(what):
    for _ in range(200):
        try:
            if what():
                return
        except OSError:
            pass
        time.sleep(0.05)
    raise TimeoutError(what)


def processor_s(gateway, broker):
    """What each thread of the gateway has taken, the broker, and this program (sender and subscriber)."""
    spent = {"sender and subscriber": time.process_time()}
    for who, pid in (("gateway", gateway.pid), ("broker", broker.pid)):
        for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
            ns = int((task / "schedstat").read_text().split()[0])
            name = f"{who}: {(task / 'comm').read_text().strip()}"
            spent[name] = spent.get(name, 0.0) + ns / 1e9
    return spent


def share(times, part):
    ordered = sorted(times)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def buckets(text):
    """How many of the service's latencies are below each bound."""
    return {
        float(bound): float(count)
        for bound, count in re.findall(r'pitchleak_latency_seconds_bucket\{le="([^"]+)"\} (\d+)', text)
    }


class Bursts:
    """Sends a second's messages, over so many seconds, and hears the estimates."""

    def __init__(self, port, cylinders, over_s):
        self.topics = [f"pitch/B{k}/samples" for k in range(cylinders)]
        self.after_s = [over_s * k / cylinders for k in range(cylinders)]
        self.heard, self.all_heard = [], threading.Event()
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self.client.max_inflight_messages_set(0)
        self.client.max_queued_messages_set(0)
        self.client.on_message = self.hear
        self.client.connect("127.0.0.1", port)
        self.client.subscribe("pitchleak/+/estimate")
        self.client.loop_start()

    def hear(self, _client, _data, message):
        self.heard.append((message.topic, time.perf_counter()))
        if len(self.heard) >= len(self.topics):
            self.all_heard.set()

    def send(self, payload):
        """Times from the moment in which a message is due to its estimate, s."""
        self.heard.clear()
        self.all_heard.clear()
        begin = time.perf_counter()
        for topic, after_s in zip(self.topics, self.after_s, strict=True):
            time.sleep(max(0.0, begin + after_s - time.perf_counter()))
            self.client.publish(topic, payload, qos=1)
        self.all_heard.wait(max(0.0, begin + 0.98 - time.perf_counter()))
        heard = list(self.heard)
        time.sleep(max(0.0, begin + 1.0 - time.perf_counter()))
        # pitchleak/B7/estimate
        return [at - begin - self.after_s[int(topic.split("/")[1][1:])] for topic, at in heard]


def measure(folder, cylinders, seconds, over_s):
    tls_port, port, http_port = free_port(), free_port(), free_port()
    payloads = messages(folder, seconds + WARM_UP)
    os.sched_setaffinity(0, {CORES[-1]})
    broker = start_broker(folder, tls_port, port)
    wait_for(lambda: socket.create_connection(("127.0.0.1", port), 1))
    gateway = start_gateway(folder, tls_port, http_port, cylinders)
    try:
        wait_for(lambda: "pitchleak_connected 1" in get(http_port, "/metrics"))
        bursts = Bursts(port, cylinders, over_s)
        for payload in payloads[:WARM_UP]:
            bursts.send(payload)
        before, begun = buckets(get(http_port, "/metrics")), processor_s(gateway, broker)
        times = [bursts.send(payload) for payload in payloads[WARM_UP:]]
        spent = {who: s - begun.get(who, 0.0) for who, s in processor_s(gateway, broker).items()}
        text = get(http_port, "/metrics")
        status = pathlib.Path(f"/proc/{gateway.pid}/status").read_text()
    finally:
        gateway.terminate()
        gateway.wait()
        broker.terminate()
    own = {bound: count - before[bound] for bound, count in buckets(text).items()}
    return times, spent, own, text, re.search(r"VmHWM:\s*(\d+) kB", status)[1]


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--cylinders", type=int, default=200)
    arguments.add_argument("--seconds", type=int, default=60)
    arguments.add_argument("--over", type=float, default=0.0, help="s: 0 is a burst, at most 0.9")
    arguments = arguments.parse_args()
    cylinders, seconds = arguments.cylinders, arguments.seconds
    with tempfile.TemporaryDirectory() as folder:
        times, spent, own, text, peak_kb = measure(pathlib.Path(folder), cylinders, seconds, arguments.over)
    every = [one for burst in times for one in burst]
    last = [max(burst) for burst in times if burst]
    ms = {part: 1e3 * share(every, part) for part in (0.5, 0.9, 0.99, 1.0)}
    print(f"{cylinders} cylinders, {seconds} bursts, {len(every)} of {cylinders * seconds} estimates heard")
    shares = ", ".join(f"{100 * part:.0f} % {one:.1f}" for part, one in ms.items())
    print(f"from the moment in which a message is due to its estimate, ms: {shares}")
    print(f"a second's slowest: half within {1e3 * share(last, 0.5):.0f} ms, 90 % {1e3 * share(last, 0.9):.0f}")
    ms_each = {who: 1e3 * s / cylinders / seconds for who, s in spent.items()}
    whole = sum(ms for who, ms in ms_each.items() if who.startswith("gateway"))
    print(f"processor time of the gateway: {whole:.3f} ms a message")
    print("of which and beside it: " + ", ".join(f"{who} {ms:.3f}" for who, ms in ms_each.items()))
    total = own[float("inf")]
    within = [f"{100 * count / total:.1f} % within {1e3 * bound:.0f} ms" for bound, count in own.items()]
    print("in the service: " + ", ".join(within))
    for name in ("checkpoint_seconds", "checkpoint_bytes"):
        print(*re.findall(rf"^pitchleak_{name} .*$", text, re.MULTILINE))
    print(f"peak memory {int(peak_kb) / 1e3:.0f} MB; load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
