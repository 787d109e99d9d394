"""What the service was asked to be: addresses, folders, drives. A TOML file in, a frozen record out."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from pydantic import Field

from commissioner.errors import ConfigurationError, UsageError
from commissioner.settings import TestAngle, load
from commissioner.validation import FileTable

Identifier = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,39}$")]
Name = Annotated[str, Field(min_length=1, max_length=80)]


class DriveTable(FileTable):
    """One drive: how it is called, where it answers, which drive file describes it."""

    id: Identifier
    name: Name
    url: Annotated[str, Field(min_length=6, max_length=400)]
    profile: Annotated[str, Field(min_length=1, max_length=200)] = "simulated"


class SimulatorTable(FileTable):
    """How `python -m sim` is started when somebody wants to try without a drive."""

    scenario: Annotated[str, Field(pattern=r"^[A-Za-z0-9_]{1,40}$")] = "default"
    speed: Annotated[str, Field(pattern=r"^(max|[0-9.]{1,6})$")] = "1"
    seed: Annotated[int, Field(ge=0, le=2**31)] = 1


class TlsTable(FileTable):
    certificate: str
    key: str


class ServiceTable(FileTable):
    runs: str = ""
    data: str = ""
    names: list[Annotated[str, Field(max_length=253)]] = Field(default=[])
    page_lost_s: Annotated[float, Field(ge=1, le=60)] = 5.0
    hand_over_s: Annotated[float, Field(ge=1, le=600)] = 15.0
    session_idle_s: Annotated[float, Field(ge=1, le=86400)] = 1800.0
    diagnosis: bool = True
    axes_deg: list[TestAngle] = Field(default=[])
    """Of runs from the page, in electrical degrees; none: the procedure's own."""


class ServiceFile(FileTable):
    """The file of `serve --config`."""

    service: ServiceTable = ServiceTable()
    tls: TlsTable | None = None
    simulator: SimulatorTable = SimulatorTable()
    drives: list[DriveTable] = Field(default=[])


@dataclass(frozen=True)
class Settings:
    """Everything the service needs to know before it starts."""

    runs: Path
    data: Path
    host: str = "127.0.0.1"
    port: int = 8321
    file: ServiceFile = field(default_factory=ServiceFile)

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer can reach the service."""
        return is_loopback(self.host)

    @property
    def scheme(self) -> str:
        return "https" if self.file.tls else "http"

    def host_names(self) -> frozenset[str]:
        """The names under which a browser may call the service."""
        loopback = {"127.0.0.1", "localhost", "[::1]"}
        return frozenset({*loopback, bracketed(self.host), *self.file.service.names})


def load_settings(config: Path | None, *, host: str, port: int, runs: Path) -> Settings:
    """The service's settings. ConfigurationError names file and key."""
    file = ServiceFile() if config is None else load(config, ServiceFile)
    beside = config.parent if config is not None else Path()
    archive = beside / file.service.runs if file.service.runs else runs
    data = beside / file.service.data if file.service.data else archive / ".service"
    tls = file.tls and TlsTable(certificate=str(beside / file.tls.certificate), key=str(beside / file.tls.key))
    settings = Settings(archive, data, host, port, file.model_copy(update={"tls": tls}))
    if tls is not None:
        for path in (tls.certificate, tls.key):
            if not Path(path).is_file():
                raise ConfigurationError(file=str(config), key="tls", value=path, expected="an existing PEM file")
    return settings


def check_may_listen(settings: Settings, has_accounts: bool) -> None:
    """UsageError: another host than this computer needs TLS and accounts."""
    if settings.is_loopback:
        return
    missing = [] if settings.file.tls else ["[tls] certificate and key in the file of --config"]
    missing += [] if has_accounts else ["an account: `commissioner accounts add NAME --role operator`"]
    if missing:
        raise UsageError(
            f"the service does not listen on {settings.host} as it is", step="serve", value=settings.host,
            limit="127.0.0.1, or TLS and accounts", remedy="add " + " and ".join(missing),
        )  # fmt: skip


def is_loopback(host: str) -> bool:
    """Whether an address or name is this computer's own."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def bracketed(host: str) -> str:
    """As it stands in a URL."""
    return f"[{host}]" if ":" in host and not host.startswith("[") else host
