"""A device made from the page on the wire protocol and nothing else: not a line of the product is used here.

``python page_device.py [rate]`` opens a pseudo-terminal, prints its name and serves it until it is killed. Its plant is a wire:
channel c reads the output divided by c + 1. Two channels, 16 bits, 1 mV a count.
"""

import math
import os
import pty
import select
import struct
import sys
import time
import tty
import zlib

IDLE, RUNNING, ARMED, LATCHED = range(4)
DONE, UNKNOWN, NOT_ALLOWED, WRONG_STATE, LATCHED_STATUS = range(5)
VERSION, STATE, RATE, BLOCK, QUEUE, WATCHDOG, RAMP, PING = 3, 9, 48, 49, 50, 51, 52, 65
LIMITS = {VERSION: (1, 1), BLOCK: (1, 100), QUEUE: (1, 8), WATCHDOG: (2000, 10_000_000), RAMP: (0, 10_000_000)}
HELD, WATCHDOG_FLAG, EMERGENCY_FLAG, CLIPPED = 4, 8, 16, 2
NAMES, RANGE_V, V_PER_COUNT = ("force", "drive"), 10.0, 1e-3


def word(value):
    return struct.unpack("<I", struct.pack("<f", value))[0]


def text(parameter, channel, said):
    data = said.encode().ljust(32, b"\0")
    return {(parameter, 8 * channel + w): int.from_bytes(data[4 * w : 4 * w + 4], "little") for w in range(8)}


def description(rate_hz):
    out = {(1, 0): 1, (2, 0): 1, (VERSION, 0): 1, (7, 0): os.getpid(), (8, 0): 1, (16, 0): len(NAMES), (23, 0): 16}
    out |= text(4, 0, "made from the page") | text(5, 0, "0.1") | text(6, 0, "7")
    for channel, name in enumerate(NAMES):
        out |= text(17, channel, name) | text(18, channel, "V")
        out |= {(19, channel): word(RANGE_V), (20, channel): word(V_PER_COUNT)}
    out |= {(21, 0): word(RANGE_V), (22, 0): word(V_PER_COUNT), (32, 0): 1000 * rate_hz, (33, 0): 1000 * rate_hz}
    out |= {(34, 0): LIMITS[BLOCK][1], (35, 0): LIMITS[QUEUE][1], (36, 0): LIMITS[WATCHDOG][0]}
    out |= {(37, 0): LIMITS[WATCHDOG][1], (RATE, 0): 1000 * rate_hz, (WATCHDOG, 0): 100_000, (RAMP, 0): 50_000}
    return out | {(BLOCK, 0): 1, (QUEUE, 0): 1}


def stuffed(payload):
    out = b""
    for piece in (payload + zlib.crc32(payload).to_bytes(4, "little")).split(b"\0"):
        while len(piece) > 254:
            out, piece = out + b"\xff" + piece[:254], piece[254:]
        out += bytes([len(piece) + 1]) + piece
    return out + b"\0"


def unstuffed(frame):
    out, at = b"", 0
    while at < len(frame):
        code = frame[at]
        out += frame[at + 1 : at + code] + (b"\0" if code < 255 and at + code < len(frame) else b"")
        at += code
    intact = at == len(frame) and zlib.crc32(out[:-4]) == int.from_bytes(out[-4:], "little")
    return out[:-4] if intact else b""


class Device:
    def __init__(self, descriptor, rate_hz):
        self.descriptor, self.words = descriptor, description(rate_hz)
        self.state, self.latched, self.sampling, self.last = IDLE, 0, False, None
        self.index = self.dropped = self.beaten = 0
        self.rest = b""

    def serve(self):
        while True:
            now = time.monotonic()
            wait = self.due() - now if self.sampling else 0.1
            if select.select([self.descriptor], [], [], min(max(wait, 0.0), 0.1))[0]:
                *frames, self.rest = (self.rest + os.read(self.descriptor, 4096)).split(b"\0")
                for frame in frames:
                    self.take(unstuffed(frame))
            while self.sampling and self.due() <= time.monotonic():
                self.sample()
            if time.monotonic() >= self.beaten + 0.1:
                self.beat()

    def due(self):
        return self.began + self.index / self.rate_hz

    def send(self, payload, opening=b""):
        data = opening + stuffed(payload)
        room = select.select([], [self.descriptor], [], 0)[1]
        return bool(room) and os.write(self.descriptor, data) == len(data)

    def beat(self):
        self.beaten = time.monotonic()
        boot = self.words[7, 0] & 255
        body = (self.state, boot, self.latched, self.dropped, self.index & 0xFFFFFFFF)
        self.send(struct.pack("<BBHBBHII", 1, 5, 0, *body), b"\0")

    def become(self, state):
        self.state = state
        self.beat()

    def latch(self, flag, ramp_s=0.0):
        self.latched |= flag
        self.ramp_from, self.ramp_s, self.bitten = self.held * (self.state == ARMED), ramp_s, time.monotonic()
        self.become(LATCHED)

    def take(self, payload):
        kind = payload[1] if len(payload) > 4 else 0
        if kind == 1 and len(payload) == 12:
            if payload != self.last:
                number, command, parameter, item, value = struct.unpack("<4xBBBBI", payload)
                status, value = self.obey(command, parameter, item, value)
                self.answer = struct.pack("<BBHBBBBI", 1, 2, 0, number, status, parameter, item, value)
                self.last = payload
            self.send(self.answer, b"\0")
        elif kind == 4 and payload[0] == 1 and self.sampling and len(payload) == 12 + 2 * self.block:
            first, *counts = struct.unpack(f"<4xQ{self.block}h", payload)
            if first % self.block == 0 and first <= self.index + (self.queue + 2) * self.block:
                self.outputs |= {first + i: count for i, count in enumerate(counts) if first + i >= self.index}
                self.fed = time.monotonic() if first + self.block > self.index else self.fed
                self.asked = True
        elif kind == 6 and len(payload) == 5:
            self.latch(EMERGENCY_FLAG)

    def obey(self, command, parameter, item, value):
        if command == 1:
            here = {(STATE, 0): self.state, (PING, item): 0, **self.words}
            return (DONE, here[parameter, item]) if (parameter, item) in here else (UNKNOWN, 0)
        if command == 2:
            if self.sampling:
                return WRONG_STATE, self.state
            lowest, highest = LIMITS.get(parameter, (self.words[RATE, 0],) * 2)
            if parameter not in (*LIMITS, RATE) or item:
                return UNKNOWN, 0
            if not lowest <= value <= highest:
                return NOT_ALLOWED, min(max(value, lowest), highest)
            self.words[parameter, 0] = value
            return DONE, value
        if command in (3, 5) and self.state == LATCHED:
            return LATCHED_STATUS, self.latched
        return {3: self.start, 4: self.stop, 5: self.arm, 6: self.disarm, 7: self.clear}.get(
            command, lambda _: (UNKNOWN, 0)
        )(value)

    def start(self, _):
        if self.state != IDLE:
            return WRONG_STATE, self.state
        self.rate_hz, self.watchdog_s = self.words[RATE, 0] / 1000, self.words[WATCHDOG, 0] / 1e6
        self.block, self.queue = self.words[BLOCK, 0], self.words[QUEUE, 0]
        self.index = self.dropped = self.blocks = self.held = self.flags = 0
        self.outputs, self.rows, self.asked = {}, [], False
        self.began, self.sampling = time.monotonic(), True
        self.become(RUNNING)
        return DONE, 0

    def stop(self, _):
        self.sampling = False
        if self.state != LATCHED:
            self.become(IDLE)
        return DONE, self.state

    def arm(self, key):
        if self.state != RUNNING:
            return WRONG_STATE, self.state
        if key != 0x41524D21:
            return NOT_ALLOWED, 0
        self.fed = time.monotonic()
        self.become(ARMED)
        return DONE, 0

    def disarm(self, _):
        if self.state == ARMED:
            self.become(RUNNING)
        return DONE, self.state

    def clear(self, _):
        if self.sampling:
            return WRONG_STATE, self.state
        self.latched = 0
        self.become(IDLE)
        return DONE, self.state

    def sample(self):
        if self.state == ARMED and self.due() > self.fed + self.watchdog_s:
            self.latch(WATCHDOG_FLAG, self.words[RAMP, 0] / 1e6)
        there = self.index in self.outputs
        self.held = self.outputs.pop(self.index, self.held)
        out = 0
        if self.state == ARMED:
            out = self.held
            if self.asked and not there and self.index >= self.queue * self.block:
                self.flags |= HELD
        elif self.state == LATCHED and self.ramp_s:
            out = round(self.ramp_from * max(0.0, 1.0 - (time.monotonic() - self.bitten) / self.ramp_s))
        largest = math.floor(RANGE_V / V_PER_COUNT)
        self.flags |= CLIPPED * (abs(out) > largest)
        out = max(-largest, min(out, largest))
        self.rows += [out // (channel + 1) for channel in range(len(NAMES))]
        self.index += 1
        if self.index % self.block == 0:
            self.send_block()

    def send_block(self):
        head = (1, 3, self.blocks & 0xFFFF, self.index - self.block, round(1e6 * time.monotonic()), self.dropped)
        payload = struct.pack(f"<BBHQQIHH{len(self.rows)}h", *head, self.flags | self.latched, 0, *self.rows)
        self.dropped += 0 if self.send(payload) else self.block
        self.blocks, self.rows, self.flags = self.blocks + 1, [], 0


if __name__ == "__main__":
    near, far = pty.openpty()
    tty.setraw(far)
    print(os.ttyname(far), flush=True)
    Device(near, int(sys.argv[1]) if len(sys.argv) > 1 else 1000).serve()
