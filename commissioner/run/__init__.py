"""Runs on a real drive: a plan in, an energised and archived run with its outcome out."""
