"""The conformance kit: every rule of the commissioning map, asked of somebody's firmware, with the evidence.

`rules` and what they stand on are pure: a rule is a generator that yields what to ask and gets the answers.
`line` and `kit` touch the wire and the clock.
"""
