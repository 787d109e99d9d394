"""Verbs about recordings and test sheets: identify, diagnose, monitor, simulate; what they share of intake and trust. In: typed requests; out: typed results."""
