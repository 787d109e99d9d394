"""Campaigns: many simulated commissionings, or many recordings, as a table. In: a study file; out: rows, a summary, a page.

Cases are drawn from seeds, so that rows are the same for any number of workers; a worker that dies loses only what it was
at. The simulator comes in by the entry point `commissioner.simulators`; only PDUs, a nameplate and an answer key cross.
"""
