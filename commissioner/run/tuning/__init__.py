"""A drive's own standstill autotune as a run with a folder: snapshot, repeats, verdict, the best set or the snapshot."""
