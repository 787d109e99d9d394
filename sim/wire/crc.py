"""The check of a serial frame."""


def crc_bytes(body: bytes) -> bytes:
    """CRC-16/MODBUS of a frame, low byte first as RTU sends it; of a frame with its own, zero."""
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc.to_bytes(2, "little")
