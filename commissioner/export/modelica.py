"""A Modelica record with the names of `Modelica.Electrical.Machines` (squirrel cage, T circuit; Modelica Standard Library 4)."""

from __future__ import annotations

from commissioner.export.found import CONVENTION, Found

_RECORD = """record {name} "Induction machine of run {run}, {utc}"
  // {convention}.
  // T circuit under an assumption: {assumption}. Lm holds at a peak stator flux of {flux:.6g} Wb.
  extends Modelica.Icons.Record;
  import Modelica.Units.SI;
  parameter Integer p = {poles} "Pole pairs";
  parameter SI.Frequency fNominal = {frequency:.9g} "Rated frequency";
  parameter SI.Resistance Rs = {r_s!r} "Stator resistance of a phase";
  parameter SI.Inductance Lssigma = {l_ls!r} "Stator leakage of a phase";
  parameter SI.Inductance Lm = {l_m!r} "Main field inductance of a phase";
  parameter SI.Inductance Lrsigma = {l_lr!r} "Rotor leakage, referred to the stator";
  parameter SI.Resistance Rr = {r_r!r} "Rotor resistance, referred to the stator";
end {name};
"""


def as_record(found: Found) -> bytes:
    """One record; its name is the run's."""
    t = {name: quantity.value for name, quantity in found.t_model.items()}
    name = "Motor_" + "".join(c if c.isalnum() and c.isascii() else "_" for c in found.run)
    return _RECORD.format(
        name=name, run=found.run, utc=found.utc, convention=CONVENTION, assumption=found.t_assumption,
        flux=found.holds_for_wb, poles=int(found.plate["pole_pairs"]), frequency=float(found.plate["rated_frequency_hz"]),
        r_s=t["stator_resistance_ohm"], l_ls=t["stator_leakage_h"], l_m=t["magnetizing_inductance_h"],
        l_lr=t["rotor_leakage_h"], r_r=t["rotor_resistance_ohm"],
    ).encode()  # fmt: skip
