"""Test sheets of other forms as the table of one row for each point: quantities down the rows, a list for each test."""
