"""A manufacturer's sheet as text: names (what a value is called), cells (numbers with units and last digits), reading (the file)."""
