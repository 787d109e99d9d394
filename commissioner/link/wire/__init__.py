"""Bytes and answers: Modbus over TCP, TLS and serial lines, and when an answer may be believed."""
