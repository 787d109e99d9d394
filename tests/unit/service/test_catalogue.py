"""The German page: every sentence that a page, a check, a guard or a refusal can show has its translation."""

import ast
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from babel.messages.pofile import read_po
from jinja2 import Environment
from jinja2.ext import extract_from_ast

import commissioner
from commissioner.diagnose.causes import CATALOGUE
from commissioner.link.files.drive_file import known_drives, load_profile
from commissioner.link.wire import modbus
from commissioner.link.wire.modbus import READ_REMEDIES, REMEDIES
from commissioner.procedure.checks import keeps_up
from commissioner.procedure.link_plan import StreamPace
from commissioner.procedure.tuned import TuneVerdict
from commissioner.service.page import band, frame, texts, words
from commissioner.service.page.texts import Texts
from commissioner.service.simulator import SCENARIOS

PRODUCT = Path(commissioner.__file__).parent
PAGE = PRODUCT / "service" / "page"
SAID = ("procedure/checks.py", "procedure/verdict.py", "safety/watch.py", "safety/sensors.py", "procedure/energised", "run/runner.py", "run/inspection.py",
        "link/drive/foreign.py", "run/stopping", "run/holding/mastery.py", "service/routes", "service/page", "service/runs", "service/access/visitors.py", "service/archive.py",
        "service/problems.py", "service/library.py", "service/recordings.py", "service/simulator.py", "operations/history/runs.py", "run/ending.py", "run/archive/documents.py", "run/write_accepted.py", "run/restore.py", "run/holding", "run/tuning",
        "link/drive", "link/wire/modbus.py", "link/wire/trust.py", "identify/inverter", "identify/batch", "identify/intake", "identify/estimate", "identify/analysis.py", "procedure/tuned.py", "recordings", "operations/recordings")  # fmt: skip
"""Where the core's and the service's own sentences come from that every technician may meet."""
FACTS = ("what", "title", "remedy")
NOT_SHOWN = re.compile(
    r"^there is no 7 7$|POST /api|choose one of these$|^7 in the drive$|nameplate7$|^7 is 7$|^7: 7$|^$"
)
"""Of scripts alone; a file's name before a sentence that stands elsewhere; and the drive's plate, whose checks have a name for each of its keys."""


@pytest.fixture(scope="module")
def catalogue():
    with (PAGE / "catalogues" / "de.po").open("rb") as file:
        return {m.id: m for m in read_po(file, locale="de") if m.id}


def template_messages():
    environment = Environment(extensions=["jinja2.ext.i18n"], trim_blocks=True, lstrip_blocks=True)
    environment.newstyle_gettext = True
    for path in sorted(PAGE.rglob("templates/**/*.html")):
        for _line, _function, message in extract_from_ast(environment.parse(path.read_text("utf-8")), ("_",)):
            yield from (m for m in ([message] if isinstance(message, str) else message or ()) if m)


def script_messages():
    """What the scripts ask for by `say("...")`, also where they choose between two."""
    for path in sorted((PAGE / "static" / "js").glob("*.js")):
        text = path.read_text("utf-8")
        for call in re.findall(r"\bsay\(([^;]*?)\)", text):
            yield from re.findall(r'"((?:[^"\\]|\\.){3,})"', call.partition(", number")[0])


def python_messages():
    for path in sorted(PAGE.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr in ("gettext", "say")
                and node.args
            ):
                yield from (
                    c.value for c in ast.walk(node.args[0]) if isinstance(c, ast.Constant) and isinstance(c.value, str)
                )
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "View":
                yield node.args[1].value


def names():
    yield from words.SCRIPT_TEXTS
    yield from frame.STEPS
    yield from band.PARTS.values()
    yield from (text for cause in CATALOGUE.values() for text in (cause.title, cause.advice) if text)
    yield from (name.replace("_", " ") for name in CATALOGUE)
    yield " or "
    yield from (quantity.name for quantity in words.QUANTITIES)
    yield from (scenario.replace("_", " ") for scenario in SCENARIOS)
    yield from ("commissioned", "rejected", "aborted", "faulted", "cut off", "passed", "not passed")


def shown(node):
    """A literal with its gaps, each as something that a value might be."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value]
    if isinstance(node, ast.JoinedStr):
        return ["".join(part.value if isinstance(part, ast.Constant) else "7" for part in node.values)]
    if isinstance(node, ast.IfExp):
        return shown(node.body) + shown(node.orelse)
    if isinstance(node, ast.BinOp):
        return [first + second for first in shown(node.left) for second in shown(node.right)]
    return []


def core_sentences():
    """Every `what` and `remedy` of the places in SAID."""
    files = [
        path
        for place in SAID
        for path in ([PRODUCT / place] if place.endswith(".py") else sorted((PRODUCT / place).rglob("*.py")))
    ]
    for path in files:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            function = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
            if function in ("CheckResult", "Objection", "StopReason", "_outside", "_below", "refused", "not_ready"):
                found = [text for argument in (*node.args[:1], *node.args[-1:]) for text in shown(argument)]
            elif {keyword.arg for keyword in node.keywords} & {"remedy"} and function not in ("_refused", "replace"):
                first = node.args[1:2] if function == "Refusal" else node.args[:1]
                found = [text for argument in first for text in shown(argument)]
                found += [text for keyword in node.keywords if keyword.arg in FACTS for text in shown(keyword.value)]
            else:
                continue
            yield from ((path.name, text) for text in found if " " in text and not NOT_SHOWN.search(text))


def of_tables():
    """What the table of a recording is refused for, behind the file's name, and what to do."""
    for node in ast.walk(ast.parse((PRODUCT / "recordings/table.py").read_text("utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "_refuse":
            yield from (f"7: {text}" for text in shown(node.args[1]))
            yield from shown(node.args[-1])


def of_remarks():
    """What is said beside the values of a recording's identification."""
    for place in ("identify/intake", "identify/estimate", "identify/analysis.py"):
        for path in sorted((PRODUCT / place).rglob("*.py")) or [PRODUCT / place]:
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.FunctionDef) and node.name in (
                    "_remarks",
                    "sentence",
                    "remark",
                    "besides_the_axis",
                ):
                    yield from sentences_of(node.body[1:] if isinstance(node.body[0], ast.Expr) else node.body)
                elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "remarks":
                    yield from sentences_of([node.value])


def sentences_of(nodes):
    """The outermost literals; of an axis' sentence within another the inner one stands by itself."""
    for node in nodes:
        if found := shown(node):
            yield from (text for text in found if len(re.findall(r"[a-z]{3,}", text)) > 2)
        else:
            yield from sentences_of(ast.iter_child_nodes(node))


def of_audits():
    """What the audit of a recording saw, and its limits."""
    for path in sorted((PRODUCT / "identify/intake").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "refused":
                yield from (text for argument in node.args[1:3] for text in shown(argument))


def of_tunings():
    """What the drive files say to whoever stands at the drive, and what is said of every tuning."""
    for name in known_drives():
        if (tuning := load_profile(name).tuning) is not None:
            yield from (tuning.energises, tuning.proof, *(step.text for step in tuning.steps if step.text))
    rows = (), (SimpleNamespace(values=(1.0,)),)
    yield from (
        TuneVerdict(row, (), {}, names).reason
        for row in rows
        for names in ((), ("stator_resistance", "no_load_current"))
    )


def test_every_message_of_templates_scripts_and_pages_has_its_translation(catalogue):
    wanted = {*template_messages(), *script_messages(), *python_messages(), *names()}
    assert len(wanted) > 400
    assert sorted(wanted - set(catalogue)) == []
    assert sorted(m for m in wanted if not catalogue[m].string) == []


def test_what_scripts_say_is_handed_to_them():
    asked = {message for message in script_messages() if not message.startswith("#")}
    assert asked <= set(words.SCRIPT_TEXTS) | {"operator"}


def test_every_sentence_of_checks_guards_and_refusals_has_its_translation():
    german = Texts("de")
    missing = sorted(
        {f"{place}: {text}" for place, text in core_sentences() if not german.knows(text.removesuffix(", degC"))}
    )
    assert missing == []


def test_what_a_recordings_table_is_refused_for_has_its_translation():
    german, told = Texts("de"), set(of_tables())
    assert len(told) > 30
    assert sorted(text for text in told if not german.knows(text)) == []


def test_what_is_said_of_a_recording_that_is_identified_has_its_translation():
    german, remarks = Texts("de"), set(of_remarks())
    assert len(remarks) > 12
    assert sorted(text for text in remarks if not german.knows(text)) == []
    told = {text: german.short(text) for text in of_audits()}
    kept = {
        text: set(re.findall(r"[a-z]{3,}", text)) & set(re.findall(r"[a-z]{3,}", said)) for text, said in told.items()
    }
    names = {"voltage", "axis", "deg", "sample", "period", "kind", "standstill", "modulo"}
    assert len(told) > 20
    assert {text: words - names for text, words in kept.items() if words - names} == {}


PORT = "check the drive's supply, the cable, and that device=1 is its number there"
LONGER = "an answer that needs longer gets it by reply=SECONDS in the address"


@pytest.mark.parametrize(
    "said",
    [
        *(f"no answer to '{what}'" for what in ("read 6 registers at 97", "read 1 register at 97", "write 3 registers at 34 and read 125 at 256", "write register 7")),
        "no answer to 'read 6 registers at 97'; the link was slow: an answer took 0.21 s",
        "nothing in 0.25 s", "7 of the answer's 9 bytes in 0.25 s", "the connection broke: x", "an answer of device 2", "an answer of device 1 within 0.25 s",
        *(f"{where}; {LONGER}" for where in (modbus.SILENT, modbus.DISTURBED, PORT, f"see that Modbus TCP, and nothing else, answers on this port; {PORT}")),
        "check that the drive is set to 9600 Bd, parity E, 1 stop and to device 2; then its supply and the cable; " + LONGER,
        f"take the motor as live: isolate the drive's supply, then look at its status; {modbus.SILENT}; {LONGER}",
        f"use a link that answers sooner and evenly: a cable in place of radio, VPN or gateway; {modbus.SILENT}; {LONGER}",
        f"run restore again, until then the drive's parameters are not known; {modbus.SILENT}; {LONGER}",
        *modbus.EXCEPTION_MEANINGS.values(),
    ],
)  # fmt: skip
def test_what_is_said_of_a_drive_that_has_gone_is_told_in_german(said):
    """Nobody needs these words more: a drive that fell silent was told in English on a German page."""
    left = set(re.findall(r"[a-z]{3,}", Texts("de").tell(said))) & set(re.findall(r"[a-z]{3,}", said))
    assert left <= {"device", "reply", "parity", "stop", "odbus"}


def test_what_to_do_about_each_refused_request_has_its_translation():
    german = Texts("de")
    remedies = {remedy.format(device=7) for table in (REMEDIES, READ_REMEDIES) for remedy in table.values()}
    assert {remedy for remedy in remedies if not german.knows(remedy)} == set()


def of_checks():
    """What every check may show as seen and as its limit."""
    for file in ("procedure/checks.py", "run/inspection.py"):
        for node in ast.walk(ast.parse((PRODUCT / file).read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "CheckResult":
                yield from (text for argument in node.args[2:4] for text in shown(argument))
    for pace in (
        StreamPace(0.0005, 29, 120, 80, slowest_s=0.02, kept_samples=400),
        StreamPace(0.0072, 29, 120, 80, most_averaged=8),
        StreamPace(0.012, 29, 120, 80, most_averaged=8),
        StreamPace(0.08, 29, 120, 80, most_averaged=40, kept_samples=20000),
        StreamPace(3.0, 29, 120, 80, most_averaged=8, request_s=0.15),
    ):
        for check in keeps_up(pace, 2e-4):
            yield from (str(check.value), str(check.limit))


def test_what_a_check_saw_and_its_limit_are_told_in_german():
    german = words.Words(Texts("de"))
    kept = {}
    for text in of_checks():
        told = german.check_value({"name": "", "value": text}), german.check_limit({"name": "", "limit": text})
        english = set(re.findall(r"[a-zA-Z]{3,}", text)) - {"rad", "negative"}  # words of both languages
        kept[text] = [english & set(re.findall(r"[a-zA-Z]{3,}", german)) for german in told]
    assert len(kept) > 15
    assert {text: left for text, left in kept.items() if all(left)} == {}


def test_what_is_said_of_a_drives_own_tuning_has_its_translation():
    """Above all that nobody may be at the motor."""
    told = {sentence: Texts("de").tell(sentence) for sentence in of_tunings()}
    assert len(told) > 10
    assert [sentence for sentence, german in told.items() if german == sentence or "stator" in german] == []


def test_a_translation_fills_the_gaps_of_its_message(catalogue):
    for message in catalogue.values():
        assert set(re.findall(r"%\(\w+\)s", message.id)) >= set(re.findall(r"%\(\w+\)s", message.string)), message.id
        assert re.findall(r"%[sknab]\b", message.id).sort() == re.findall(r"%[sknab]\b", message.string).sort()
        assert message.id.count("%%") == message.string.count("%%"), message.id
        assert sorted(re.findall(r"</?sub>", message.id)) == sorted(re.findall(r"</?sub>", message.string))


def test_a_sentence_with_values_is_told_with_them():
    german = Texts("de")
    assert german.tell("a connection within 0.25 s") == "eine Verbindung innerhalb von 0,25 s"
    assert german.tell("no connection to 10.0.0.1:502") == "keine Verbindung zu 10.0.0.1:502"
    assert german.tell("there is no run %s <b>") == "es gibt keinen Lauf %s <b>"
    assert german.tell("never heard of") == "never heard of" and not german.knows("never heard of")


def test_what_has_no_translation_says_its_language():
    told = words.Words(Texts("de")).sentence("never <heard> of")
    assert told == '<span lang="en">Never &lt;heard&gt; of</span>'
    assert words.Words(Texts("en")).sentence("never <heard> of") == "Never &lt;heard&gt; of"


def test_what_the_core_writes_for_a_console_is_set_as_a_page_sets_it():
    told = words.Words(Texts("en")).sentence("they lie +12.0 +- 0.3 us behind; L_M <holds> at 75% of sqrt(3)")
    assert told == "They lie +12.0 ± 0.3\u00a0µs behind; L<sub>M</sub> &lt;holds&gt; at 75\u00a0% of √3"
    assert Texts("de").short(3.7, "ohm") == "3,7\u00a0Ω"


def test_numbers_are_written_as_the_language_writes_them():
    assert Texts("de").number(-3.14159, 3, "Ω") == "\u22123,142\u00a0Ω"
    assert Texts("en").number(-0.0001, 2, "A") == "0.00\u00a0A"
    assert Texts("de").short(0.25, "s") == "0,25\u00a0s"
    assert texts.LANGUAGES == ("en", "de")
