"""From a recorded session to a sealed run of the twin.

Rooms from the bottom up; each imports from those before it only: `files`, `frame`, `specimen`, `results`, `runs`.
"""
