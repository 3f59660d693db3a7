"""From a number back to the bytes that it came from.

`trace` finds what is asked for, the facts that it follows from, and the records of the logs behind a point;
`openlineage` says them as other catalogues take them.
"""
