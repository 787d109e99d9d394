"""Status words against the state table of CiA 402 / IEC 61800-7-201."""

import pytest

from commissioner.registers.status import DriveState, decode_bits, decode_state


@pytest.mark.parametrize(
    ("word", "state", "may_be_energised"),
    [
        (0x0000, DriveState.NOT_READY, False),
        (0x0040, DriveState.SWITCH_ON_DISABLED, False),
        (0x0250, DriveState.SWITCH_ON_DISABLED, False),
        (0x0021, DriveState.READY_TO_SWITCH_ON, False),
        (0x0231, DriveState.READY_TO_SWITCH_ON, False),
        (0x0023, DriveState.SWITCHED_ON, False),
        (0x0027, DriveState.OPERATION_ENABLED, True),
        (0x0237, DriveState.OPERATION_ENABLED, True),
        (0x0007, DriveState.QUICK_STOP_ACTIVE, True),
        (0x000F, DriveState.FAULT_REACTION_ACTIVE, True),
        (0x0008, DriveState.FAULT, False),
        (0x0218, DriveState.FAULT, False),
        (0x0001, DriveState.UNKNOWN, True),
    ],
)
def test_cia402_words_are_the_standards_states(word, state, may_be_energised):
    assert decode_state("cia402", word, {}) is state
    assert state.may_be_energised is may_be_energised


def test_every_word_has_a_state_and_the_manufacturers_bits_do_not_change_it():
    for word in range(0x80):
        assert decode_state("cia402", word, {}) is decode_state("cia402", word | 0xFF10, {})


DANFOSS = {"ready": 1, "running": 11, "fault": 3}


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0800, DriveState.OPERATION_ENABLED),
        (0x0808, DriveState.OPERATION_ENABLED),
        (0x0008, DriveState.FAULT),
        (0x0002, DriveState.READY_TO_SWITCH_ON),
        (0x0000, DriveState.NOT_READY),
    ],
)
def test_named_bits_are_states_and_running_outranks_all(word, state):
    assert decode_state("bits", word, DANFOSS) is state


def test_interlocks_are_named_claims():
    assert decode_bits(0b101, {"sto_released": 0, "remote_control": 1, "supply_ok": 2}) == {
        "sto_released": True,
        "remote_control": False,
        "supply_ok": True,
    }
