"""`python -m sim.vendors.serve NAME`: an ordinary drive on Modbus TCP or RTU, its keypad on standard input, its answer key at the end.

Keypad: a line each of `tune`, `remote`, `off-on`. Serves until SIGTERM.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import signal
import socket
import sys
import time

from sim.vendors.drive import TUNINGS, Habits, VendorDrive
from sim.vendors.face import faces, read_face
from sim.vendors.lines import RtuLine, TcpLine


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0; 2 for a name there is no file of; 5 where port or device cannot be had."""
    parser = argparse.ArgumentParser(prog="python -m sim.vendors.serve", description=__doc__)
    parser.add_argument("name", metavar="NAME", help=f"one of {', '.join(faces())}, or the path of a file")
    parser.add_argument("--tcp", type=int, default=0, metavar="PORT", help="0 = any free port")
    parser.add_argument("--rtu", metavar="PATH", help="serve Modbus RTU instead, on a serial device or `pty`")
    parser.add_argument("--baud", type=int, default=19200, help="of --rtu")
    parser.add_argument("--parity", choices="NEO", default="N", help="of --rtu: none, even, odd")
    parser.add_argument("--device", type=int, default=1, help="of --rtu: the drive's number")
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
    turnaround_s = face.turnaround_s if options.turnaround is None else options.turnaround
    try:
        way_in = (
            RtuLine(options.rtu, options.baud, options.parity, options.device)
            if options.rtu
            else socket.create_server(("127.0.0.1", options.tcp))
        )
    except OSError as error:
        sys.stderr.write(f"sim: {error}\n")
        return 5
    _serve(drive, way_in, turnaround_s)
    sys.stdout.write(json.dumps(drive.truth()) + "\n")
    return 0


def _serve(drive: VendorDrive, way_in: socket.socket | RtuLine, turnaround_s: float) -> None:
    stopped: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopped.append(1))
    with selectors.SelectSelector() as ready:  # takes /dev/null and files too, which epoll refuses
        if isinstance(way_in, RtuLine):
            ready.register(way_in, selectors.EVENT_READ, "line")
            where = f"rtu {way_in.address}"
        else:
            ready.register(way_in, selectors.EVENT_READ, "new")
            where = f"tcp 127.0.0.1:{way_in.getsockname()[1]}"
        sys.stdout.write(f"listening {where}\n")
        sys.stdout.flush()
        if _has_keypad():
            ready.register(sys.stdin, selectors.EVENT_READ, "key")
        while not stopped and way_in.fileno() >= 0:  # an adapter may be unplugged
            for key, _ in ready.select(0.05):
                _one(drive, ready, key, turnaround_s)
    way_in.close()


def _has_keypad() -> bool:
    """Standard input is there; of a terminal only in its foreground: what is typed there is else the shell's."""
    if sys.stdin is None or sys.stdin.closed:
        return False
    return not sys.stdin.isatty() or not hasattr(os, "tcgetpgrp") or os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()


def _one(drive: VendorDrive, ready: selectors.BaseSelector, key: selectors.SelectorKey, turnaround_s: float) -> None:
    where = key.fileobj
    if key.data == "new":
        assert isinstance(where, socket.socket)
        ready.register(TcpLine(where.accept()[0]), selectors.EVENT_READ, "line")
    elif key.data == "key":
        text = sys.stdin.readline()
        if not text:
            ready.unregister(sys.stdin)
        press(drive, text.strip())
    else:
        assert isinstance(where, TcpLine | RtuLine)
        if not where.serve(drive.answer, turnaround_s):
            ready.unregister(where)
            where.close()


def press(drive: VendorDrive, key: str) -> None:
    """One key of the keypad."""
    actions = {"tune": drive.press_tune, "remote": drive.press_remote, "off-on": drive.power_cycle}
    if key in actions:
        actions[key]()


if __name__ == "__main__":
    sys.exit(main())
