"""`python -m sim.vendors.serve NAME`: an ordinary drive on Modbus TCP, its keypad on standard input, its answer key at the end.

Keypad: a line each of `tune`, `remote`, `off-on`. Serves until SIGTERM.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import signal
import socket
import struct
import sys
import time

from sim.vendors.drive import TUNINGS, Habits, VendorDrive
from sim.vendors.face import faces, read_face


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0; 2 for a name there is no file of."""
    parser = argparse.ArgumentParser(prog="python -m sim.vendors.serve", description=__doc__)
    parser.add_argument("name", metavar="NAME", help=f"one of {', '.join(faces())}, or the path of a file")
    parser.add_argument("--tcp", type=int, default=0, metavar="PORT", help="0 = any free port")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tuning", action="append", choices=TUNINGS, help="how the tunings go, in turn")
    parser.add_argument("--tuning-s", type=float, default=4.0)
    parser.add_argument("--enter", action="store_true", help="values are in use after an Enter only")
    parser.add_argument("--turnaround", type=float, help="seconds before each answer; unless given, the file's")
    parser.add_argument("--busy-s", type=float, default=0.0, help="so long after a write it refuses the next")
    parser.add_argument("--late-s", type=float, default=0.0, help="so long it shows the value before a write")
    parser.add_argument("--refuses-from", type=int, metavar="N", help="it takes no parameter from the Nth on")
    options = parser.parse_args(arguments)
    if options.name not in faces() and not options.name.endswith(".toml"):
        parser.error(f"there is no drive named {options.name}")
    habits = Habits(
        tuple(options.tuning or ["good"]), options.tuning_s, options.enter, busy_s=options.busy_s, late_s=options.late_s,
        refuses_from=options.refuses_from,
    )  # fmt: skip
    face = read_face(options.name)
    drive = VendorDrive(face, time.monotonic, habits=habits, seed=options.seed)
    _serve(drive, options.tcp, face.turnaround_s if options.turnaround is None else options.turnaround)
    sys.stdout.write(json.dumps(drive.truth()) + "\n")
    return 0


def _serve(drive: VendorDrive, port: int, turnaround_s: float) -> None:
    stopped: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopped.append(1))
    listener = socket.create_server(("127.0.0.1", port))
    sys.stdout.write(f"listening tcp 127.0.0.1:{listener.getsockname()[1]}\n")
    sys.stdout.flush()
    with selectors.SelectSelector() as ready:  # takes /dev/null and files too, which epoll refuses
        ready.register(listener, selectors.EVENT_READ, "new")
        if _has_keypad():
            ready.register(sys.stdin, selectors.EVENT_READ, "key")
        while not stopped:
            for key, _ in ready.select(0.05):
                _one(drive, ready, key, listener, turnaround_s)
    listener.close()


def _has_keypad() -> bool:
    """Standard input is there; of a terminal only in its foreground: what is typed there is else the shell's."""
    if sys.stdin is None or sys.stdin.closed:
        return False
    return not sys.stdin.isatty() or not hasattr(os, "tcgetpgrp") or os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()


def _one(
    drive: VendorDrive,
    ready: selectors.BaseSelector,
    key: selectors.SelectorKey,
    listener: socket.socket,
    turnaround_s: float,
) -> None:
    if key.data == "new":
        line, _ = listener.accept()
        line.settimeout(2.0)
        ready.register(line, selectors.EVENT_READ, "line")
    elif key.data == "key":
        text = sys.stdin.readline()
        if not text:
            ready.unregister(sys.stdin)
        press(drive, text.strip())
    else:
        line = key.fileobj
        assert isinstance(line, socket.socket)
        if not _answer(drive, line, turnaround_s):
            ready.unregister(line)
            line.close()


def press(drive: VendorDrive, key: str) -> None:
    """One key of the keypad."""
    actions = {"tune": drive.press_tune, "remote": drive.press_remote, "off-on": drive.power_cycle}
    if key in actions:
        actions[key]()


def _answer(drive: VendorDrive, line: socket.socket, turnaround_s: float) -> bool:
    """False where the other end has gone."""
    try:
        header = _take(line, 7)
        number, _, length, unit = struct.unpack(">HHHB", header)
        reply = drive.answer(_take(line, length - 1))
        time.sleep(turnaround_s)
        if reply is not None:
            line.sendall(struct.pack(">HHHB", number, 0, len(reply) + 1, unit) + reply)
    except (OSError, EOFError, struct.error):
        return False
    return True


def _take(line: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        piece = line.recv(count - len(data))
        if not piece:
            raise EOFError
        data += piece
    return data


if __name__ == "__main__":
    sys.exit(main())
