"""Archives for tests: many synthetic runs, a PostgreSQL of the test's own."""
