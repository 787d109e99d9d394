"""What the product does, one function a verb: a frozen request in, a frozen result out.

They read files and drives. They never print, ask or exit: progress goes to `observe` as records, `go_on` cancels, and what cannot
be done is an error of `commissioner.errors`. Command line, service, campaigns and tests call the same functions. Every result
becomes JSON by `commissioner.encoding.plain`; a shape that is promised stands in a `contract`, and the service's `/openapi.json` shows
it as a JSON schema.
"""
