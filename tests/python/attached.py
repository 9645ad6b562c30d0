"""Flies in real time, in turn: alone, with all clients attached, and also with a browser that draws the page.

Usage: attached.py LAUNCHER [ROUNDS [SECONDS]]

The clients are the live page, a Foxglove client that takes every channel, a MAVLink receiver and the recorder. The
browser is Chromium, on the same machine (in tests/pages: npm ci). Prints the missed deadlines of each node, flight by
flight. Needs websockets.
"""

import asyncio
import json
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import websockets

KINDS = ["alone", "attached", "with a browser"]
WATCH = Path(__file__).parents[1] / "pages" / "watch.mjs"


async def foxglove(address, token):
    """Subscribes to every channel and reads until the flight ends; returns the number of messages."""
    count = 0
    url = f"ws://{address}/foxglove?token={token}"
    async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as server:
        try:
            async for message in server:
                if isinstance(message, bytes):
                    count += 1
                elif (told := json.loads(message))["op"] == "advertise":
                    channels = [{"id": channel["id"], "channelId": channel["id"]} for channel in told["channels"]]
                    await server.send(json.dumps({"op": "subscribe", "subscriptions": channels}))
        except websockets.ConnectionClosed:
            pass
    return count


def receive(station, is_over):
    """Reads datagrams until the flight is over; returns their number."""
    count = 0
    while not is_over.is_set():
        try:
            station.recv(2048)
            count += 1
        except TimeoutError:
            pass
    return count


def fly(launcher, kind, seconds, folder):
    """Flies once. Returns the misses by node, and what the clients received."""
    command = [launcher, "fly", "--set", f"run.duration_s={seconds}", "--json", "--namespace", "attached"]
    if kind == "alone":
        flight = subprocess.run([*command, "--no-log"], capture_output=True, text=True, check=True)
        return misses(flight.stdout), {}
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.bind(("127.0.0.1", 0))
    station.settimeout(0.2)
    mavlink = f"udpout:127.0.0.1:{station.getsockname()[1]}"
    command += ["--out", folder, "--web", "127.0.0.1:0", "--mavlink", mavlink]
    flight = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    printed = r"http://([\d.]+:\d+)/\?token=(\S+)"
    address, token = next(found.groups() for line in flight.stderr if (found := re.search(printed, line)))
    is_over, received = threading.Event(), {}
    clients = [
        threading.Thread(target=lambda: received.update(foxglove=asyncio.run(foxglove(address, token)))),
        threading.Thread(target=lambda: received.update(mavlink=receive(station, is_over))),
    ]
    for client in clients:
        client.start()
    if kind == "with a browser":
        browser = subprocess.Popen(["node", WATCH, f"http://{address}/?token={token}"], stdout=subprocess.PIPE, text=True)
    printed, _ = flight.communicate()
    is_over.set()
    for client in clients:
        client.join()
    if kind == "with a browser":
        received["title"] = browser.communicate()[0].strip()
    return misses(printed), received


def misses(printed):
    """Returns the missed deadlines by node."""
    return {name: node["misses"] for name, node in json.loads(printed)["timing"]["nodes"].items()}


launcher, rounds, seconds = (sys.argv[1:] + ["8", "45"][len(sys.argv) - 2:])[:3]
total = dict.fromkeys(KINDS, 0)
for number in range(int(rounds)):
    for kind in KINDS if number % 2 == 0 else reversed(KINDS):
        folder = tempfile.mkdtemp()
        missed, received = fly(launcher, kind, float(seconds), folder)
        shutil.rmtree(folder)
        total[kind] += sum(missed.values())
        print(kind, missed, received, flush=True)
print("misses of all flights:", total)
