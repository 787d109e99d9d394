"""Threshold voltage of the switches and diodes."""

from __future__ import annotations

from commissioner.diagnose.causes.cause import Confounder, Words
from commissioner.diagnose.causes.inverter.legs import BOTH, COMPENSATE, HARMLESS, LegLoss, at_half_the_frequency
from commissioner.diagnose.causes.setting import Setting
from commissioner.diagnose.kernels.kinds import LEGS
from commissioner.diagnose.plant.model import Term


class DeviceDrop(LegLoss):
    """v_x = v_x* - V_th(|i_x|) sign(i_x), V_th >= 0 [V]. Its own terms exist only where dead time can be told from it."""

    name = "device_drop"
    place = 1
    title = "Threshold voltage of the switches and diodes"
    signature = "as dead time, but independent of switching frequency and link voltage"
    source = "A. R. Munoz, T. A. Lipo, IEEE Trans. Power Electron. 14(2), 1999; slope resistance is part of R_s"
    confounders = (Confounder("dead_time", is_always_tied=True, told_apart_by=at_half_the_frequency, as_one=BOTH),)
    words = Words("The inverter's switches and diodes take {size} from every leg", HARMLESS, COMPENSATE, is_normal=True)
    half_over_knee = 0.577

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        return self.numbers(LEGS, setting) if setting.link_varies else ()


CAUSE = DeviceDrop()
