"""The run folder and what can be had from it: records and blocks in, list, report and replay out."""
