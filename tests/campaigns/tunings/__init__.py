"""Tunings of emulated vendors in accelerated time: what happened by the answer key, and what `tune` made of it."""
