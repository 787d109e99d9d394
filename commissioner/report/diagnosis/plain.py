"""What each cause is called, what it means for the motor, and what a technician does about it, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Plain:
    """`says`: the headline's sentence, `{size}` is the cause's first size. `drive` and `measurement`: what to do there."""

    says: str
    motor: str
    drive: str = ""
    measurement: str = ""
    is_normal: bool = False


FINE = "This is the measurement's error, not the motor's."
LATE = "Nothing to repair: one or two sampling periods are usual. A delay that is known can be taken off the current's time."
LEGS = Plain(
    "The inverter loses {size} per leg (dead time and device drop together)",
    "This is no fault of the motor. At low speed the torque ripples a little and a stator resistance measured through this inverter can "
    "come out wrong; at higher speed it hardly matters.",
    "Switch the drive's dead-time compensation on if it has one, and record again: this error must become smaller.",
    is_normal=True,
)
READ_LATE = Plain(
    "The current is read {size} after the instant it is recorded for",
    FINE,
    measurement="Read the current at the step of the command, or correct its time stamps by that.",
)
RECORDED_SWING = Plain(
    "The DC link's voltage moves as it was recorded, whatever the motor does, and {size} of that reaches the motor",
    "This is no fault of the motor. Something else moves the link: the mains, or another drive on it.",
    "Switch DC-link (bus voltage) compensation on; look for what else draws on the link.",
)
PLAIN: Mapping[str, Plain] = {
    "dead_time": Plain("The inverter's dead time takes {size} from every leg", LEGS.motor, LEGS.drive, is_normal=True),
    "device_drop": Plain(
        "The inverter's switches and diodes take {size} from every leg", LEGS.motor, LEGS.drive, is_normal=True
    ),
    "dc_link_sag": Plain(
        "The DC link sags by {size} at rated power, and nothing makes up for it",
        "This is no fault of the motor. Under load it gets less voltage than the drive believes.",
        "Switch DC-link (bus voltage) compensation on; if the sag is new, check the supply.",
        "Record the DC-link voltage too (column dc_link_v).",
    ),
    "dc_link_ripple": Plain(
        "Ripple of the DC link ({size}) reaches the motor",
        "This is no fault of the motor. Its torque can hum at the ripple's frequency.",
        "If the ripple is new, check the three mains phases and the link's capacitors.",
        "Record the DC-link voltage too (column dc_link_v).",
    ),
    "cable_capacitance": Plain(
        "The motor cable draws a current of its own ({size} per phase)",
        "This is no fault of the motor. The drive's sensors see a current that never reaches it.",
        measurement="Usual for long or shielded cables. Measure at the motor's end where it matters.",
    ),
    "magnetizing_saturation": Plain(
        "The motor's main iron saturates: {size} more magnetizing current at the highest flux of the test",
        "Every motor does this near rated flux. One L_M is right at one flux only.",
        "Enter the L_M at rated flux that `commissioner identify` gives, and its curve where the drive has a table for it.",
        is_normal=True,
    ),
    "magnetic_hysteresis": Plain(
        "The motor's iron has hysteresis ({size} of magnetizing current)",
        "Every iron has some. It costs a little power at low frequency and moves no parameter much.",
        is_normal=True,
    ),
    "remanence": Plain(
        "The iron still held flux when the test began ({size})",
        "This is no fault of the motor.",
        measurement="Wait ten seconds with the inverter off between two tests.",
    ),
    "leakage_saturation": Plain(
        "The leakage inductance falls by {size} up to the largest current",
        "Usual with closed or narrow slots. One leakage inductance is right at one current only.",
        "Use the drive's table for it where there is one; if the current control rings at large current, lower its gain.",
        is_normal=True,
    ),
    "rotor_skin_effect": Plain(
        "The rotor's resistance rises by {size} with frequency (skin effect in the bars)",
        "Every cage does this, large ones most. At running slip the low-frequency value counts.",
        "Do not enter a rotor resistance from a locked-rotor test at mains frequency: it is too high.",
        is_normal=True,
    ),
    "iron_loss": Plain(
        "The iron loses power to eddy currents",
        "Every motor does. The loss grows with flux and frequency.",
        "Enter an iron loss only where the drive asks for one.",
        is_normal=True,
    ),
    "stator_heating": Plain(
        "The stator winding warmed during the test (its resistance rose by {size} at rated current)",
        "This is no fault of the motor. R_s holds for the temperature of the test.",
        "Enter R_s with the winding's temperature where the drive asks for it.",
        "Pause between the tests.",
        True,
    ),
    "rotor_heating": Plain(
        "The rotor warmed during the test (its resistance rose by {size} at rated current)",
        "This is no fault of the motor. R_R holds for the temperature of the test.",
        measurement="Pause between the tests.",
        is_normal=True,
    ),
    "shaft_motion": Plain(
        "The shaft moved during the test ({size})",
        "The values of a shaft that moves are not those of one at rest.",
        measurement="Block the shaft and record again.",
    ),
    "inductance_anisotropy": Plain(
        "The inductance differs with the direction in the motor ({size})",
        "A few per cent are built in (slots, winding). A change against an older recording can mean a rotor or bearing fault.",
        measurement="Keep this recording to compare with later.",
    ),
    "resistance_anisotropy": Plain(
        "The resistance differs between the directions of the motor ({size})",
        "A loose terminal, an unequal winding or a broken rotor bar does this.",
        measurement="Tighten the terminals, then compare the three windings with an ohmmeter.",
    ),
    "sampling_delay": Plain("The current is recorded {size} after the voltage", FINE, measurement=LATE),
    "sensor_lag": Plain(
        "The current sensors are slow by {size}", FINE, measurement="Check the filters of the current inputs."
    ),
    "sensor_offset": Plain(
        "The current sensors are off zero (by up to {size})",
        FINE,
        "Let the drive calibrate its current sensors at rest, if it can.",
        "Read the three currents with the inverter off, and take that off.",
    ),
    "sensor_drift": Plain(
        "The zero of the current sensors wanders ({size})",
        FINE,
        measurement="Let the sensors warm up; read their zero before and after the test.",
    ),
    "sensor_gain_mismatch": Plain(
        "The current sensors differ in gain (by up to {size})",
        FINE,
        measurement="Send one current through all three sensors in series and calibrate them against each other.",
    ),
    "sensor_nonlinearity": Plain(
        "The current sensors are not straight ({size} at full scale)",
        FINE,
        measurement="Check that the sensors' range suits the current; compare with a good meter.",
    ),
    "quantization": Plain(
        "The currents come in coarse steps ({size})", FINE, measurement="Use a smaller measuring range."
    ),
    "clipping": Plain(
        "The current channel was at its limit ({size})",
        FINE,
        measurement="Lower the level or use a larger measuring range.",
    ),
    "mains_pickup": Plain(
        "Mains hum is in the current channels ({size})",
        FINE,
        measurement="Lay the sensor cables away from mains and motor cables; ground their shield.",
    ),
    "clock_drift": Plain(
        "The clocks of current and voltage run apart ({size})",
        FINE,
        measurement="Record both with one instrument.",
    ),
    "lost_samples": Plain("Samples were lost ({size} of them)", FINE, measurement="Check the logger's connection."),
}
