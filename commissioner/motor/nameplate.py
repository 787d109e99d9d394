"""What the plate on the motor says, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Nameplate:
    """Rated values. Voltage is line-to-line rms, current is line rms, whatever the connection."""

    rated_power_w: float
    rated_voltage_v: float
    rated_frequency_hz: float
    rated_current_a: float
    rated_speed_rpm: float
    power_factor: float
    pole_pairs: int
    connection: str  # "star" | "delta"
    inertia_kg_m2: float | None = None
