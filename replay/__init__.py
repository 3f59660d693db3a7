"""Where logs, twin and SQL meet: replays, reports and the command line.

Rooms from the bottom up; each imports from those before it only: `engine`, `studies`, `show`, `exports`,
`demo`, `cli`.
`errors` is everyone's, and so is `written`, by which a file is there whole or not at all; `shipped` finds the examples
that come with the program.
"""
