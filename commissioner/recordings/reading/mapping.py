"""What the user says about columns that their names do not tell: `--map MAP.toml`, or comment lines in the file.

    [columns]
    "CH1" = "current_u_a"            # as it stands, in ampere
    "CH2" = "-current_v_a * 10"      # turned, 10 A per unit of the file
    [metadata]
    sample_period_s = 0.0001

In a file the same as comment lines: `# CH1: current_u_a`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from commissioner.errors import ConfigurationError, UsageError
from commissioner.recordings.table import CONTRACT_COLUMNS, HOW_TO_MAP
from commissioner.settings import read_toml

MAX_MAP_BYTES = 100_000
TARGET = re.compile(r"(-?)\s*([a-z][a-z0-9_]*)\s*(?:\*\s*([0-9.eE+-]+))?")


@dataclass(frozen=True)
class Target:
    """The contract's column that a channel is, and the factor from its numbers to SI (None: by the file's unit)."""

    column: str
    factor: float | None = None
    is_turned: bool = False


@dataclass(frozen=True)
class ChannelMap:
    """Targets by the channel's name in the file, and metadata that hold beside the file's own."""

    columns: Mapping[str, Target] = field(default_factory=dict)
    metadata: Mapping[str, float | str] = field(default_factory=dict)


def read_mapping(path: Path) -> ChannelMap:
    """The mapping in a TOML file; ConfigurationError names the entry that cannot be used."""
    if not path.is_file() or path.stat().st_size > MAX_MAP_BYTES:
        raise UsageError(
            f"there is no mapping {path}", step="read mapping", value=str(path), limit="a TOML file of columns",
            remedy="give --map MAP.toml; " + HOW_TO_MAP,
        )  # fmt: skip
    raw = read_toml(path)
    for section in raw:
        if section not in {"columns", "metadata"} or not isinstance(raw[section], dict):
            raise ConfigurationError(
                file=str(path), key=section, value=raw[section], expected="[columns] and [metadata]"
            )
    columns = {name: _target(str(path), name, text) for name, text in raw.get("columns", {}).items()}
    metadata = {k: _plain(str(path), k, v) for k, v in raw.get("metadata", {}).items()}
    return ChannelMap(columns, metadata)


def _plain(file: str, name: str, value: object) -> float | str:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ConfigurationError(file=file, key=name, value=value, expected="a number or a text")
    return value if isinstance(value, str) else float(value)


def _target(file: str, name: str, text: object) -> Target:
    found = target_in(text) if isinstance(text, str) else None
    if found is None:
        raise ConfigurationError(
            file=file, key=name, value=text,
            expected='a column of the contract, as "current_u_a", "-current_v_a" or "voltage_uv_v * 1000"',
        )  # fmt: skip
    return found


def target_in(text: str) -> Target | None:
    """The target that a text means, or None."""
    found = TARGET.fullmatch(text.strip())
    if not found or (found[2] not in CONTRACT_COLUMNS and found[2] != "ignore"):
        return None
    try:
        factor = float(found[3]) if found[3] else None
    except ValueError:
        return None
    if factor is not None and not (math.isfinite(factor) and factor > 0):
        return None
    return Target(found[2], factor, bool(found[1]))


def mapping_in(metadata: Mapping[str, float | str], names: tuple[str, ...]) -> dict[str, Target]:
    """Targets that comment lines give to channels of this file."""
    by_name = {name.strip().lower(): name for name in names}
    found = {}
    for said, value in metadata.items():
        name = by_name.get(said.strip().lower()) or by_name.get(said.strip().removeprefix("map ").lower())
        target = target_in(value) if name and isinstance(value, str) else None
        if name and target:
            found[name] = target
    return found
