"""Ordinary drives as their files in `config/drives` describe them, worn as a face: registers, memory, keypad, own tuning.

What a file says is read by code of this package's own; how such a drive behaves behind it (states, what is volatile, what a
tuning does and how it goes wrong) is decided here. The answer key tells what was true.
"""
