"""For looking up: checks and what happened (A), registers, record, procedure, circuit and conventions (B), uncertainty (C)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from markupsafe import Markup

from commissioner.report.run.quantities import BY_FIELD, FOUR, Quantity
from commissioner.report.run.standing import finding_sentences
from commissioner.report.run.subject import Record, Subject
from commissioner.report.sheet import marks
from commissioner.report.sheet.marks import Column, Text
from commissioner.report.sheet.numbers import digits, half_width, held, with_interval
from commissioner.report.sheet.words import check_words, seen_and_limit, spoken, typeset, with_symbols

_TOLD: Mapping[str, Callable[[Record], str]] = {
    "state_entered": lambda r: f"{r['state']}{_on_axis(r)}: {r['because']}",
    "first_current_seen": lambda r: (
        f"first current: {digits(r['current_a'][0], 3)} A at {digits(r['voltage_v'][0], 3)} V; "
        f"static inductance {digits(r['of_typical'], 2)} times a typical one"
    ),
    "staircase_fitted": lambda r: (
        f"direct currents: R_s {with_interval(r['stator_resistance_ohm'], half_width(r['stator_resistance_std_ohm']))} Ω to start from, "
        f"a leg loses {digits(r['error_voltage_v'], 3)} V"
    ),
    "first_look": lambda r: (
        f"all samples so far fitted: a leg loses {digits(r['leg_error_v'], 3)} V, delay {digits(1e6 * r['delay_s'], 3)} µs"
    ),
    "guard_acted": lambda r: (
        f"{r['advice'].replace('_', ' ').lower()}: flux {100 * r['flux_fraction']:.0f} % of the limit, amplitude now {digits(r['scale'], 2)} of the plan"
    ),
    "axis_finished": lambda r: (
        f"{'first look' if r['is_look'] else 'test'}{_on_axis(r)} done after {digits(r['energised_s'], 3)} s: "
        f"flux to {100 * r['peak_flux_fraction']:.0f} % of the limit, "
        + "{lost_samples} samples lost; {why}".format(**r)
    ),
    "verdict_reached": lambda r: f"verdict: {r['decision']}; {r['reason']}",
    "parameters_written": lambda r: (
        f"{len(r['written'])} values written and read back{', stored' if r['is_stored'] else ''}"
    ),
    "error": lambda r: "{} (step {}, seen {}, limit {})".format(
        r.get("what", "failure"), r.get("step"), *seen_and_limit(r, r.get("unit") or "")
    ),
    "disarmed": lambda r: (
        f"output off, {'confirmed by the drive: ' + str(r['verified']['state']) if r['verified']['is_confirmed'] else 'NOT confirmed'}; {r['because']}"
    ),
    "run_ended": lambda r: f"{r['outcome']}: {r['reason']}",
}
"""What is told of the journal, each kind of record in its own words."""
_MOST_EVENTS = 60
_UNITS = (("_per_s", "1/s"), ("_s", "s"), ("seconds", "s"), ("_percent", "%"), ("_fraction", "of rated"))
"""Of a procedure's numbers, by how their keys end."""
_T_MODEL = (
    ("R", "s", "stator resistance", "stator_resistance_ohm", 1.0, "Ω"),
    ("R", "r", "rotor resistance", "rotor_resistance_ohm", 1.0, "Ω"),
    ("L", "ls", "stator leakage", "stator_leakage_h", 1e3, "mH"),
    ("L", "lr", "rotor leakage", "rotor_leakage_h", 1e3, "mH"),
    ("L", "m", "magnetizing inductance", "magnetizing_inductance_h", 1e3, "mH"),
)
_CIRCUIT = Markup(
    '<svg class="f" viewBox="0 0 331 74" role="img" aria-label="Inverse-Gamma circuit: R s and L sigma in series, then L M beside R R">'
    '<g fill="#fff" stroke="#14181b" stroke-width="1.1"><path fill="none" d="M20 18H60M104 18H134M178 18H284V26M214 18V26M214 56V66M284 56V66M20 66H284"/>'
    '<circle cx="17" cy="18" r="3"/><circle cx="17" cy="66" r="3"/><rect x="60" y="12" width="44" height="12"/><rect x="278" y="26" width="12" height="30"/></g>'
    '<g fill="none" stroke="#14181b" stroke-width="1.3"><path d="M134 18a5.5 5.5 0 0 1 11 0a5.5 5.5 0 0 1 11 0a5.5 5.5 0 0 1 11 0a5.5 5.5 0 0 1 11 0"/>'
    '<path d="M214 26a5 5 0 0 1 0 10a5 5 0 0 1 0 10a5 5 0 0 1 0 10"/></g>'
    '<text class="k" x="82" y="8" text-anchor="middle">R<tspan dy="2" font-size="7">s</tspan></text>'
    '<text class="k" x="156" y="8" text-anchor="middle">L<tspan dy="2" font-size="7">σ</tspan></text>'
    '<text class="k" x="224" y="44">L<tspan dy="2" font-size="7">M</tspan></text>'
    '<text class="k" x="296" y="44">R<tspan dy="2" font-size="7">R</tspan></text></svg>'
)
_CONVENTIONS: tuple[tuple[Text, Text], ...] = (
    ("Phase", "one phase of the star equivalent. Between two terminals: twice. A delta winding: three times."),
    ("Size", "currents, voltages and flux along an axis are peak values of space vectors; plate values are rms."),
    (
        "Inverse-Γ",
        "all leakage on the stator side; rotor quantities are those that a vector control turns the rotor flux with.",
    ),
    ("Interval", "1.96 standard errors on each side. What has no interval has three digits."),
)
_TERMS: tuple[tuple[str, str], ...] = (
    ("Noise of the current sensors", "in the interval; estimated from the residual of each test, widened where the residual is not white."),
    ("The inverter’s loss", "in the interval: fitted with the motor from the same samples, its law's doubt added."),
    ("Time between voltage and current", "in the interval: fitted as a delay common to a test."),
    ("Bent iron", "in the interval: fitted as a curve over the flux that was reached; not extrapolated."),
    ("Differences between axes", "in the interval: where tests differ by more than their noise, the scatter counts."),
    ("Gain common to all sensors, DC-link scale", "not in the interval. 1 % of it moves every R and L by 1 %; the plate bounds it loosely."),
    ("Temperature", "the stator's is the drive's reading, where there is one; the rotor's is not known: copper and aluminium change by 0.4 % a kelvin."),
    ("Frequency", "the rotor's resistance holds at the frequencies of the test; at slip frequency a deep bar has less."),
    ("Higher flux", "above the highest flux visited nothing was measured."),
    ("Rotation", "iron loss at speed, slotting and everything that turns is not in a test at standstill."),
)  # fmt: skip


def checks_and_course(subject: Subject) -> Markup:
    """Appendix A."""
    parts = [Markup("<h2>A. Checks, and what happened</h2>")]
    checks = subject.result.get("checks") or ()
    if checks:
        columns = (Column("Check"), Column("Seen", right=True), Column("Wanted", right=True), Column("Result"))
        parts.append(marks.table(columns, (_check(row) for row in checks), "keep dense checks"))
    events = [line for line in subject.journal if line["kind"] in _TOLD]
    if events:
        shown = events[:_MOST_EVENTS]
        parts.append(Markup("<h3>In order</h3>"))
        course = (_event(line) for line in shown)
        parts.append(marks.table((Column("UTC"), Column("What happened")), course, "cards dense"))
        if len(events) > len(shown):
            parts.append(marks.paragraph(f"{len(events) - len(shown)} more in journal.jsonl.", kind="small"))
    return Markup("\n").join(parts)


def _check(row: Record) -> tuple[Text, ...]:
    good = bool(row["has_passed"])
    result = marks.judged("passed" if good else "failed", is_good=good)
    return (
        *map(with_symbols, check_words(row)),
        result if good else Markup("{} {}").format(result, row["remedy"]),
    )


def _event(line: Record) -> tuple[Text, ...]:
    try:
        told = _TOLD[line["kind"]](line["record"])
    except (KeyError, TypeError, IndexError):  # of an older archive, or damaged
        told = str(line["kind"]).replace("_", " ")
    return str(line["utc"])[11:23], spoken(marks.capitalised(told))


def _on_axis(record: Record) -> str:
    axis = record.get("axis_deg")
    return f" at {axis:g}°" if axis is not None else ""


def registers_and_record(subject: Subject, digest: str | None = None) -> Markup:
    """Appendix B. `digest`: SHA-256 of result.json as it is now; a diagnosis after the run has written it anew since the folder was
    closed."""
    files = subject.first("folder_closed").get("files") or {}
    here = [*["registers"] * bool(subject.written), *["record"] * bool(files), "procedure", "circuit"]
    parts = [Markup("<h2>B. {}</h2>").format(marks.capitalised(", ".join(here)))]
    if subject.written:
        columns = (
            Column("Register"), Column("Parameter"), Column("Old", right=True), Column("Written", right=True),
            Column("Read back", right=True), Column("Unit"), Column("Compared"),
        )  # fmt: skip
        parts.append(marks.table(columns, _registers(subject)))
    if files:
        now = {"result.json": digest} if digest else {}
        digests = [
            (name, Markup('<span class="hash">{}</span>').format(now.get(name, facts["sha256"])))
            for name, facts in sorted(files.items())
            if name != "report.html"
        ]
        parts.append(Markup("<h3>The record, SHA-256</h3>") + marks.facts(digests))
    parts.append(marks.side_by_side(_procedure(subject), _circuit(subject)))
    return Markup("\n").join(parts)


def _registers(subject: Subject) -> Iterator[tuple[Text, ...]]:
    for name, row in subject.written.items():
        quantity = BY_FIELD.get(name)
        if quantity is None:
            continue
        own = "per_si" in row
        factor, unit = (1.0, "the drive’s own") if own else (quantity.factor, quantity.unit)
        old, after, back = (held(factor * row[key]) for key in ("before", "after", "read_back"))
        yield (
            str(row["register"]), Markup("{} {}").format(quantity.symbol, quantity.words), old, after, back, unit,
            marks.judged("equal" if after == back else "differs", is_good=after == back),
        )  # fmt: skip


def _procedure(subject: Subject) -> Markup:
    rows: list[tuple[Text, Text]] = []
    plan = subject.plan
    if plan:
        axes = ", ".join(f"{axis:g}°" for axis in plan["axes_deg"])
        is_repeated = len(subject.planned_deg) > len(plan["axes_deg"])
        rows.append(("axes", f"{axes}{', the first again' if is_repeated else ''}"))
    for group in ("limits", "excitation", "supervision"):
        rows += [(key, _set(key, value)) for key, value in (plan.get(group) or {}).items()]
    for key, value in (plan.get("acceptance") or {}).items():
        here = f" (± {digits(half_width(value), 2)} % here)" if key.endswith("std_percent") else ""
        rows.append((key, f"{_set(key, value)}{here}"))
    return marks.section("Procedure, as run: the keys of its file", marks.facts(rows), level=3) if rows else Markup("")


def _set(key: str, value: float) -> str:
    """A number of the procedure in the unit that its key ends with."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g} {next((unit for ending, unit in _UNITS if key.endswith(ending)), '')}".rstrip()


def _circuit(subject: Subject) -> Markup:
    model = subject.result.get("t_model")
    parts: list[Text] = []
    if model and subject.is_good:
        columns = (Column("T circuit"), Column("Value ± 95 % interval", right=True))
        rows = [
            (
                Markup("{} {}").format(marks.symbol(letter, index), words),
                f"{with_interval(factor * model[name]['value'], half_width(model[name]['std'], factor))} {unit}",
            )
            for letter, index, words, name, factor, unit in _T_MODEL
        ]
        parts.append(marks.table(columns, rows, "keep dense"))
        parts.append(
            marks.paragraph(
                spoken(
                    f"Assumed: {model['assumption']}. At standstill four values can be measured; the fifth of a T circuit is "
                    "always an assumption. The intervals do not hold it."
                ), kind="small",
            )
        )  # fmt: skip
    conventions = marks.facts(_CONVENTIONS), marks.figure("The circuit of this report, one axis", _CIRCUIT)
    if not parts:
        return marks.section("Conventions", *conventions, level=3)
    parts += [Markup("<h3>Conventions</h3>"), *conventions]
    return marks.section("T circuit, for simulators that want one", *parts, level=3)


def uncertainty(subject: Subject) -> Markup:
    """Appendix C; empty where there is nothing that could be uncertain, and nothing was remarked."""
    parts = []
    if subject.parameters:
        terms = Markup("").join(
            Markup("<div><dt>{}</dt> <dd>{}</dd></div>").format(name, typeset(words)) for name, words in _TERMS
        )
        parts.append(Markup('<dl class="termlist flow">{}</dl>').format(terms))
    if subject.tests and subject.parameters:
        columns = (
            Column("Test"),
            *(Column(Markup("{}, {}").format(q.symbol, q.unit), right=True) for q in FOUR),
            Column("Residual is white", right=True),
        )
        parts.append(marks.table(columns, (_test(axis) for axis in subject.result.get("axes") or ()), "cards dense"))
        parts.append(marks.paragraph("Each test at the flux that it reached itself.", kind="small"))
    remarks = [*finding_sentences(subject.result), *(str(remark) for remark in subject.result.get("remarks") or ())]
    if remarks:
        lines = Markup("").join(Markup("<li>{}</li>").format(spoken(f"{marks.capitalised(r)}.")) for r in remarks)
        parts.append(Markup('<h3>Remarks of the estimator</h3><ul class="lines">{}</ul>').format(lines))
    return Markup("\n").join([Markup("<h2>C. Uncertainty</h2>"), *parts]) if parts else Markup("")


def _test(axis: Record) -> tuple[Text, ...]:
    def cell(quantity: Quantity) -> str:
        measured = axis["parameters"][quantity.field]
        return with_interval(quantity.factor * measured["value"], half_width(measured["std"], quantity.factor))

    white = axis["whiteness"]
    shown = f"{'yes' if white['is_white'] else 'no'}: {digits(white['statistic'], 2)} of {digits(white['limit'], 3)}"
    return f"{axis['axis_deg']:g}° at {digits(axis['peak_stator_flux_wb'], 3)} Wb", *(cell(q) for q in FOUR), shown
