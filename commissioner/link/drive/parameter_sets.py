"""The motor parameters a drive holds: the set in use and the set in its memory, by the drive file's names."""

from __future__ import annotations

from collections.abc import Mapping

from commissioner.errors import DriveFault, UsageError
from commissioner.link.drive.items import Items, number
from commissioner.registers.codec import Value, encode_item
from commissioner.registers.profile import ParameterGroup, Store

Values = Mapping[str, float]


SHOWS_THE_OLD = (
    "it shows what stood there before the write: it did not take the value, or shows it late; look at its display after a minute, and where the "
    "new value stands there, give that time as parameters.settle_s in the drive file"
)


class ParameterSets:
    """Reads both sets, compares in the drive's own resolution, completes a wish."""

    def __init__(self, items: Items) -> None:
        self.items = items
        self.profile = items.profile

    @property
    def group(self) -> ParameterGroup:
        """The drive file's parameters. UsageError where it describes none."""
        if self.profile.parameters is None:
            raise UsageError(
                f"{self.profile.name} has no motor parameters that are known",
                step="read parameters",
                value=None,
                limit="a table [parameters] in the drive file",
                remedy=self.profile.unknown.get("parameters", "complete the drive file from the vendor's manual"),
            )
        return self.profile.parameters

    @property
    def can_store(self) -> bool:
        store = self.profile.store
        return self.group.is_staged or (store is not None and bool(store.writes or store.coil is not None))

    @property
    def store(self) -> Store:
        """How this drive stores; without a table in its file it does not."""
        return self.profile.store or Store(None)

    def in_use(self) -> dict[str, float]:
        return self._read("")

    def stored(self) -> dict[str, float]:
        """Empty where the drive cannot show its non-volatile set; its items are then not in the drive file."""
        return self._read("stored_")

    def store_count(self) -> int | None:
        """Writes of the drive's memory so far; None where it does not count them."""
        seen = self.items.read(["store_count"])
        return int(number(seen["store_count"])) if seen else None

    def differing(self, wanted: Values, held: Values) -> dict[str, float]:
        return {n: v for n, v in wanted.items() if not self.items.same_words(n, held[n], v)}

    def complete(self, values: Values, present: Values) -> dict[str, float]:
        """`present` with `values` in it. UsageError: not this drive's parameter, or no value of its register."""
        order = self.group.order
        for name in values:
            if name not in order:
                raise UsageError(
                    f"{name} is not one of the drive's motor parameters",
                    step="write parameters",
                    value=name,
                    limit=", ".join(order),
                    remedy=self.profile.unknown.get(name, "leave it out"),
                )
        prefix = "staged_" if self.group.is_staged else ""
        for name, value in values.items():
            encode_item(self.profile.item(prefix + name), value)
        return dict(present) | dict(values)

    def verify(
        self,
        wanted: Mapping[str, Value],
        seen: Mapping[str, Value],
        step: str,
        before: Mapping[str, Value] | None = None,
    ) -> None:
        """DriveFault where the drive holds something else. `before`: as it stood before the write."""
        for name, value in wanted.items():
            if not self.items.same_words(name, seen[name], value):
                raise DriveFault(
                    f"the drive holds {name} = {_as_registered(seen[name])} instead of {_as_registered(value)}",
                    step=step,
                    value=seen[name],
                    limit=value,
                    remedy=SHOWS_THE_OLD
                    if before is not None and self.items.same_words(name, seen[name], before[name])
                    else "the drive limits, rounds or recomputes the value; see its manual",
                )

    def _read(self, prefix: str) -> dict[str, float]:
        names = [prefix + name for name in self.profile.parameter_names]
        return {name.removeprefix(prefix): number(value) for name, value in self.items.read(names).items()}


def _as_registered(value: Value) -> Value:
    """As many digits as a register of 32 bits tells: 3.2, not 3.200000048."""
    return float(f"{value:.7g}") if isinstance(value, float) else value
