"""What `monitor --out` leaves in a folder: the characteristic period as CSV, and one self-contained HTML report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from commissioner.monitor.chain import Observation
from commissioner.recordings.table import write_table
from commissioner.recordings.whole import folder_to_write, write_text
from commissioner.records import Signal
from commissioner.report.page import Page, render

CSV_NAME = "characteristic_period.csv"
REPORT_NAME = "report.html"


def write_results(folder: Path, observation: Observation, page: Page) -> dict[str, str]:
    """The two files; names and columns are the contract's, standard deviations are added columns."""
    folder_to_write(folder)
    csv, report = folder / CSV_NAME, folder / REPORT_NAME
    write_table(csv, columns_of(observation), {})
    write_text(report, render(page))
    return {"characteristic_period": str(csv), "report": str(report)}


def columns_of(observation: Observation) -> dict[str, Signal]:
    """`load_torque_nm` holds no numbers where the inertia is unknown."""
    period = observation.period
    empty = np.full(period.time_s.size, np.nan)
    return {
        "time_s": period.time_s,
        "shaft_angle_rad": period.shaft_angle_rad,
        "speed_rad_per_s": period.speed_rad_per_s,
        "electromagnetic_torque_nm": period.torque_nm,
        "load_torque_nm": empty if period.load_torque_nm is None else period.load_torque_nm,
        "speed_std_rad_per_s": period.speed_std,
        "electromagnetic_torque_std_nm": period.torque_std,
        "load_torque_std_nm": empty if period.load_torque_std is None else period.load_torque_std,
    }
