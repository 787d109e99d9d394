"""How help looks, and that calling one verb does not read the others."""

from __future__ import annotations

import inspect

import pytest

from commissioner.cli.app import app
from commissioner.cli.failures import run_to_exit
from commissioner.cli.groups import runs
from commissioner.cli.help import PURPOSES, only

VERBS = [name for names in PURPOSES.values() for name in names]


def said(capsys, *arguments: str) -> str:
    with pytest.raises(SystemExit) as end:
        run_to_exit(only(app, arguments), list(arguments))
    assert end.value.code == 0
    return capsys.readouterr().out


def test_each_verb_has_one_purpose():
    commands = [one.name or one.callback.__name__ for one in app.registered_commands]
    groups = [one.name for one in app.registered_groups]
    assert sorted(VERBS) == sorted([*commands, *groups])


def test_the_help_has_each_verb_under_its_purpose_in_ascii(capsys):
    text = said(capsys, "--help")
    first_words = [line.split()[0] for line in text.splitlines() if line.startswith("  ") and line.strip()]
    assert [word for word in first_words if word in VERBS] == VERBS
    assert all(f"{purpose}:" in text for purpose in PURPOSES)
    assert text.isascii()


@pytest.mark.parametrize("verb", VERBS)
def test_only_the_verb_that_is_called_for_is_read(verb, capsys):
    lean = only(app, [verb, "--json"])
    assert len(lean.registered_commands) + len(lean.registered_groups) == 1
    assert f"Usage: commissioner {verb} " in said(capsys, verb, "--help")


@pytest.mark.parametrize("arguments", [(), ("--help",), ("--version", "run"), ("ran",)])
def test_all_are_read_where_no_verb_is_named_first(arguments):
    assert only(app, arguments) is app


def leaves(group, *path):
    for command in group.registered_commands:
        yield (*path, command.name or command.callback.__name__)
    for inner in group.registered_groups:
        yield from leaves(inner.typer_instance, *path, inner.name)


@pytest.mark.parametrize("verb", list(leaves(app)), ids=" ".join)
def test_every_verb_takes_json(verb, capsys):
    assert " --json " in said(capsys, *verb, "--help")


def test_list_and_find_differ_in_their_words_only():
    """Their thirteen options stood twice."""
    find, listing = (inspect.signature(act, eval_str=True).parameters for act in (runs.runs_find, runs.runs_list))
    assert list(find.items())[1:] == list(listing.items())
    assert [name for name in find if name not in listing] == ["text"]
