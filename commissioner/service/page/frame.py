"""What every page shares: template engine, session, band, language and appearance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, cast

from fastapi import Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from jinja2 import ChainableUndefined, Environment, FileSystemLoader, select_autoescape

from commissioner.service.access.accounts import Role
from commissioner.service.access.pages import local, seen_at
from commissioner.service.access.visitor import Visitor, check_role, check_token
from commissioner.service.access.visitors import LOCAL, parts_of, visitor_of
from commissioner.service.page.band import Place, band_of
from commissioner.service.page.texts import LANGUAGES, Texts, texts_of
from commissioner.service.page.words import SCRIPT_TEXTS, Words
from commissioner.service.problems import Refusal
from commissioner.service.routes.access import set_cookie

TEMPLATES = Path(__file__).parent / "templates"
STEPS = ("Drive", "Motor", "Checks", "What will happen", "Measure", "Result", "Write back", "Done")
THEMES = ("light", "dark")
NOWHERE = Place()


@dataclass(frozen=True)
class View:
    """Which template, and where in the work it stands: `step` 1 ... 8, or None beside the work; `nav` the menu's entry."""

    template: str
    title: str
    step: int | None = None
    nav: str = "commission"


@cache
def environment() -> Environment:
    """The templates, for every language; everything that is not marked safe is escaped."""
    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=select_autoescape(["html"]),
        undefined=ChainableUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
        extensions=["jinja2.ext.i18n"],
    )


@cache
def words_of(language: str) -> Mapping[str, Callable[..., Any] | Texts | Words]:
    """What templates say and write numbers with, in one language."""
    texts = Texts(language)
    scratch = Environment(extensions=["jinja2.ext.i18n"])
    scratch.install_gettext_callables(texts.gettext, texts.ngettext, newstyle=True)  # type: ignore[attr-defined]
    gettext = cast("Callable[..., str]", scratch.globals["gettext"])
    said: dict[str, Callable[..., Any] | Texts | Words] = {
        "gettext": gettext,
        "_": gettext,
        "tell": texts.tell,
        "t": texts,
        "w": Words(texts),
    }
    return said | {"n": texts.number, "signed": texts.signed, "short": texts.short, "told": texts.with_error}


def prepare() -> None:
    """Compile every template and read every catalogue."""
    for name in environment().list_templates(extensions=["html"]):
        environment().get_template(name)
    for language in LANGUAGES:
        words_of(language)


def prepare_causes() -> None:
    """The names of causes, which bring numba along: in a thread, once the first page is out."""
    import commissioner.diagnose.causes  # noqa: F401


def render(request: Request, view: View, place: Place = NOWHERE, *, status: int = 200, **context: Any) -> Response:
    """The page, with a session where the browser has none yet."""
    parts, who, texts = parts_of(request), visitor_of(request), texts_of(request)
    is_new = who.session is None and who.role is not None
    if is_new:
        session = parts.sessions.begin(LOCAL, Role.OPERATOR, is_logged_in=False)
        who = Visitor(who.person, who.role, who.address, session)
    band = band_of(parts, who, place, texts)
    theme = request.cookies.get("theme", "")
    html = (
        environment()
        .get_template(view.template)
        .render(
            **words_of(texts.language),
            view=view,
            place=place,
            band=band,
            who=who,
            csrf=who.session.csrf if who.session else "",
            steps=STEPS,
            roles=Role,
            theme=theme if theme in THEMES else "",
            language=texts.language,
            version=request.app.version,
            path=seen_at(request),
            script_texts={message: texts.gettext(message) for message in SCRIPT_TEXTS},
            parts=parts,
            **context,
        )
    )
    response = HTMLResponse(html, status)
    if is_new and who.session is not None:
        set_cookie(parts, response, who.session)
    return response


def enter(request: Request, role: Role = Role.VIEWER) -> Visitor:
    """Who looks at a page. Redirects to the log-in where nobody is known."""
    who = visitor_of(request)
    if who.role is None:
        raise ToLogin(seen_at(request))
    check_role(who, role)
    return who


async def enter_form(request: Request, role: Role = Role.OPERATOR) -> tuple[Visitor, dict[str, str]]:
    """Who sends a form, and its fields; the form carries the session's token."""
    who = enter(request, role)
    form = await request.form(max_files=0, max_fields=60)
    fields = {key: value for key, value in form.items() if isinstance(value, str)}
    check_token(who, fields.get("csrf", ""))
    return who, fields


class ToLogin(Exception):
    """Nobody is known; after the log-in back to `path`."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.path = path


def go(path: str) -> RedirectResponse:
    """After a form: look at the page with GET."""
    return RedirectResponse(local(path), 303)


def refused(
    request: Request, refusal: Refusal, place: Place = NOWHERE, back: str = "/", *, restore: bool = False
) -> Response:
    """A refusal as a page: step, value, limit, what to do; `restore`: above all the old values of the run it is about."""
    view = View("frame/refused.html", "Not done", None)
    return render(
        request, view, place, status=refusal.problem.status, problem=refusal.problem, back=local(back), restore=restore
    )


def remember(response: Response, fields: dict[str, str]) -> None:
    """Language and appearance, in cookies that say nothing else."""
    if fields.get("language") in LANGUAGES:
        response.set_cookie("language", fields["language"], max_age=31536000, samesite="strict", path="/")
    if fields.get("theme") in THEMES:
        response.set_cookie("theme", fields["theme"], max_age=31536000, samesite="strict", path="/")
