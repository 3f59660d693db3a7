"""What a campaign could find, and which tests and sensors would show more: the next bench day.

`gathered` is what tests tell of candidate causes with everything healthy integrated out, `multiples` which of them need
no columns of their own. `detectable` says how large each cause must be to be seen, `courses` what a bench could run and
`observed` what else it could read, `limits` how hot that becomes, `chain` what is worth most an hour.
"""
