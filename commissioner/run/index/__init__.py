"""The archive's index: one row a run, for lists that read no folder. Summaries of run folders in, rows out.

The folders are the truth. The index can be deleted at any time; whatever it says is compared with the folders before it is
believed (`index.refresh`), so a kill, a folder deleted by hand or a lost write costs a moment and nothing else.
"""
