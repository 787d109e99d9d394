"""The last gate: a command in, allowed or refused out; a block of samples in, go on or stop out."""
