"""Mistakes a firmware author makes, seeded into the reference firmware one at a time, and the rule that must name each."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Defect:
    """`changes`: (text that stands once in `file`, what stands there instead)."""

    name: str
    file: str
    changes: tuple[tuple[str, str], ...]
    rule: str


def _defect(name: str, file: str, old: str, new: str, rule: str) -> Defect:
    return Defect(name, file, ((old, new),), rule)


MAP, REGISTERS, STATUS = "src/cm_map.c", "src/cm_registers.c", "src/cm_status.c"
STATES, EXCITATION, RING, PARAMETERS = "src/cm_states.c", "src/cm_excitation.c", "src/cm_ring.c", "src/cm_parameters.c"
SERVER = "host/server.c"

LINK = (
    _defect(
        "function 23 reads before it writes",
        SERVER,
        "show_what_is_held(drive, word_at(&pdu[5]), word_at(&pdu[7]), &pdu[10]);\n        return why;",
        "for (int k = 0; k < 2 * word_at(&pdu[7]); k++) pdu[10 + k] ^= 0xFF;\n        return why;",
        "function-23-writes-before-it-reads",
    ),
    _defect(
        "answers come late",
        SERVER,
        "cm_answer why = carry_out",
        "usleep(150000); cm_answer why = carry_out",
        "answers-come-within-the-turn-around",
    ),
    _defect(
        "unknown function gets exception 3",
        SERVER,
        "return CM_NO_SUCH_FUNCTION;",
        "return CM_BAD_VALUE;",
        "unknown-functions-are-refused",
    ),
    _defect(
        "echo register forgets",
        REGISTERS,
        "memcpy(&drive->image[address], words,",
        "if (address != CM_ECHO) memcpy(&drive->image[address], words,",
        "echo-holds-any-word",
    ),
    _defect(
        "unmapped registers read as zero",
        MAP,
        "if (!item)\n            return false;\n        at =",
        "if (!item && at >= CM_IMAGE_WORDS) return false;\n        if (!item) { at++; continue; }\n        at =",
        "unmapped-registers-are-refused",
    ),
    _defect(
        "unmapped registers get exception 3",
        "src/cm_map.h",
        "CM_NO_SUCH_ADDRESS = 2",
        "CM_NO_SUCH_ADDRESS = 4",
        "unmapped-registers-are-refused",
    ),
    _defect(
        "a run reads shifted by one",
        REGISTERS,
        "memcpy(words, &drive->image[address], count",
        "memcpy(words, &drive->image[address + (count > 1)], count",
        "reads-agree-however-they-are-cut",
    ),
    _defect(
        "a longest read is refused",
        REGISTERS,
        "count > CM_LONGEST_READ",
        "count > 100",
        "longest-read-is-answered-and-longer-refused",
    ),
    _defect(
        "read-only items take writes",
        MAP,
        "RO(CM_SERIAL_NUMBER, CM_U32, 1)",
        "RW(CM_SERIAL_NUMBER, CM_U32, 1, 0, ANY)",
        "read-only-items-stay",
    ),
    Defect(
        "half a number is written",
        REGISTERS,
        (
            ("skip % each || count < each", "0"),
            ("left <= count ? left : count - count % each", "left <= count ? left : count"),
        ),
        "numbers-are-never-written-by-half",
    ),
    _defect(
        "good values of a bad request stay",
        REGISTERS,
        "if (!used)\n            return answer;",
        "if (!used) { memcpy(&drive->image[address], words, k * sizeof *words); return answer; }",
        "one-bad-value-keeps-the-whole-request-out",
    ),
    _defect(
        "not-a-number is taken",
        REGISTERS,
        "isfinite(value) && value >= item->low && value <= item->high",
        "!(value < item->low || value > item->high)",
        "values-out-of-range-are-refused",
    ),
    _defect(
        "a tone too many is taken",
        MAP,
        "CM_U16, 1, 0, CM_TONE_LIMIT",
        "CM_U16, 1, 0, 65535",
        "values-out-of-range-are-refused",
    ),
)

WHO = (
    _defect("another magic number", "src/cm_map.h", "0x434D5352u", "0x434D5353u", "magic-and-map-version"),
    _defect(
        "map version of tomorrow",
        STATUS,
        "image[CM_MAP_VERSION] = 1;",
        "image[CM_MAP_VERSION] = 2;",
        "magic-and-map-version",
    ),
    _defect(
        "drive type byte-swapped",
        STATUS,
        "k % 2 ? at[k / 2] | character : character << 8",
        "k % 2 ? at[k / 2] | character << 8 : character",
        "type-and-firmware",
    ),
    _defect("serial number zero", STATUS, "r->serial_number)", "0)", "serial-number-stays"),
    _defect(
        "floats low word first",
        MAP,
        "cm_put_u32(at, bits);",
        "cm_put_u32(at, bits << 16 | bits >> 16);",
        "ratings-can-be",
    ),
    _defect(
        "control period in microseconds",
        STATUS,
        "control_period_s * 1.0e9f",
        "control_period_s * 1.0e6f",
        "ratings-can-be",
    ),
    _defect(
        "a ring too short",
        "src/cm_drive.h",
        "#define CM_RING_SAMPLES 4096u",
        "#define CM_RING_SAMPLES 512u",
        "stream-scales-reach",
    ),
    _defect(
        "DC link as a per-unit value",
        STATUS,
        "cm_port_dc_link_v());",
        "cm_port_dc_link_v() / 540.0f);",
        "measurements-can-be",
    ),
    _defect(
        "interlock bits nobody knows",
        STATUS,
        "image[CM_INTERLOCKS] = cm_port_interlocks();",
        "image[CM_INTERLOCKS] = cm_port_interlocks() | 0x8000;",
        "interlocks-are-the-files",
    ),
    _defect("synchronous speed on the plate", STATUS, "r->rated_speed_rpm)", "1500.0f)", "plate-of-the-motor"),
)

SUPERVISION = (
    _defect("watchdog takes too short a time", REGISTERS, "value < 100.0f", "value < 0.0f", "watchdog-takes-its-range"),
    _defect(
        "watchdog takes too long a time", MAP, "CM_U16, 1, 0, 2000", "CM_U16, 1, 0, 65535", "watchdog-takes-its-range"
    ),
    _defect(
        "limits are rounded",
        REGISTERS,
        "    for (int k = 0; k < cm_item_count; k++) {",
        "    cm_put_f32(&drive->image[CM_CURRENT_LIMIT], roundf(cm_get_f32(&drive->image[CM_CURRENT_LIMIT])));\n    for (int k = 0; k < cm_item_count; k++) {",
        "limits-hold-what-they-are-given",
    ),
    _defect(
        "last tone is not kept",
        MAP,
        "STOP(CM_TONES, CM_F32, 24,",
        "STOP(CM_TONES, CM_F32, 23,",
        "excitation-holds-what-it-is-given",
    ),
    _defect(
        "heartbeat echo is one behind",
        STATES,
        "drive->heartbeat_echo = heartbeat;",
        "drive->heartbeat_echo = (uint16_t)(heartbeat - 1);",
        "heartbeat-is-echoed",
    ),
    _defect(
        "enables without watchdog", STATES, "&& drive->image[CM_WATCHDOG_MS] >= 100", "", "no-enable-without-watchdog"
    ),
    _defect(
        "enables without current limit",
        STATES,
        "&& cm_get_f32(&drive->image[CM_CURRENT_LIMIT]) > 0.0f",
        "",
        "no-enable-without-current-limit",
    ),
    _defect(
        "enables without time limit",
        STATES,
        "&& cm_get_f32(&drive->image[CM_TEST_TIME_LIMIT]) > 0.0f",
        "",
        "no-enable-without-time-limit",
    ),
    _defect(
        "enables without voltage limit",
        STATES,
        "&& cm_get_f32(&drive->image[CM_VOLTAGE_LIMIT]) > 0.0f",
        "",
        "no-enable-without-voltage-limit",
    ),
    _defect(
        "enables without duration",
        STATES,
        "&& cm_get_f32(&drive->image[CM_DURATION]) > 0.0f",
        "",
        "no-enable-without-duration",
    ),
    _defect(
        "enables without the mode",
        STATES,
        "return drive->image[CM_MODE] == 1",
        "return 1",
        "no-enable-without-the-mode",
    ),
    _defect("watchdog never bites", STATES, "silent_ms > watchdog_ms", "0", "the-watchdog-bites"),
    _defect(
        "watchdog in hundredths of a second",
        STATES,
        "silent_ms > watchdog_ms",
        "silent_ms > 10u * watchdog_ms",
        "the-watchdog-bites",
    ),
    _defect(
        "watchdog fed by a repeated heartbeat",
        STATES,
        "if (heartbeat == drive->heartbeat_echo)\n        return;",
        "",
        "only-a-changed-heartbeat-feeds",
    ),
    _defect(
        "watchdog is a timer from enable",
        STATES,
        "    drive->fed_at_ms = cm_port_milliseconds();\n    cm_renew_claim(drive);\n}",
        "    cm_renew_claim(drive);\n}",
        "a-fed-watchdog-does-not-bite",
    ),
    _defect(
        "no overcurrent trip", STATES, "drive->largest_current_a > drive->trip_current_a", "0", "too-much-current-trips"
    ),
    _defect(
        "overcurrent seen in phase u only",
        STATES,
        "for (int phase = 0; phase < 3; phase++)",
        "for (int phase = 0; phase < 1; phase++)",
        "too-much-current-trips",
    ),
    _defect("a trip keeps no value", STATES, "drive->trip_value = value;", "", "the-watchdog-bites"),
    _defect("no test-time limit", STATES, "e->period >= e->time_limit_period", "0", "the-time-limit-trips"),
    _defect(
        "needs-stop items take writes while energised",
        REGISTERS,
        "(item->flags & CM_NEEDS_STOP) && drive->state == CM_ENABLED",
        "0",
        "settings-that-need-a-stop-are-refused-while-energised",
    ),
)

COMMANDS = (
    _defect(
        "switches on from disabled",
        STATES,
        "else if (drive->state == CM_SWITCH_ON_DISABLED)",
        "else if (drive->state == CM_SWITCH_ON_DISABLED && (word & 0x08))",
        "switching-on-needs-a-shut-down-before",
    ),
    _defect(
        "enables from disabled",
        STATES,
        "else if (drive->state == CM_SWITCH_ON_DISABLED)",
        "else if (drive->state == CM_SWITCH_ON_DISABLED && !(word & 0x08))",
        "no-enable-from-switch-on-disabled",
    ),
    _defect(
        "quick stop does nothing",
        STATES,
        "!(word & ENABLE_VOLTAGE) || !(word & QUICK_STOP_OFF)",
        "!(word & ENABLE_VOLTAGE)",
        "quick-stop-disables",
    ),
    _defect(
        "shut down does not block",
        STATES,
        "(word & 0x07) == 0x06",
        "(word & 0x07) == 0x06 && drive->state != CM_ENABLED",
        "shut-down-blocks-at-once",
    ),
    _defect(
        "disable voltage does not block",
        STATES,
        "!(word & ENABLE_VOLTAGE) || !(word & QUICK_STOP_OFF)",
        "drive->state != CM_ENABLED && (!(word & ENABLE_VOLTAGE) || !(word & QUICK_STOP_OFF))",
        "disable-voltage-blocks-at-once",
    ),
    _defect(
        "ready shown as switched on", "src/cm_map.h", "CM_READY = 0x21", "CM_READY = 0x25", "states-follow-the-commands"
    ),
    _defect(
        "current shown at rest",
        STATUS,
        "is_on ? drive->largest_current_a : 0.0f",
        "0.01f + drive->largest_current_a",
        "at-rest-nothing-runs",
    ),
    _defect("a held reset bit resets", STATES, "&& !(drive->last_control & RESET_FAULT)", "", "a-fault-needs-a-reset"),
    _defect(
        "any command leaves a fault", STATES, "if (is_reset_edge && cm_port", "if (cm_port", "a-fault-needs-a-reset"
    ),
    _defect(
        "the reset forgets the cause",
        STATES,
        "            drive->fault = CM_TRIP_NONE;",
        "            drive->fault = drive->trip_cause = CM_TRIP_NONE;",
        "the-trip-cause-outlives-the-reset",
    ),
)

WRITE_BACK = (
    _defect(
        "staging is in use at once",
        REGISTERS,
        "    for (int k = 0; k < cm_item_count; k++) {",
        "    if (address >= CM_STAGED && address < CM_STAGED_CRC) memcpy(&drive->image[CM_IN_USE], &drive->image[CM_STAGED], 16);\n    for (int k = 0; k < cm_item_count; k++) {",
        "staged-values-are-held",
    ),
    _defect(
        "check sum is not looked at",
        PARAMETERS,
        "cm_crc16(0xFFFF, staged, 2 * CM_PARAMETERS) != drive->image[CM_STAGED_CRC]",
        "0",
        "a-wrong-check-sum-is-refused",
    ),
    _defect(
        "check sum by its low byte",
        PARAMETERS,
        "cm_crc16(0xFFFF, staged, 2 * CM_PARAMETERS) != drive->image[CM_STAGED_CRC]",
        "(cm_crc16(0xFFFF, staged, 2 * CM_PARAMETERS) ^ drive->image[CM_STAGED_CRC]) & 0xFF",
        "a-wrong-check-sum-is-refused",
    ),
    _defect(
        "check sum over three values",
        PARAMETERS,
        "cm_crc16(0xFFFF, staged, 2 * CM_PARAMETERS) !=",
        "cm_crc16(0xFFFF, staged, 6) !=",
        "a-commit-brings-into-use-and-does-not-store",
    ),
    _defect(
        "impossible values are taken",
        PARAMETERS,
        "!(value >= lowest[k] && value <= highest[k])",
        "value != value",
        "impossible-values-are-refused",
    ),
    _defect(
        "a commit stores",
        PARAMETERS,
        "    drive->commit_result = result;",
        "    drive->commit_result = result;\n    drive->store_result = CM_WORKING;",
        "a-commit-brings-into-use-and-does-not-store",
    ),
    _defect(
        "a commit stays busy",
        PARAMETERS,
        "if (drive->commit_result == CM_WORKING)",
        "if (0)",
        "a-commit-brings-into-use-and-does-not-store",
    ),
    _defect("any word commits", REGISTERS, "word == CM_COMMIT_WORD", "word", "only-the-command-word-commits"),
    _defect("a store counts twice", PARAMETERS, "next.store_count++;", "next.store_count += 2;", "a-store-writes-once"),
    _defect(
        "a store loses the last value",
        PARAMETERS,
        "for (int k = 0; k < CM_PARAMETERS; k++)\n            next",
        "for (int k = 0; k < CM_PARAMETERS - 1; k++)\n            next",
        "a-store-writes-once",
    ),
)

SIGNAL = (
    _defect(
        "phase in degrees",
        EXCITATION,
        "cm_get_f32(tone + 4) / RADIANS_PER_TURN",
        "cm_get_f32(tone + 4) / 360.0",
        "eight-tones-at-control-rate",
    ),
    _defect("sines for cosines", EXCITATION, "cosf(angle)", "sinf(angle)", "eight-tones-at-control-rate"),
    _defect(
        "seven tones", EXCITATION, "k < e->tones; k++", "k < e->tones && k < 7; k++", "eight-tones-at-control-rate"
    ),
    _defect(
        "tones a period late",
        EXCITATION,
        "(float)(int32_t)e->turn[k]",
        "(float)(int32_t)(e->turn[k] - e->turn_step[k])",
        "eight-tones-at-control-rate",
    ),
    _defect(
        "tone count is not looked at",
        EXCITATION,
        "k < e->tones; k++",
        "k < CM_TONE_LIMIT; k++",
        "only-the-counted-tones-play",
    ),
    _defect(
        "bias ramp of half the rate",
        EXCITATION,
        "cm_get_f32(&drive->image[CM_BIAS_RAMP]) * period_s",
        "cm_get_f32(&drive->image[CM_BIAS_RAMP]) * 0.5f * period_s",
        "bias-follows-its-ramp",
    ),
    _defect(
        "negative bias without ramp",
        EXCITATION,
        "return value - target > step ? value - step : target;",
        "return target;",
        "bias-follows-its-ramp",
    ),
    _defect(
        "scale without ramp",
        EXCITATION,
        "e->scale_step = scale_step;",
        "e->scale_step = 1000000000;",
        "scale-follows-its-ramp",
    ),
    _defect(
        "live values are not taken",
        REGISTERS,
        "        cm_take_live(drive);",
        "        ;",
        "live-values-are-reached-at-their-ramps",
    ),
    _defect(
        "axis turns backwards",
        EXCITATION,
        "e->sin_axis = (float)sin",
        "e->sin_axis = -(float)sin",
        "currents-lie-along-the-axis",
    ),
    _defect(
        "axis in radians",
        EXCITATION,
        "cm_get_f32(&drive->image[CM_AXIS_DEG]) / 360.0",
        "cm_get_f32(&drive->image[CM_AXIS_DEG]) / RADIANS_PER_TURN",
        "currents-lie-along-the-axis",
    ),
    _defect(
        "phases v and w exchanged",
        RING,
        "(uint16_t)ring->sample[row][channel];",
        "(uint16_t)ring->sample[row][channel > 1 ? 5 - channel : channel];",
        "currents-lie-along-the-axis",
    ),
    _defect(
        "voltage limit does not hold",
        STATES,
        "float kept = volts > limit_v ? limit_v : (volts < -limit_v ? -limit_v : volts);",
        "float kept = volts + 0.0f * limit_v; if (fabsf(volts) > limit_v) *flags |= CM_FLAG_CLAMPED;",
        "the-voltage-limit-clamps-and-is-flagged",
    ),
    _defect(
        "a clamp is not flagged", STATES, "*flags |= CM_FLAG_CLAMPED;", ";", "the-voltage-limit-clamps-and-is-flagged"
    ),
    _defect(
        "the duration does not end it",
        EXCITATION,
        "e->period >= e->last_period;",
        "0;",
        "the-test-ends-by-itself-after-its-duration",
    ),
    _defect(
        "the end does not ramp",
        EXCITATION,
        "is_over && e->bias == 0 && e->scale == 0",
        "is_over",
        "the-test-ends-by-itself-after-its-duration",
    ),
    _defect(
        "present bias is the target",
        STATUS,
        "(float)e->bias / 1.0e9f : 0.0f",
        "(float)e->bias_target / 1.0e9f : 0.0f",
        "the-status-says-what-is-applied",
    ),
)

WINDOW = (
    _defect(
        "check sum over the header only",
        RING,
        "window + CM_WINDOW_HEADER, used);",
        "window + CM_WINDOW_HEADER, 0);",
        "the-check-sum-is-right",
    ),
    _defect(
        "check sum over unused registers",
        RING,
        "window + CM_WINDOW_HEADER, used);",
        "window + CM_WINDOW_HEADER, CM_WINDOW_DATA);",
        "the-check-sum-is-right",
    ),
    _defect(
        "DC link in volts, not counts",
        RING,
        "/ cm_port_ratings()->dc_link_scale_v",
        "/ 1.0f",
        "the-header-says-what-the-window-is",
    ),
    _defect(
        "session number of the last session",
        RING,
        "window[0] = drive->session;",
        "window[0] = (uint16_t)(drive->session - 1);",
        "the-header-says-what-the-window-is",
    ),
    _defect(
        "reading consumes",
        RING,
        "uint32_t first = wanted < oldest ? oldest : wanted;",
        "uint32_t first = ring->next_unread < oldest ? oldest : ring->next_unread;",
        "asking-again-gives-the-same-samples",
    ),
    _defect(
        "every thirtieth sample is lost",
        RING,
        "    ring->produced++;",
        "    if (ring->produced++ % 30 == 29) ring->produced++;",
        "eight-tones-at-control-rate",
    ),
    _defect(
        "samples that are not there yet",
        RING,
        "ready < room ? (uint16_t)ready : room",
        "room",
        "what-is-not-there-yet-is-not-given",
    ),
    _defect(
        "no overrun flag",
        RING,
        "wanted < oldest ? CM_FLAG_OVERRUN : 0",
        "0",
        "what-was-overwritten-is-flagged-and-counted",
    ),
    _defect(
        "overruns are not counted",
        RING,
        "ring->overruns += oldest - ring->next_unread;",
        "",
        "what-was-overwritten-is-flagged-and-counted",
    ),
    _defect(
        "channels in reverse order",
        RING,
        "ring->mask >> channel & 1",
        "ring->mask >> (CM_CHANNELS - 1 - channel) & 1",
        "the-mask-chooses-channels",
    ),
    _defect(
        "decimation without averaging",
        RING,
        "mean(ring->sum[channel], ring->in_mean)",
        "(channel ? currents[channel - 1] : voltage)",
        "decimated-samples-are-means",
    ),
    _defect(
        "decimation is not looked at",
        RING,
        "ring->in_mean < ring->decimation",
        "ring->in_mean < 1",
        "decimated-samples-are-means",
    ),
    _defect(
        "running for ever",
        RING,
        "drive->state == CM_ENABLED ? CM_FLAG_RUNNING",
        "drive->session ? CM_FLAG_RUNNING",
        "the-running-flag-is-the-output",
    ),
    _defect(
        "ended in every window after the end",
        RING,
        "ring->has_ended && ready <= count",
        "ring->has_ended",
        "the-last-window-says-that-it-is",
    ),
    _defect(
        "as many samples whatever is asked for",
        RING,
        "(registers - CM_WINDOW_HEADER) / channels : 0",
        "CM_WINDOW_DATA / channels : 0",
        "a-shorter-read-is-a-whole-window",
    ),
    _defect(
        "samples end with their session",
        RING,
        "uint32_t produced = ring->produced;",
        "if (ring->has_ended) memset(ring->sample, 0, sizeof ring->sample);\n    uint32_t produced = ring->produced;",
        "samples-outlive-their-session",
    ),
    _defect("ended never", RING, "ring->has_ended && ready <= count", "0", "the-last-window-says-that-it-is"),
    _defect("one session number for all", STATES, "    drive->session++;", "", "every-session-has-its-own-number"),
    _defect(
        "sample count runs on",
        RING,
        "ring->produced = ring->next_unread = ring->overruns = 0;",
        "ring->next_unread = ring->overruns = 0;",
        "every-session-has-its-own-number",
    ),
)

LATER = (
    _defect(
        "check sum over what is in use instead of what is staged",
        PARAMETERS,
        "cm_crc16(0xFFFF, staged, 2 * CM_PARAMETERS)",
        "cm_crc16(0xFFFF, &drive->image[CM_IN_USE], 2 * CM_PARAMETERS)",
        "the-check-sum-covers-every-value",
    ),
    _defect(
        "quick stop is heard at rest only",
        STATES,
        " || !(word & QUICK_STOP_OFF))",
        " || (!(word & QUICK_STOP_OFF) && drive->state != CM_ENABLED))",
        "quick-stop-blocks-at-once",
    ),
    _defect(
        "the bias is never applied",
        EXCITATION,
        "*volts = (float)e->bias / BILLION +",
        "*volts = 0.0f * (float)e->bias +",
        "a-bias-drives-a-current",
    ),
    _defect(
        "phase w shows phase v",
        STATES,
        "cm_port_currents(currents);",
        "cm_port_currents(currents); currents[2] = currents[1];",
        "phase-currents-sum-to-nothing",
    ),
    _defect(
        "the first window is called an overrun",
        RING,
        "flags |= wanted < oldest ?",
        "flags |= wanted <= oldest ?",
        "windows-join-without-gap",
    ),
    _defect(
        "the window's index moves by function 23 only",
        SERVER,
        "return write_half(drive, address, count, &pdu[6]);",
        "return address == CM_WINDOW_INDEX ? CM_OK : write_half(drive, address, count, &pdu[6]);",
        "write-and-read-apart-give-the-same-window",
    ),
)

ON_A_SERIAL_LINE = _defect(
    "answers for every device number",
    SERVER,
    "    if (length <= 0) /*",
    "    if (length == 0) {\n        carry_out(drive, table, &request[1]);\n        modbus_set_slave(line, request[0]);\n"
    "        modbus_reply(line, request, 8, table);\n        modbus_set_slave(line, 1);\n    }\n    if (length <= 0) /*",
    "other-devices-numbers-are-left-alone",
)
"""To be tried over a serial line, where there are several devices."""

DEFECTS: tuple[Defect, ...] = (*LATER, *LINK, *WHO, *SUPERVISION, *COMMANDS, *WRITE_BACK, *SIGNAL, *WINDOW)
