"""Page 1: is it good, by how much, whose, when, by whom, what the values hold for, what to do next, what nobody checked.
Who reads no further has missed nothing that he must do; where it went wrong, what to do stands above the fold."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from importlib.metadata import version

from markupsafe import Markup

from commissioner.motor.quantities import four_digits, plate_words
from commissioner.procedure.checks import check_name, check_unit
from commissioner.report.run.quantities import BY_FIELD, FOUR, QUANTITIES, Quantity
from commissioner.report.run.standing import Standing
from commissioner.report.run.subject import Record, Subject
from commissioner.report.sheet import marks
from commissioner.report.sheet.marks import Column, Text
from commissioner.report.sheet.numbers import digits, half_width, held, like, percent, signed, spelled, with_interval
from commissioner.report.sheet.words import NBSP, seen_and_limit, spoken, typeset

_COLUMNS = (
    Column("Parameter"),
    Column("Value ± 95 % interval", right=True),
    Column(Markup("Interval<br>in %"), right=True, label="Interval in %"),
    Column("Allowed", right=True),
    Column(Markup("In the drive<br>before"), right=True, label="In the drive before"),
    Column("Change", right=True),
    Column("Register", right=True),
    Column(Markup("Written = read back,<br>drive’s own number"), label="Written = read back"),
)
_SEEN = (("DC link in range", "DC link"), ("heatsink temperature", "Heatsink"))
"""What the checks saw of the drive."""


def certificate(subject: Subject) -> Markup:
    """The whole first page, for every way a run can end."""
    parts = [_verdict(subject)]
    if not subject.is_good:
        parts += [marks.section("Do this", marks.actions(_remedies(subject)), kind="first"), _why(subject)]
    parts.append(marks.strip(_strip(subject)))
    parts.append(marks.side_by_side(_motor(subject), _drive(subject), _measurement(subject), columns=3))
    if subject.parameters and subject.is_good:
        parts.append(marks.table(_COLUMNS, _rows(subject)))
        parts.append(
            marks.side_by_side(
                marks.section("What the values hold for", marks.facts(conditions(subject))),
                marks.section("What to do next", marks.actions(_next(subject))),
            )
        )
    elif subject.parameters:
        parts.append(marks.paragraph(_measured_but_refused(subject), kind="small"))
    parts.append(marks.section("Not checked", marks.unchecked(list(_unchecked(subject)))))
    parts.append(_signatures(subject))
    return Markup("\n").join(parts)


def _verdict(subject: Subject) -> Markup:
    title, sentence = _said(subject)
    mark = Markup('<span class="{}" style="display:contents">{}</span>').format(
        "ok" if subject.is_good else "bad", marks.GOOD if subject.is_good else marks.BAD
    )
    return Markup('<div class="verdict">{}<h1>{}</h1><p>{}</p></div>').format(mark, title, sentence)


def _said(subject: Subject) -> tuple[str, Text]:
    """Title and sentence; the title of a run that went wrong says what the drive holds."""
    tests = len(subject.tests)
    agree = f", the {spelled(tests, 'test')} agree" if tests > 1 else ""
    if subject.standing is Standing.ACCEPTED:
        return (
            "Accepted, not written: the drive holds its old values",
            f"Each value is surer than it must be{agree}, and {_within(subject)}. Nothing was written into the drive.",
        )
    if subject.is_good and not subject.parameters:
        return "Commissioned", Markup("{} {}").format(
            _said_by(subject.result["reason"]), _kept(subject) if subject.written else ""
        )
    if subject.is_good:
        return (
            f"Commissioned: {spelled(len(subject.written), 'value')} accepted, written and read back",
            f"Each value is surer than it must be{agree}, and {_within(subject)}. {_kept(subject)}",
        )
    reason = _said_by(subject.result["reason"])
    if subject.outcome == "rejected":
        return "Not good enough: nothing written", Markup("{} The drive is as it was found.").format(reason)
    title = {"aborted": "Aborted", "faulted": "Broken off by a fault"}.get(
        subject.outcome, subject.outcome.capitalize()
    )
    wrote = bool(subject.written)
    return f"{title}: {'see what the drive holds' if wrote else 'nothing written'}", reason


def _within(subject: Subject) -> str:
    return "the flux guard took the amplitude back" if subject.guard.get("acted") else "no limit was reached"


def _kept(subject: Subject) -> str:
    stored = subject.first("parameters_written").get("is_stored")
    return "The drive works with these values now" + (
        " and keeps them without supply." if stored else "; whether it keeps them without supply is not known."
    )


def _remedies(subject: Subject) -> Iterator[Text]:
    error = subject.result.get("error") or {}
    seen = set()
    for remedy in (error.get("remedy"), *(o["remedy"] for o in subject.result.get("objections") or ())):
        if remedy and remedy not in seen:
            seen.add(remedy)
            yield marks.coded(sentence(typeset(str(remedy))))
    if subject.written:
        yield marks.coded(f"Put the old values back: `commissioner restore {subject.run}`")
    yield "Go through the checks again, then measure again." if seen else "Measure again."


def _why(subject: Subject) -> Markup:
    error, objections = subject.result.get("error") or {}, subject.result.get("objections") or ()
    if objections:
        columns = (
            Column("What objects"),
            Column("Value", right=True),
            Column("Limit", right=True),
            Column("What makes it better"),
        )
        rows: list[tuple[Text, ...]] = [
            (spoken(str(o["what"])), *_weighed(o), marks.coded(sentence(typeset(str(o["remedy"]))))) for o in objections
        ]
        return marks.section("Why", marks.table(columns, rows), kind="why")
    columns = (Column("Step"), Column("Seen", right=True), Column("Limit", right=True), Column("What happened"))
    row = (
        typeset(str(error.get("step") or "—")), *_weighed(error), _said_by(error.get("what") or subject.result["reason"]),
    )  # fmt: skip
    return marks.section("Why", marks.table(columns, [row]), kind="why")


def _strip(subject: Subject) -> Iterator[tuple[Text, str, str]]:
    """Five numbers with what was allowed."""
    result = subject.result
    if subject.is_good and subject.parameters:
        nearest = max(FOUR, key=lambda quantity: _of_allowed(subject, quantity))
        std_percent = _std_percent(subject.parameters[nearest.field])
        allowed = subject.allowed_percent(nearest.field)
        yield (
            Markup("Nearest to limit: {}").format(nearest.symbol),
            f"± {digits(half_width(std_percent), 2)} %",
            f"allowed ± {digits(half_width(allowed), 2)} %" if allowed else "no limit set",
        )
        yield _apart(subject)
    else:
        yield (
            "Energised in all",
            _energised(result),
            _how_far(subject),
        )
        yield (
            "Written",
            "new values" if subject.written else "nothing",
            "see below" if subject.written else "drive as found",
        )
    peak_a, trip_a = subject.peak_current_a, subject.trip_current_a
    yield (
        "Highest current", f"{digits(peak_a, 3)} A" if peak_a else "none",
        f"limit {digits(trip_a, 3)} A peak" if trip_a else "",
    )  # fmt: skip
    flux, limit = subject.peak_flux_wb, subject.guard.get("limit_wb")
    yield (
        "Highest flux, by the guard", f"{digits(flux, 3)} Wb" if flux else "none",
        f"limit {digits(limit, 3)} Wb" if limit else "",
    )  # fmt: skip
    total = f"{subject.samples:,}".replace(",", " ")
    yield "Samples lost", str(subject.lost_samples), f"of {total}" if subject.samples else "none taken"


def _how_far(subject: Subject) -> str:
    """What was energised: tests of tones, or what comes before them."""
    if not subject.estimates and subject.samples:
        return "direct current; no test begun"
    return f"{spelled(len(subject.estimates), 'test')} begun"


def _apart(subject: Subject) -> tuple[Text, str, str]:
    spread: dict[str, float] = {
        k: v for k, v in (subject.result.get("dispersion") or {}).items() if v is not None and k in BY_FIELD
    }
    limit = (subject.plan.get("acceptance") or {}).get("axis_spread_percent")
    if len(subject.tests) < 2 or not spread:
        return "Tests apart", "one test", "not compared"
    name = max(spread, key=lambda key: spread[key])
    shown = Markup("Tests apart, most in {}").format(BY_FIELD[name].symbol)
    return shown, percent(spread[name]), f"allowed {limit:g} %" if limit else ""


def _motor(subject: Subject) -> Markup:
    plate = subject.plate
    rows: list[tuple[Text, Text]] = [
        ("Tag", subject.told("motor_tag") or marks.BLANK),
        ("Serial no.", subject.told("motor_serial") or marks.BLANK),
    ]
    if plate:
        rows.append(
            (
                "Plate",
                f"{plate_words(plate, plate['connection'])}, {four_digits(plate['rated_frequency_hz'])} Hz, "
                f"cos φ{NBSP}{plate['power_factor']:.2f}, {2 * plate['pole_pairs']:g}{NBSP}poles",
            )
        )
    winding = subject.result.get("winding_temperature_degc", subject.findings.winding_degc)
    rows.append(
        ("Winding", f"{digits(winding, 2)} °C, read by the drive" if winding is not None else "temperature not known")
    )
    rows.append(("Cable, load", subject.told("cable") or marks.BLANK))
    return marks.section("Motor", marks.facts(rows))


def _drive(subject: Subject) -> Markup:
    drive = subject.result.get("drive") or {}
    if not drive:
        return marks.section("Drive", marks.paragraph("It did not say who it is."))
    seen = {check_name(row["name"]): row for row in subject.result.get("checks") or ()}
    rows: list[tuple[Text, Text]] = [
        ("Type", str(drive["drive_type"])),
        ("Serial no.", _known(drive["serial_number"])),
        ("Firmware", _known(drive["firmware_version"])),
    ]
    if drive["map_version"] is not None:
        rows.append(("Register map", str(drive["map_version"])))
    if (rated := drive["rated_drive_current_a"]) is not None and math.isfinite(rated):
        rows.append(("Rated", f"{rated:.1f} A, switching at {1e-3 * drive['switching_frequency_hz']:g}{NBSP}kHz"))
    rows += [(words, seen_and_limit(seen[check], check_unit(check))[0]) for check, words in _SEEN if check in seen]
    return marks.section("Drive", marks.facts(rows))


def _measurement(subject: Subject) -> Markup:
    begun, origin, result = subject.begun, subject.origin, subject.result
    rows: list[tuple[Text, Text]] = []
    if begun:
        rows.append(("Begun, UTC", begun))
        if offset := origin.get("local_time"):
            rows.append(("Local", str(offset)))
    place = subject.told("place")
    rows.append(
        (
            "By",
            f"{origin.get('person') or 'not recorded'}{f', {place}' if place else ''}, at {origin.get('host') or 'no named host'}",
        )
    )
    axes = ", ".join(f"{test.axis_deg:g}°" for test in subject.tests)
    rows.append(
        (
            "Energised",
            _energised(result) + (f" in {spelled(len(subject.tests), 'test')}: {axes}" if axes else ""),
        )
    )
    if (seconds := subject.seconds) is not None:
        ahead = (
            ": the simulator ran ahead of time"
            if subject.is_simulated and seconds < (result["energised_s"] or 0.0)
            else ""
        )
        rows.append(("Clock", f"{seconds:.0f} s{ahead}"))
    return marks.section("Measurement", marks.facts(rows))


def _rows(subject: Subject) -> Iterator[tuple[Text, ...]]:
    for quantity in QUANTITIES:
        if quantity.field not in subject.parameters:
            continue
        measured = subject.parameters[quantity.field]
        value, half = quantity.factor * measured["value"], half_width(measured["std"], quantity.factor)
        old, allowed = subject.before.get(quantity.field), subject.allowed_percent(quantity.field)
        row = subject.written.get(quantity.field)
        yield (
            Markup("{} {}").format(quantity.symbol, quantity.words),
            Markup('<span class="val">{}</span> <span class="u">{}</span>').format(
                with_interval(value, half), quantity.unit
            ),
            f"± {digits(100 * half / abs(value), 2)} %" if half else "–",
            f"± {digits(half_width(allowed), 2)} %" if allowed else "–",
            f"{like(quantity.factor * old, half)} {quantity.unit}" if old else "–",
            f"{signed(100 * (measured['value'] / old - 1))} %" if old else "–",
            str(row["register"]) if row else "–",
            _held(quantity, row, half, subject),
        )


def _held(quantity: Quantity, row: Record | None, half: float, subject: Subject) -> Text:
    if row is None:
        return "not in the drive" if subject.written else "not written"
    same = row["after"] == row["read_back"]
    text = f"{like(quantity.factor * subject.in_si(row, 'read_back'), half)} {quantity.unit}"
    return marks.judged(
        text if same else f"{text}, not {held(quantity.factor * subject.in_si(row, 'after'))}", is_good=same
    )


def conditions(subject: Subject) -> Iterator[tuple[Text, Text]]:
    """What the values hold for: flux, temperature, circuit, and what an interval does not say."""
    result = subject.result
    flux, rated = result["holds_for_stator_flux_wb"], result["rated_flux_wb"]["stator_peak"]
    yield (
        "Flux",
        Markup("stator flux of {} Wb peak, {} of rated ({} Wb).{}").format(
            digits(flux, 3), f"{100 * flux / rated:.0f} %", digits(rated, 3), _bent(subject)
        ),
    )
    winding, cold = result.get("winding_temperature_degc"), result.get("stator_resistance_20degc_ohm")
    if winding is not None and cold:
        yield (
            "Temperature",
            Markup("winding {} °C; {} at 20 °C is {} Ω. The rotor’s temperature is not known.").format(
                digits(winding, 2), marks.R_S, with_interval(cold["value"], half_width(cold["std"]))
            ),
        )
    else:
        yield "Temperature", "not known: no sensor in the winding. Resistances hold for the motor as it was."
    yield (
        "Circuit",
        Markup(
            "one phase of the star equivalent, inverse-Γ, rotor seen from the stator. {} holds cable and devices. T circuit: appendix B."
        ).format(marks.R_S),
    )
    yield (
        "Interval",
        "every ± in this report is a 95 % interval. Not in it: an error common to all current sensors, or of the DC-link "
        "reading. 1 % of it moves every R and L by 1 %.",
    )


def _bent(subject: Subject) -> Markup:
    """How L_M moves with flux, at the ends of what was visited."""
    curve: Sequence[Record] = subject.result.get("magnetizing_curve") or ()
    if len(curve) < 2:
        return Markup("")
    return Markup(" {} is {}, {}.").format(marks.L_M, _on_curve(curve[-1]), _on_curve(curve[0]))


def _on_curve(point: Record) -> str:
    measured = point["magnetizing_inductance_h"]
    shown = with_interval(1e3 * measured["value"], half_width(measured["std"], 1e3))
    return f"{shown} mH at {digits(point['stator_flux_wb'], 3)} Wb"


def _next(subject: Subject) -> Iterator[Text]:
    if subject.standing is Standing.ACCEPTED:
        yield marks.coded(
            f"Write the values, if the drive shall work with them: `commissioner write-back {subject.run}`"
        )
    if (least := least_no_load_current_a(subject)) is not None:
        flux, current = least
        yield (
            f"Turn the motor unloaded under vector control. It must draw more than {digits(current, 3)} A rms at rated flux: "
            f"so much takes {digits(flux, 3)} Wb alone."
        )
    if subject.written:
        yield marks.coded(f"If it draws less or trips, put the old values back: `commissioner restore {subject.run}`")
    yield "Measure again when motor, cable or drive was changed."
    longer = subject.findings.longer_test
    if longer is not None:
        yield spoken(sentence(longer.sentence))


def least_no_load_current_a(subject: Subject) -> tuple[float, float] | None:
    """(peak stator flux in Wb, rms current in A) that this flux takes on the curve: i = psi_s / (L_M + L_sigma). A motor at
    rated flux draws more. None where no curve was measured or it reached the rated flux."""
    curve, rated = subject.result.get("magnetizing_curve") or (), subject.result["rated_flux_wb"]["stator_peak"]
    if not curve:
        return None
    top = curve[-1]
    flux = float(top["stator_flux_wb"])
    stator_h = top["magnetizing_inductance_h"]["value"] + subject.parameters["leakage_inductance_h"]["value"]
    return (flux, flux / stator_h / math.sqrt(2.0)) if flux < rated else None


def _measured_but_refused(subject: Subject) -> Markup:
    values = Markup(", ").join(
        Markup("{} {} {}").format(
            q.symbol,
            with_interval(
                q.factor * subject.parameters[q.field]["value"],
                half_width(subject.parameters[q.field]["std"], q.factor),
            ),
            q.unit,
        )
        for q in FOUR
        if q.field in subject.parameters
    )
    return Markup("Measured, not accepted, not to be used: {}.").format(values)


def _unchecked(subject: Subject) -> Iterator[Text]:
    yield "gain common to all current sensors, scale of the DC link"
    curve = subject.result.get("magnetizing_curve") or ()
    rated = (subject.result.get("rated_flux_wb") or {}).get("stator_peak")
    if subject.is_good and curve and rated:
        top = curve[-1]["stator_flux_wb"]
        if top < rated:
            yield Markup("{} above {} Wb ({} % of rated flux)").format(
                marks.L_M, digits(top, 3), f"{100 * top / rated:.0f}"
            )
    done, planned = subject.tests_done, len(subject.planned_deg)
    if planned > done:
        yield f"{spelled(planned - done, 'test')} of {planned}: the run ended before"
    yield "anything that turns: iron loss at speed, phase order, encoder"
    yield "insulation, earth, bearings, thermal protection"
    checks = subject.result.get("checks") or ()
    is_read = any("safe torque off" in row["name"] and row["has_passed"] and row["value"] is not None for row in checks)
    yield f"safe torque off: {'read as released, ' if is_read else ''}not tried"
    if subject.is_good:
        yield Markup("{} of a warm rotor: about 0.4 % more for each kelvin").format(marks.R_R)
    for row in checks:
        if row["value"] is None and row["has_passed"]:
            yield f"{row['name']}: the drive does not tell"


def _signatures(subject: Subject) -> Markup:
    person = subject.origin.get("person") or ""
    return Markup(
        '<p class="remarks">Remarks</p><div class="sign"><div></div><div></div><p><span>Measured by: {}</span>'
        "<span>date, signature</span></p><p><span>Accepted by</span><span>date, signature</span></p></div>"
        '<div class="id"><p>Check: <b>commissioner runs verify {}</b> compares every file of this run with its record, '
        "<b>commissioner replay {}</b> decides it again. commissioner {}.</p>"
        "<p>Measured with the drive’s own current and DC-link sensors, which are not traced to a standard: a record of "
        "measurement, not a calibration certificate. It speaks of this motor on this drive on this day.</p></div>"
    ).format(person, subject.run, subject.run, version("commissioner"))


def _of_allowed(subject: Subject, quantity: Quantity) -> float:
    allowed = subject.allowed_percent(quantity.field)
    return _std_percent(subject.parameters[quantity.field]) / allowed if allowed else 0.0


def _std_percent(measured: Record) -> float:
    return 100.0 * float(measured["std"] or 0.0) / abs(float(measured["value"]))


def _said_by(reason: object) -> Text:
    """A reason of the core as a sentence."""
    return sentence(spoken(str(reason)))


def _known(value: object) -> str:
    """What a drive file knows no register for is unknown, never 0."""
    return "unknown" if value is None or value == "" else str(value)


def _weighed(facts: Record) -> tuple[Text, Text]:
    """What was seen beside what was allowed."""
    seen, limit = seen_and_limit(facts, str(facts.get("unit") or ""))
    return Markup("<b>{}</b>").format(seen), limit


def sentence(text: str) -> str:
    """Begun with a capital, ended with a mark."""
    text = text.strip()
    return marks.capitalised(text) + ("" if text.endswith((".", "!", "?")) else ".")


def _energised(result: Record) -> str:
    seconds = result["energised_s"]
    return "not known" if seconds is None else f"{seconds:.1f} s"
