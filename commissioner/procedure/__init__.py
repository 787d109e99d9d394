"""The commissioning procedure, without a wire: drive replies in, commands, decisions and a verdict out."""
