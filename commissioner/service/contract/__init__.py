"""The JSON of the API, as promised: names, shapes, units; a file for each noun. `description` makes OpenAPI say it."""
