"""One drive, one master: a lock on this computer by what the drive is, and a claim in the drive against others."""
