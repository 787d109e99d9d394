"""What the technician sees while a run goes: states as lines, one progress bar while the motor is energised."""

from __future__ import annotations

import math
from dataclasses import asdict
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn

from commissioner.cli.screens import screen
from commissioner.procedure import findings as told
from commissioner.report.sheet.words import check_words


class LiveView:
    """Call it with every record of a run; use it as a context so that the bar is closed."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bar = Progress(
            TextColumn("    {task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[numbers]}"),
            console=console,
            transient=True,
        )
        self._task: TaskID | None = None

    def __enter__(self) -> LiveView:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, record: object) -> None:
        match record:
            case told.WarmingUp():
                self._line("[dim]preparing the observer (compiles on the first run, about a minute)[/]")
            case told.LeftUnfinished(sentence=sentence):
                self._line(f"    [yellow]{escape(sentence)}[/]")
            case told.Diagnosing(seconds=seconds):
                self._line(
                    f"[bold]diagnosing the samples[/]  [dim]the drive is let go; at most {seconds:.0f} s, Ctrl-C ends it[/]"
                )
            case told.StateEntered(state=state, axis_deg=axis):
                self._line(f"[bold]{state}[/]" + (f"  [dim]axis {axis:g}°[/]" if axis is not None else ""))
            case told.DriveIdentified():
                self._drive(record)
            case told.ChecksJudged():
                self._checks(record)
            case told.StaircaseFitted():
                self._close()
                self._line(
                    f"    start values: R_s {record.stator_resistance_ohm:.3g} Ω, "
                    f"a leg of the inverter loses {record.error_voltage_v:.3g} V"
                )
            case told.FirstLook(parameters=(r_s, r_r, l_s, l_m)):
                self._line(
                    f"    so far: R_s {r_s:.4g} Ω, R_R {r_r:.4g} Ω, L_σ {1e3 * l_s:.4g} mH, L_M {1e3 * l_m:.4g} mH, "
                    f"a leg loses {record.leg_error_v:.3g} V"
                )
            case told.LinkPlanned():
                self._line(f"    [yellow]slow link:[/] {escape(record.plan)}")
            case told.ExcitationChosen():
                volts = sum(amplitude for amplitude, _, _ in record.tones)
                tones = ", ".join(f"{frequency:.4g}" for _, frequency, _ in record.tones)
                what = "first look: " if record.is_look else ""
                self._line(f"    {what}{record.seconds:.3g} s of {tones} Hz, {volts:.3g} V where all peaks meet")
            case told.BiasChosen():
                self._close()
                self._line(
                    f"    then {record.seconds:.3g} s on a direct current of {record.bias_a:.3g} A"
                    if record.seconds
                    else "    no direct current beside tones: none worth its time fits under the limits"
                )
            case told.EstimateUpdated():
                self._progress(record)
            case told.GuardActed(flux_fraction=flux, current_fraction=current, scale=scale):
                what = f"flux would reach {flux:.0%}" if flux > current else f"current would reach {current:.0%}"
                self._line(f"    [yellow]guard: {what} of its limit, amplitude reduced to {scale:.0%}[/]")
            case told.AxisFinished():
                self._close()
                state = "; settled" if record.has_settled else f"; not settled, {record.why}"
                self._line(
                    f"    {record.energised_s:.1f} s, flux to {record.peak_flux_fraction:.0%} of the limit"
                    + ("" if record.is_look else state)
                )
            case told.VerdictReached():
                self._line(f"    verdict: [bold]{record.decision}[/], {escape(record.reason)}")
            case told.ParametersWritten():
                self._line(f"    {len(record.written)} parameters written, {screen.kept(record.is_stored)}")
                if record.wear_fraction is not None and record.store_count is not None:
                    self._line(f"    {screen.wear(record.store_count, record.wear_fraction)}")
            case told.StepProgress():
                self._show(f"axis {record.axis_deg:g}°", record.fraction, record.numbers)

    def _drive(self, drive: told.DriveIdentified) -> None:
        """Who answered; a commercial drive's file may name neither number, firmware, current nor control period."""
        facts = [f"#{drive.serial_number}, firmware {drive.firmware_version}"] if drive.serial_number else []
        facts += [f"{drive.rated_drive_current_a:g} A"] if math.isfinite(drive.rated_drive_current_a) else []
        facts += [f"{1e6 * drive.control_period_s:g} µs"] if math.isfinite(drive.control_period_s) else []
        self._line(f"    {escape(drive.drive_type)} {', '.join(facts) or '(its file names no serial number)'}")

    def _checks(self, record: told.ChecksJudged) -> None:
        failed = [result for result in record.results if not result.has_passed]
        self._line(f"    {len(record.results) - len(failed)} of {len(record.results)} checks passed")
        for result in failed:
            name, seen, wanted = check_words(asdict(result))
            self._line(f"    [red]✗ {escape(f'{name}: {seen}, wanted {wanted}')}[/]")

    def _progress(self, record: told.EstimateUpdated) -> None:
        r_s, r_r, l_sigma, l_m = record.parameters
        self._show(
            f"axis {record.axis_deg:g}°",
            record.time_s / max(record.planned_s, record.time_s, 1e-9),
            f"{record.time_s:4.1f} s  flux {record.flux_fraction:4.0%} of limit  "
            f"R_s {r_s:.3g} R_R {r_r:.3g} Ω  L_σ {1e3 * l_sigma:.3g} L_M {1e3 * l_m:.3g} mH",
        )

    def _show(self, what: str, fraction: float, numbers: str) -> None:
        if self._task is None:
            self._task = self._bar.add_task(what, total=1.0, numbers="")
        self._bar.update(self._task, completed=fraction, description=what, numbers=numbers)

    def _close(self) -> None:
        if self._task is not None:
            self._bar.remove_task(self._task)
            self._task = None

    def _line(self, text: str) -> None:
        self._bar.console.print(text)
