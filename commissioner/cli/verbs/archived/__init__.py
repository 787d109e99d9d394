"""Verbs on runs that have ended: list, show, compare, report, export, verify; restore, write back, replay."""
