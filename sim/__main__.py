"""`python -m sim`: the simulated inverter as a server, a recording, or an answer key."""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import signal
import ssl
import sys
from pathlib import Path

from sim.scenario import Scenario, ScenarioError, build, read_document


def main(arguments: list[str] | None = None) -> int:
    """Exit code: 0 done, 2 what was asked for cannot be, 5 a port or device cannot be had."""
    options = _parser().parse_args(arguments)
    from sim.wire.faults import FaultError

    try:
        document = read_document(options.scenario)
        if document.get("kind") == "running":
            return _record_running(document, options)
        scenario = build(document, options.scenario)
        if options.recording:
            return _record_standstill(scenario, options)
        return _serve(scenario, options)
    except (ScenarioError, FaultError, ValueError) as error:
        sys.stderr.write(f"sim: {error}\n")
        return 2
    except OSError as error:
        sys.stderr.write(f"sim: {error}\n")
        return 5


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m sim",
        description=__doc__,
        epilog="A served drive answers once `ready` is printed; the first start compiles for up to a minute before. Ctrl-C ends it.",
    )
    parser.add_argument("--scenario", default="default", help="name of a scenario (--list), or a TOML file")
    parser.add_argument("--tcp", type=_port, default=-1, metavar="PORT", help="serve Modbus TCP; 0 = any free port")
    parser.add_argument("--rtu", default="", metavar="PATH", help="serve Modbus RTU on a serial device, or `pty`")
    parser.add_argument("--baud", type=int, default=921600, help="of --rtu")
    parser.add_argument("--parity", choices="NEO", default="N", help="of --rtu: none, even, odd")
    parser.add_argument("--pace", action="store_true", help="a pty is as slow as its baud rate")
    parser.add_argument(
        "--turnaround-ms",
        type=float,
        default=0.0,
        metavar="MS",
        help="with --pace: time before the drive begins its answer",
    )
    parser.add_argument(
        "--tls", type=_port, default=-1, metavar="PORT", help="serve Modbus over TLS; 0 = any free port"
    )
    parser.add_argument("--cert", type=Path, help="server certificate (PEM)")
    parser.add_argument("--key", type=Path, help="its key (PEM)")
    parser.add_argument("--ca", type=Path, help="certificate authority that client certificates must come from")
    parser.add_argument(
        "--speed",
        default="1",
        help="1: real time; N: N times as fast; `max`: as fast as the samples are fetched, for CI and busy computers",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the simulated noise")
    parser.add_argument("--nvm", type=Path, help="file that is the drive's non-volatile memory")
    parser.add_argument("--state-log", type=Path, help="JSON lines of what is really true")
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="NAME[:ARG][@WHEN]",
        help="a fault on the wire or in the drive, as lost@700 or sample_gap:5@e1.0s; repeatable; an unknown name is answered with those there are",
    )
    parser.add_argument("--truth", action="store_true", help="print the answer key as JSON")
    parser.add_argument("--recording", type=Path, metavar="FILE", help="write a recording (.csv, .csv.gz, .parquet)")
    parser.add_argument("--list", action="store_true", help="list the scenarios")
    return parser


def _port(text: str) -> int:
    """A TCP port, 0 for any free one."""
    if not text.isascii() or not text.isdigit() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port: 0 ... 65535")
    return int(text)


def _speed(text: str) -> float:
    if text == "max":
        return 0.0
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 1000.0:
        raise ScenarioError(f"--speed {text!r}: must be `max` or a number in (0, 1000]")
    return value


def _print_truth(truth: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(truth, indent=1, default=float) + "\n")
    sys.stdout.flush()


def _serve(scenario: Scenario, options: argparse.Namespace) -> int:
    from sim.truth import answer_key
    from sim.wire.pace import Pace
    from sim.wire.server import serve
    from sim.wire.station import Options

    if options.list:
        return _list()
    if options.truth:
        _print_truth(answer_key(scenario, options.seed))
    if options.tcp < 0 and options.tls < 0 and not options.rtu:
        return 0 if options.truth else _nothing_to_do()
    serving = Options(
        _speed(options.speed),
        options.seed,
        options.nvm,
        options.state_log,
        tuple(options.fault),
        options.tcp,
        options.tls,
        _tls(options) if options.tls >= 0 else None,
        options.rtu,
        options.baud,
        options.parity,
        Pace(options.baud, 1e-3 * options.turnaround_ms) if options.pace else Pace(),
    )
    asyncio.run(_serve_until_signal(scenario, serving, serve))
    return 0


async def _serve_until_signal(scenario, serving, serve) -> None:
    from sim.wire.station import ready_url

    def announce(text: str) -> None:
        """`listening KIND ADDRESS` for programs; what a person copies goes to stderr."""
        gc.freeze()  # looking through all that compiling has left would let a master wait for 0.3 s
        _announce(text)
        _, kind, address = text.split(" ", 2)
        sys.stderr.write(f'ready: --drive "{ready_url(kind, address, serving)}"\n')
        sys.stderr.flush()

    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (
        "SIGINT",
        "SIGTERM",
        "SIGBREAK",
    ):  # the last is Windows' Ctrl-Break; its loop has no handlers of its own
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: loop.call_soon_threadsafe(stop.set))
    await serve(scenario, serving, announce, stop)


def _announce(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def _list() -> int:
    from sim.scenario import names

    sys.stdout.write("\n".join(names()) + "\n")
    return 0


def _nothing_to_do() -> int:
    sys.stderr.write("sim: nothing to do: give --tcp PORT, --tls PORT, --rtu PATH, --recording FILE or --truth\n")
    return 2


def _tls(options: argparse.Namespace) -> ssl.SSLContext:
    missing = [name for name in ("cert", "key", "ca") if getattr(options, name) is None]
    if missing:
        raise ScenarioError(f"--tls needs --{' --'.join(missing)}")
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=str(options.ca))
    context.verify_mode = ssl.CERT_REQUIRED
    context.load_cert_chain(options.cert, options.key)
    return context


def _record_standstill(scenario: Scenario, options: argparse.Namespace) -> int:
    from sim.recordings.standstill import record, write_table

    columns, metadata, truth = record(scenario, options.seed)
    write_table(options.recording, columns, metadata)
    if options.truth:
        _print_truth(truth)
    return 0


def _record_running(document: dict[str, object], options: argparse.Namespace) -> int:
    from sim.recordings.standstill import write_table

    if "course" in document:
        from sim.motoring.recording import build as motoring
        from sim.motoring.recording import record as played

        columns, metadata, truth = played(motoring(document, options.scenario), options.seed)
    else:
        from sim.recordings.running import record

        columns, metadata, truth = record(document, options.seed)
    if options.recording:
        write_table(options.recording, columns, metadata)
    if options.truth:
        _print_truth(truth)
    return 0 if options.recording or options.truth else _nothing_to_do()


if __name__ == "__main__":
    sys.exit(main())
